"""The blocks of pages: each is a function of results, and of the options that a page gives it."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from msgspec.structs import replace

from hbvm_bench.campaign.identity import make_problem, printed
from hbvm_bench.measure.measured import POSITION
from hbvm_bench.reference import solutions
from hbvm_bench.report import provenance, words
from hbvm_bench.report.document import (
    Block,
    CaseTable,
    Commands,
    Details,
    Files,
    Items,
    Links,
    Note,
    Notice,
    Section,
    attempt,
)
from hbvm_bench.report.figures import over_time
from hbvm_bench.report.figures import work_precision as figure_of_work
from hbvm_bench.report.figures.canvas import Picture
from hbvm_bench.report.figures.ratios import ratios as bars
from hbvm_bench.report.page import DRAWN_CASES, Results
from hbvm_bench.report.problem import ranked, section, summary
from hbvm_bench.store.records import Record
from hbvm_bench.store.store import PACKED
from hbvm_bench.summaries import cost_ratio as comparing
from hbvm_bench.summaries import fastest as choosing
from hbvm_bench.summaries import goals, needs, outcomes
from hbvm_bench.summaries import growth as growing
from hbvm_bench.summaries import longer as extrapolating
from hbvm_bench.summaries.points import family_of
from hbvm_bench.summaries.rows import Task, columns, grouped_by, numbers, tasks
from hbvm_bench.summaries.table import Table

# A report of more than these draws only its main figures.
BRIEF_PROBLEMS = 3
BRIEF_CASES = 150

PROBLEMS_SUMMARIZED_AT_TOP = 3  # problems whose summaries all stand at the top
LISTED = 12  # cases without a rank that are listed at once; more are folded away
ALL = (
    "Every case with every metric, every reason and every timing sample, as a compressed SQLite file; "
    "`hbvm-bench export` makes tables of it"
)
CITE = "`hbvm-bench cite` prints how the authors of the methods ask to be cited."
KINDS = ("chosen", "default", "recommended", "as published", "outside its domain")
EQUAL_ERRORS = "Time of each library's fastest setting relative to the fastest of HBVM and Gauss"


def cost_ratio(
    results: Results,
    *,
    at: str = "",
    level: str = "",
    title: str = "",
    no_worse: Sequence[str] = (),
) -> Table | None:
    """Return the time of each family relative to HBVM and Gauss; see `hbvm_bench.summaries.cost_ratio`.

    At one ``level`` of the errors, as the table writes it, or at all.
    """
    found = comparing.ratios(results.frame, at, no_worse=no_worse)
    found = found[found.level == level] if level else found
    head = "" if no_worse else f"{at or 'energy, position'} ≤"
    title = title or EQUAL_ERRORS + (f", by {at}" if at else "")
    return comparing.table(found, title, head)


def ratios_drawn(results: Results, *, key: str, level: str = "", **options: Any) -> Picture | None:
    """Draw the strongest other family on each problem, at one level of errors.

    The other options are those of `hbvm_bench.summaries.cost_ratio.ratios`.
    """
    return bars(comparing.ratios(results.frame, **options), key, level)


def fastest(results: Results, *, within: Mapping[str, float] | None = None) -> Table | None:
    """Return the fastest setting of each family at these errors, or at those that the problems ask for."""
    return choosing.fastest(results.frame, within)


def longer(results: Results, *, end: float, unit: str) -> Table | None:
    """Return what an interval of so many units of time would take, extrapolated from the longest one."""
    return extrapolating.longer(results.frame, end, unit)


def growth(results: Results) -> Table | None:
    """Return the growth of the energy error: of each case of one problem, else counted by family."""
    if results.frame.place.nunique() > 1:
        return growing.by_family(results.records)
    return growing.by_case(results.frame, results.series)


def growth_drawn(results: Results, *, key: str = "growth") -> Picture | None:
    """Draw the growth of the energy error of the cases of one problem."""
    return over_time.growth(
        [over_time.Drawn(record, results.series[record.id]) for record in results.records], key
    )


def work_precision(results: Results, *, problem: str, key: str = "", end: str = "") -> Picture | None:
    """Draw the errors against time on one problem, whose title begins so, on the processor measured last."""
    here = results.frame[results.frame.title.str.startswith(problem)]
    here = here[here.processor == here.processor.iloc[-1]]
    return figure_of_work.work_precision(
        here, key or "work-precision-" + re.sub(r"\W+", "-", problem.lower()), end
    )


def missing_cases(results: Results) -> list[Notice]:
    """Return how many cases of each run have no result yet."""
    return [
        Notice(
            f"{len(missing)} of {len(run.index.ids)} cases have no result yet",
            f"({run.index.campaign.title or run.index.campaign.name}). To run them: `{run.index.command}`",
        )
        for run in results.runs
        if (missing := results.missing(run))
    ]


def goals_reached(results: Results) -> Table | None:
    """Return what the campaigns asked for, and what was measured; ``None`` where they asked for nothing."""
    verdicts = []
    for run in results.runs:
        records = results.records if len(results.runs) == 1 else run.records
        verdicts += goals.verdicts(run.index.campaign, records)
    return goals.table(verdicts) if verdicts else None


def conditions(results: Results) -> Table | None:
    """Return how far doubles determine the positions at the ends, where the references say so."""
    rows = []
    for task in tasks(results.records):
        problem = make_problem(task.problem, results.known)
        found = solutions.find(problem, results.known.references)
        if found is not None and (number := found.condition_at(problem.t_end)) is not None:
            least = number * solutions.UNIT_ROUNDOFF
            rows.append((task.problem, f"{problem.t_end:g}", f"{number:.1e}", f"{least:.1e}"))
    note = (
        "The condition number is the largest relative change of a position at the end over a relative "
        "change of the state at the worst time before, to within a factor of about 2. The last column is "
        "this number times 1.1e-16: the error at the end that rounding one state on the way makes."
    )
    head = ("problem", "end", "condition number", "error from one rounding")
    return Table("Positions that double precision can determine", head, rows, note) if rows else None


def overview(results: Results) -> list[Block]:
    """Return what the cases say together: which integrator for which need, and on which problem."""
    records = results.records
    several = len(tasks(records)) > 1
    made = attempt(
        ("which integrator for which need", partial(needs.table, records)),
        ("which integrator on which problem", partial(_outcomes, records)),
    )
    title = "Over all problems" if several else "Which integrator to take"
    return [Section(title, made, "overview", nav=title)] if made else []


def needed(results: Results) -> Table | None:
    """Return which integrator serves which need best."""
    return needs.table(results.records)


def outcome_of_each(results: Results) -> list[Block]:
    """Return which integrator reached the end of which problem, and why not; nothing for one problem."""
    return _outcomes(results.records)


def _outcomes(records: Sequence[Record]) -> list[Block]:
    table, reasons = outcomes.table(records) or (None, [])
    folded = Details(f"Why not: {len(reasons)} reasons", [Items(reasons)])
    return [*([table] if table else []), *([folded] if reasons else [])]


def what_came_out(results: Results) -> Section:
    """Return the sentences where there are few, and every case as a row."""
    tables, records = tasks(results.records), results.records
    blocks: list[Block] = []
    if len(tables) == 1:
        ((task, members),) = tables.items()
        blocks += _summary(task, members)
    elif len(tables) <= PROBLEMS_SUMMARIZED_AT_TOP:
        blocks += [
            Section(
                ranked(task, members, results.known, tables).title,
                _summary(task, members),
                f"summary-{i}",
                code=task.problem,
            )
            for i, (task, members) in enumerate(tables.items(), 1)
        ]
    else:
        titles = [
            title
            for task, members in tables.items()
            for title, rows in ranked(task, members, results.known, tables).groups
            for _ in rows
        ]
        counts = Counter(re.split("[,:]", title)[0].lower() for title in titles)
        said = ", ".join(f"{outcome}: {count}" for outcome, count in counts.items())
        blocks.append(f"{len(records)} cases on {len(tables)} problems; {said}.")
    return Section("Results", [*blocks, *all_cases(results)], "results", nav="Results")


def all_cases(results: Results) -> list[Block]:
    """Return every case as a row, and what the columns mean."""
    tables, shown = tasks(results.records), columns(results.records)
    said = [(item.short, item.unit or "–", f"{item.label}. {item.description}") for item in shown]
    meaning = Table("", ("column", "unit", "meaning"), said, words=(0, 1, 2))
    problems = [ranked(task, members, results.known, tables) for task, members in tables.items()]
    return [
        CaseTable(shown, problems, results.look, numbers(results.records)),
        Details("What the columns mean", [meaning]),
    ]


def _summary(task: Task, records: Sequence[Record]) -> list[Block]:
    return attempt((f"the summary of {task.problem}", partial(summary, task, records)))


def problems_in_turn(results: Results) -> list[Section]:
    """Return the section of each problem, with its figures."""
    missing = grouped_by(
        lambda case: Task.from_case(replace(case, problem=printed(case.problem))),
        (case for run in results.runs for case in results.missing(run)),
    )
    tables = tasks(results.records)
    return [
        section(
            results,
            ranked(task, members, results.known, tables),
            task,
            missing.get(task, []),
            number,
            brief=len(tables) > BRIEF_PROBLEMS or len(results.records) > BRIEF_CASES,
            summary=_summary(task, members) if len(tables) > PROBLEMS_SUMMARIZED_AT_TOP else [],
        )
        for number, (task, members) in enumerate(tables.items(), 1)
    ]


def raw_data(results: Results) -> Section:
    """Return where the rows lie."""
    return Section("Raw data", [Files(ALL, [results.place + PACKED])], "data-files", nav="Data")


def every_row(results: Results) -> list[Block]:
    """Return how results were made, their file, and the page that has every row of them."""
    (run, *_), records = results.runs, [record for run in results.runs for record in run.records]
    campaign = run.index.campaign
    libraries = ", ".join(f"{name} {number}" for name, number in provenance.versions(records).items())
    commands = " and ".join(dict.fromkeys(f"`{run.index.command}`" for run in results.runs))
    return [
        Files(
            f"{campaign.title}: {commands}, measured on {provenance.days(records)} with {libraries}",
            [results.place + PACKED],
        ),
        Links([(f"Every row of {campaign.name}", "", f"{results.place}index.html")]),
    ]


def sources(results: Results) -> Section:
    """Return what the problems are from, and how to cite the methods."""
    made = [make_problem(task.problem, results.known) for task in tasks(results.records)]
    references = [text for problem in made for text in problem.references]
    return Section("Sources", [Items([*dict.fromkeys(references), CITE])], "sources")


def fairness(results: Results) -> Section:
    """Return the rules, the settings of each method, and what was excluded."""
    runs, records = results.runs, results.records
    drawn = f"Drawn are the first {DRAWN_CASES} of {len(records)} cases; tables and data have all of them."
    campaigns = [run.index.campaign for run in runs]
    ends = any(entry.end is not None for campaign in campaigns for entry in campaign.entries())
    timing = dict.fromkeys(words.timing(chosen.timing) for chosen in campaigns if chosen.timing.rounds)
    rules = (
        *([drawn] if len(records) > DRAWN_CASES else []),
        *(*words.RULES, *([words.ENDS] if ends else []), *timing),
        *outcomes.sentences(records),
    )
    rows = []
    for family, members in grouped_by(lambda record: (family_of(record), record.library), records).items():
        kinds = Counter(record.case.settings for record in members)
        rows.append((*family, str(len(members)), *(str(kinds[kind]) for kind in KINDS)))
    head = ("method", "library", "settings", *KINDS)
    settings = Table("The number of settings of each method", head, rows, words=(0, 1))
    blocks = [Items(rules, "numbered"), settings]
    if excluded := words.excluded(records):
        title = f"{len(excluded)} cases excluded from every ranking, with reasons"
        blocks.append(Details(title, [Items(excluded)], open=len(excluded) <= LISTED))
    title = "Fairness: the rules, the settings, what was excluded"
    return Section(title, blocks, "fairness", nav="Fairness")


def measured_on(results: Results) -> Note:
    """Return on what processors the times were taken, and what scatters them."""
    records = [record for run in results.runs for record in run.records]
    return Note(
        " ".join(
            [*provenance.processors(records), *outcomes.compilations(records), *outcomes.beside(records)]
        )
    )


def position_error(results: Results) -> Note:
    """Return what a position error is."""
    del results
    return Note(POSITION)


def run_again(results: Results) -> Section:
    """Return the commands, and what was measured with what."""
    runs, records = results.runs, [record for run in results.runs for record in run.records]
    days = provenance.days(records)
    return Section(
        "Run it again",
        [
            Commands("\n".join(dict.fromkeys(run.index.command for run in runs))),
            f"Measured{f' on {days}' if days else ''} with hbvm-bench {runs[0].index.version}. "
            "`hbvm-bench show DIRECTORY --json` prints every number with all timing samples; "
            "`hbvm-bench report DIRECTORY` draws this report again without running anything.",
            measured_on(results),
            *provenance.facts(records),
        ],
        "again",
        nav="Run it again",
    )
