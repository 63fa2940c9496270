"""The blocks of the race's page."""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from statistics import median

from hbvm_bench.campaign.file import name_of
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.measure import machine
from hbvm_bench.measure.measured import POSITION
from hbvm_bench.report.document import Details, Items, Note, Section, attempt
from hbvm_bench.report.figures.style import Look
from hbvm_bench.report.page import Results
from hbvm_bench.report.provenance import again
from hbvm_bench.studies.race import tables
from hbvm_bench.studies.race.families import FAMILIES
from hbvm_bench.studies.race.figures import work_precision
from hbvm_bench.studies.race.results import Race, by_kind, declared, races_of
from hbvm_bench.summaries import outcomes
from hbvm_bench.summaries.table import Table

RULES_TEXT = """
Fixed and adaptive step sizes have separate rows in every family that has both: HBVM and Gauss, and IAS15,
whose step size is fixed with epsilon = 0. heyoka's Taylor method and DOP853 always have an adaptive step
size, WHFast and the leapfrog a fixed one, so each of these has one row.

Every row has the same number of settings on every problem, declared before the run in
hbvm_bench/studies/race.toml. The fastest setting that is accurate enough is picked afterwards, by
the same rule for every row. A ratio, and with it a goal, compares families, in rounds that did not choose
the settings, and from the same number of settings of each: of a family with two rows (HBVM and Gauss, IAS15),
every second setting of either row takes part, counted in the order of declaration. The
rule does not look at results.

Energy is never ranked without position: a setting counts only if both errors are small enough. A run that
leaves the trajectory which a symmetry prescribes is excluded.

The same initial doubles and the same vector field for all, from one definition; REBOUND, which computes
gravity itself, receives the same bodies.

One process, one thread, one core. All settings of a problem are timed in interleaved rounds, each round
in an order shuffled anew, with garbage collection off; all samples are kept. The timed call integrates from
the start to the end time and returns the end state, without output; it does not include compilation and
setup. A sample is as many such runs in a row as last
{shortest} ms. The overhead of one call is in the tables.

The energy error is the largest at some {count} times, one in each equal part of the integration interval and
at no common phase, at the ends of steps where the step size is fixed, else in a way that does not change the
steps; it is evaluated in double-double arithmetic.

The position error is that of the end state of the very run that is timed. {position}

SciPy's DOP853 is Python and calls a compiled vector field: on a small system most of its time is spent in
Python, and a ratio of times compares implementations. The number of evaluations compares the methods.

A setting too slow for all rounds takes part in fewer, and the table says so. What did not finish, or
does not apply, is a row with its reason.
"""


def rules(races: Sequence[Race]) -> list[str]:
    """Return the rules under which these races were run, as their own files had them."""
    asked = [race.run.index.campaign for race in races]
    said = RULES_TEXT.format(
        shortest=_each(f"{campaign.timing.shortest * 1e3:.0f}" for campaign in asked),
        count=_each(str(campaign.grid.count) for campaign in asked),
        position=POSITION,
    )
    return [" ".join(paragraph.split()) for paragraph in said.strip().split("\n\n")]


def _each(values: Iterable[str]) -> str:
    return " or ".join(dict.fromkeys(values))


def machines(results: Results) -> list[Note]:
    """Return what the times were taken on."""
    races = sorted(races_of(results), key=lambda race: race.started)
    return [Note(said) for said in machine.sentences(race.machine for race in races)]


def overview(results: Results) -> Table:
    """Return the fastest setting on every problem, and all methods relative to it."""
    return tables.overview(races_of(results))


def ratios(results: Results) -> Table:
    """Return the other libraries' best times over those of HBVM and Gauss."""
    return tables.headline(races_of(results))


def kinds(results: Results) -> Table | None:
    """Return the same by the kind of processor, where there are several."""
    races_of = by_kind(results)
    return tables.kinds(races_of) if len(races_of) > 1 else None


def goals(results: Results) -> Table:
    """Return what was asked for before, and what was measured."""
    return tables.goals(races_of(results))


def behind(results: Results) -> Table:
    """Return the settings whose times are compared."""
    return tables.behind(races_of(results))


def contests(results: Results) -> list[Section]:
    """Return the section of each problem."""
    races = races_of(results)
    navs = tables.short([race.title for race in races])
    return [section(race, results.look, nav) for race, nav in zip(races, navs, strict=True)]


def terms(results: Results) -> Section:
    """Return by what rules they competed."""
    races = races_of(results)
    ran = {name for race in races for name in race.families}
    families = [f"{family.title}: {family.code}" for name, family in FAMILIES.items() if name in ran]
    blocks = [
        Items(rules(races), "numbered"),
        "Origin of the machine code:",
        Items(families),
    ]
    return Section("The rules", blocks, "rules", nav="Rules")


def run_again(results: Results) -> Section:
    """Return the commands, and what was measured with what."""
    races = sorted(races_of(results), key=lambda race: race.started)
    days = ", ".join(sorted({race.started[:10] for race in races}))
    return again(commands(races), days, races[-1].machine, races[-1].run.versions)


def section(race: Race, look: Mapping[str, Look], nav: str) -> Section:
    """Return what the report says about one contest, under a short name for the page's head."""
    title, problem = race.title, race.records[0].case.problem
    shown = (
        tables.fastest,
        tables.compiled,
        tables.levels,
        tables.positions,
        tables.defaults,
        tables.compiling,
    )
    return Section(
        title,
        [
            Note(
                (f"To t = {make_problem(problem).t_end}. " if race.quick else "")
                + f"{race.run.index.campaign.timing.rounds} rounds."
            ),
            Items(remarks(race)),
            *attempt(
                (f"Work and precision: {title}", partial(work_precision, race, look)),
                *((f"{title}: {table.__name__}", partial(table, race)) for table in shown),
            ),
            Details(
                f"All {len(race.records)} settings",
                attempt((f"all settings of {title}", partial(tables.everything, race))),
            ),
        ],
        race.key,
        code=problem,
        nav=nav,
    )


def remarks(race: Race) -> list[str]:
    """Return what a reader must know about how a contest was run."""
    said = [race.entry.note] if race.entry.note else []
    absent = [
        FAMILIES[family].title
        for family in race.families
        if all(record.result.outcome == "refused" for record in race.settings(family))
    ]
    if absent:
        said.append(f"Does not apply: {', '.join(absent)}.")
    if race.quick:
        said.append(
            "This is the quick run: a tenth of the integration interval and few settings; its ratios are "
            "not meaningful."
        )
    if race.calibration:
        calibration = median(race.calibration)
        worst = max(abs(value / calibration - 1.0) for value in race.calibration)
        said.append(
            f"During the timing, the calibration loop took {calibration * 1e3:.2f} ms, and in its worst "
            "round "
            f"{worst:.0%} more or less."
        )
    return said + outcomes.compilations(race.records) + outcomes.beside(race.records)


def commands(races: Sequence[Race]) -> str:
    """Return the commands the contests came from; one if together they are all contests, run alike."""
    words = [race.run.command.split(" ") for race in races]
    alike = {
        " ".join(w for i, w in enumerate(ws) if "--problem" not in (w, ws[max(i - 1, 0)])) for ws in words
    }
    if len(alike) == 1 and {race.key for race in races} == {name_of(entry) for entry in declared().entries()}:
        return alike.pop()
    return "\n".join(dict.fromkeys(race.run.command for race in races))
