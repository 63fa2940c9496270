"""The blocks of every campaign's page: everything that its stores say."""

import re
from collections import Counter
from collections.abc import Sequence
from functools import partial
from weakref import WeakKeyDictionary

from msgspec.structs import replace

from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.reference import solutions
from hbvm_bench.report import provenance, words
from hbvm_bench.report.document import (
    Block,
    CaseTable,
    Commands,
    Details,
    Files,
    Items,
    Notice,
    Section,
    attempt,
)
from hbvm_bench.report.figures.profiles import profiles
from hbvm_bench.report.page import DRAWN_CASES, Results
from hbvm_bench.report.problem import ProblemPart, part
from hbvm_bench.report.stored import PLACE
from hbvm_bench.store.records import Record
from hbvm_bench.store.store import PACKED
from hbvm_bench.summaries import accuracies, compilations, goals, growth, needs, outcomes
from hbvm_bench.summaries.points import family_of
from hbvm_bench.summaries.rows import Task, columns, grouped_by, tasks
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


def _parts(results: Results) -> list[ProblemPart]:
    """Return what is said on each problem; made once for all blocks of a page."""
    if (parts := _parts_of.get(results)) is not None:
        return parts
    missing = [case for run in results.runs for case in results.missing(run)]
    printed = {case.problem: repr(make_problem(case.problem)) for case in missing}  # as the records have it
    tables = tasks(results.records)
    brief = len(tables) > BRIEF_PROBLEMS or len(results.records) > BRIEF_CASES
    _parts_of[results] = [
        part(
            task.problem,
            [(record, results.series[record.id]) for record in members],
            results.look,
            [
                case
                for case in missing
                if Task.from_case(replace(case, problem=printed[case.problem])) == task
            ],
            number,
            sampled=task.sampled(tables),
            brief=brief,
            summarized=len(tables) > PROBLEMS_SUMMARIZED_AT_TOP,
            drawings=results.drawn(f"{PLACE}{number}"),
        )
        for number, (task, members) in enumerate(tables.items(), 1)
    ]
    return _parts_of[results]


_parts_of: WeakKeyDictionary[Results, list[ProblemPart]] = WeakKeyDictionary()


def goals_reached(results: Results) -> Table | None:
    """Return what the campaigns asked for, and what was measured; ``None`` where they asked for nothing."""
    verdicts = [
        verdict for run in results.runs for verdict in goals.verdicts(run.index.campaign, results.records)
    ]
    return goals.table(verdicts) if verdicts else None


def times_at_accuracies(results: Results) -> list[Table]:
    """Return the times at several position errors, of each campaign that has any."""
    tables = (accuracies.table(run.index.campaign, run.records) for run in results.runs)
    return [table for table in tables if table is not None]


def best_compilations(results: Results) -> list[Table]:
    """Return the best of several compilations beside their median, for all libraries alike."""
    tables = (compilations.table(run.index.campaign, run.records) for run in results.runs)
    return [table for table in tables if table is not None]


def conditions(results: Results) -> list[Table]:
    """Return how far doubles determine the positions at the ends, where the references say so."""
    rows = []
    for item in _parts(results):
        known = solutions.find(item.problem)
        if known is not None and (number := known.condition_at(item.problem.t_end)) is not None:
            least = number * solutions.UNIT_ROUNDOFF
            rows.append((item.ranked.problem, f"{item.problem.t_end:g}", f"{number:.1e}", f"{least:.1e}"))
    note = (
        "The condition number is the largest relative change of a position at the end over a relative "
        "change of the state at the worst time before, to within a factor of about 2. The last column is "
        "this number times 1.1e-16: the relative change of that position when one state on the way is "
        "rounded."
    )
    head = ("problem", "end", "condition number", "rounded once")
    return (
        [Table("Positions that double precision can determine", head, rows, note, words=(0,))] if rows else []
    )


