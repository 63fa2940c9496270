"""The report of a race, from stored results alone."""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from statistics import median

from hbvm_bench.campaign.file import name_of
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.measure import machine
from hbvm_bench.measure.measured import POSITION
from hbvm_bench.report.document import Details, Document, Files, Items, Maker, Note, Section, attempt
from hbvm_bench.report.figures.style import Look, looks
from hbvm_bench.report.provenance import PEERS, again
from hbvm_bench.studies.race import tables
from hbvm_bench.studies.race.families import FAMILIES
from hbvm_bench.studies.race.figures import work_precision
from hbvm_bench.studies.race.results import FILE, Race, declared
from hbvm_bench.summaries import outcomes
from hbvm_bench.summaries.points import family_of

RULES_TEXT = """
Fixed steps and steps that a method chooses itself are rows of their own, for every family that has both:
ours, and IAS15, which at epsilon = 0 keeps its step. heyoka's Taylor method and DOP853 choose their steps
always, WHFast and the leapfrog never, so that each of these has one row.

Every row has the same number of settings on every problem, declared before the run in
hbvm_bench/campaign/shipped/race.toml. The fastest setting that is accurate enough is picked afterwards, by
the same rule for every row. A ratio, and with it a goal, compares the fastest of all our settings with the
fastest of all the peer's, in rounds that did not choose them; ours, and IAS15's, are therefore picked from
twice as many as the others'.

Energy is never ranked without position: a setting counts only if both errors are small enough. A run
that leaves the trajectory which a symmetry prescribes is void.

The same initial doubles and the same vector field for all, from one definition; REBOUND, which computes
gravity itself, receives the same bodies.

One process, one thread, one core. All settings of a problem are timed in interleaved rounds, each round
in an order shuffled anew, with garbage collection off; all samples are kept. Timed is the call that
integrates from the start to the end time and returns the end state, without output; compiling and
setting up are not in it. A sample is as many such runs one after the other as last
{shortest} ms. The overhead of one call is in the tables.

The energy error is the largest at some {count} times, one in each equal part of the span
and at no common phase, at the methods' own steps where the step is fixed, else by the means that cost
the method nothing; it is evaluated in double-double arithmetic.

The position error is that of the end state of the very run that is timed. {position}

A setting too slow for all rounds takes part in fewer, and the table says so. What did not finish, or
does not apply, is a row with its reason.
"""


def rules(races: Sequence[Race]) -> list[str]:
    """Return the rules under which these races were run, as their own files had them."""
    asked = [race.run.index.campaign for race in races]
    said = RULES_TEXT.format(
        shortest=_each(f"{one.timing.shortest * 1e3:.0f}" for one in asked),
        count=_each(str(one.grid.count) for one in asked),
        position=POSITION,
    )
    return [" ".join(paragraph.split()) for paragraph in said.strip().split("\n\n")]


def _each(values: Iterable[str]) -> str:
    return " or ".join(dict.fromkeys(values))


def document(races: Sequence[Race], others: Mapping[str, Sequence[Race]] | None = None) -> Document:
    """Return the report on some races, beside all that was measured by the kind of processor."""
    look = looks(family_of(one) for race in races for one in race.records)
    in_order = sorted(races, key=lambda race: race.started)
    last = in_order[-1]
    top: list[Maker] = [
        ("the ratios", partial(tables.headline, races)),
        ("the goals", partial(tables.goals, races)),
    ]
    if others is not None and len(others) > 1:
        top.insert(1, ("the kinds of processor", partial(tables.kinds, others)))
    return Document(
        "The race: who is how fast at which accuracy",
        [
            "Time at the same energy and position error: of every family the same number of settings for "
            "either kind of step, fixed or its own, declared before the run, all in one process and "
            "interleaved round by round."
        ],
        [
            *map(Note, machine.sentences(race.machine for race in in_order)),
            *attempt(*top),
            *(
                section(race, look, nav)
                for race, nav in zip(races, short([race.title for race in races]), strict=True)
            ),
            Section(
                "The rules",
                [
                    Items(rules(races), "numbered"),
                    *attempt(PEERS),
                    "What machine code runs:",
                    Items([f"{family.title}: {family.code}" for family in FAMILIES.values()]),
                ],
                "rules",
                nav="Rules",
            ),
            Section(
                "Raw data",
                [Files("With all timing samples", [FILE])],
                "data-files",
                nav="Data",
            ),
            again(
                "race",
                commands(in_order),
                ", ".join(sorted({race.started[:10] for race in races})),
                last.machine,
                last.run.versions,
            ),
        ],
        list(look.values()),
    )


def short(titles: Sequence[str]) -> list[str]:
    """Return as much of every title as tells it from the others: what is before its first or second comma."""
    begun = [title.split(",")[0] for title in titles]
    return [
        one if begun.count(one) == 1 else ",".join(title.split(",")[:2])
        for one, title in zip(begun, titles, strict=True)
    ]


def section(race: Race, look: Mapping[str, Look], nav: str) -> Section:
    """Return what the report says about one contest, under a short name for the page's head."""
    title, problem = race.title, race.records[0].case.problem
    shown = (tables.fastest, tables.levels, tables.defaults, tables.compiling)
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
        if all(one.result.outcome == "refused" for one in race.of(family))
    ]
    if absent:
        said.append(f"Does not apply: {', '.join(absent)}.")
    if race.quick:
        said.append("This is the quick run: a tenth of the span and few settings; its ratios mean little.")
    if race.calibration:
        calibration = median(race.calibration)
        worst = max(abs(value / calibration - 1.0) for value in race.calibration)
        said.append(
            f"A fixed computation beside it took {calibration * 1e3:.2f} ms, and in its worst round "
            f"{worst:.0%} more or less."
        )
    return said + outcomes.beside(race.records)


def commands(races: Sequence[Race]) -> str:
    """Return the commands the contests came from; one if together they are all contests, run alike."""
    words = [race.run.command.split(" ") for race in races]
    alike = {
        " ".join(w for i, w in enumerate(ws) if "--problem" not in (w, ws[max(i - 1, 0)])) for ws in words
    }
    if len(alike) == 1 and {race.key for race in races} == {name_of(entry) for entry in declared().entries()}:
        return alike.pop()
    return "\n".join(dict.fromkeys(race.run.command for race in races))