def overview_of_many(results: Results) -> list[Block]:
    """Return what the cases say together, before all else, where there are several problems."""
    return _overall(results, several=True) if len(_parts(results)) > 1 else []


def overview_of_one(results: Results) -> list[Block]:
    """Return the same after the rows where there is one problem."""
    return _overall(results, several=False) if len(_parts(results)) == 1 else []


def problems_in_turn(results: Results) -> list[Section]:
    """Return the section of each problem."""
    return [item.section for item in _parts(results)]


def raw_data(results: Results) -> Section:
    """Return where the rows lie."""
    del results
    return Section("Raw data", [Files(ALL, [PACKED])], "data-files", nav="Data")


def sources(results: Results) -> Section:
    """Return what the problems are from, and how to cite the methods."""
    references = [text for item in _parts(results) for text in item.problem.references]
    return Section("Sources", [Items([*dict.fromkeys(references), CITE])], "sources")


def _overall(results: Results, *, several: bool) -> list[Block]:
    records = results.records
    title = "Over all problems" if several else "Which integrator to take"
    blocks = attempt(
        ("which integrator for which need", partial(needs.table, records)),
        ("which integrator on which problem", partial(_outcomes, records)),
        ("the growth of the energy error", partial(growth.table, records)),
        ("performance profiles", partial(profiles, records)),
    )
    return [Section(title, blocks, "overview", nav="Over all problems" * several)] if blocks else []


def _outcomes(records: Sequence[Record]) -> list[Block]:
    """Return which integrator reached the end of which problem, and why not; nothing for one problem."""
    table, reasons = outcomes.table(records) or (None, [])
    folded = Details(f"Why not: {len(reasons)} reasons", [Items(reasons)])
    return [*([table] if table else []), *([folded] if reasons else [])]


def what_came_out(results: Results) -> Section:
    """Return the sentences where there are few, and every case as a row."""
    parts, records = _parts(results), results.records
    blocks: list[Block] = [
        Notice(
            f"{len(missing)} of {len(run.index.ids)} cases have no result yet",
            f"({run.index.campaign.title or run.index.campaign.name}). To run them: `{run.command}`",
        )
        for run in results.runs
        if (missing := results.missing(run))
    ]
    if len(parts) == 1:
        blocks += parts[0].summary
    elif len(parts) <= PROBLEMS_SUMMARIZED_AT_TOP:
        blocks += [
            Section(item.ranked.title, item.summary, f"summary-{i}", code=item.ranked.problem)
            for i, item in enumerate(parts, 1)
        ]
    else:
        titles = [title for item in parts for title, rows in item.ranked.groups for _ in rows]
        counts = Counter(re.split("[,:]", title)[0].lower() for title in titles)
        said = ", ".join(f"{outcome}: {count}" for outcome, count in counts.items())
        blocks.append(f"{len(records)} cases on {len(parts)} problems; {said}.")
    shown = columns(records)
    said = [(item.short, item.unit or "–", f"{item.label}. {item.description}") for item in shown]
    meaning = Table("", ("column", "unit", "meaning"), said, words=(0, 1, 2))
    blocks += [
        CaseTable(shown, [item.ranked for item in parts], results.look),
        Details("What the columns mean", [meaning]),
    ]
    return Section("Results", blocks, "results", nav="Results")


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
        *(*outcomes.sentences(records), *provenance.processors(records)),
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


def run_again(results: Results) -> Section:
    """Return the commands, and what was measured with what."""
    runs, records = results.runs, results.records
    days = provenance.days(records)
    return Section(
        "Run it again",
        [
            Commands("\n".join(run.index.command for run in runs)),
            f"Measured{f' on {days}' if days else ''} with hbvm-bench {runs[0].index.version}. "
            "`hbvm-bench show DIRECTORY --json` prints every number with all timing samples; "
            "`hbvm-bench report DIRECTORY` draws this report again without running anything.",
            *provenance.facts(provenance.machines(records), provenance.versions(records)),
        ],
        "again",
        nav="Run it again",
    )
