"""The report of a campaign: everything that its stores say, as one document."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from hbvm_bench.campaign.file import Case
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.measure import reading
from hbvm_bench.measure.metrics import METRICS
from hbvm_bench.report import provenance, words
from hbvm_bench.report.archived import PLACE, pictures
from hbvm_bench.report.document import (
    Block,
    Commands,
    Details,
    Document,
    Files,
    Items,
    Notice,
    Results,
    Section,
    attempt,
)
from hbvm_bench.report.figures.profiles import profiles
from hbvm_bench.report.figures.style import Look, looks
from hbvm_bench.report.problem import ProblemPart, part
from hbvm_bench.store import archive
from hbvm_bench.store.archive import Archive, Drawing
from hbvm_bench.store.records import Record
from hbvm_bench.store.store import Index, Store, again, damage, progress
from hbvm_bench.summaries import goals, laws, needs, outcomes
from hbvm_bench.summaries.points import by_family, family_of
from hbvm_bench.summaries.rows import Task, by, columns, tasks
from hbvm_bench.summaries.table import Table
from problems.errors import InputError

Series = dict[str, NDArray[np.float64]]
Looks = dict[str, Look]

# A report of more than these draws only its main figures.
BRIEF_PROBLEMS = 3
BRIEF_CASES = 150
DRAWN_CASES = 300  # of a larger campaign the first so many are drawn: a figure takes seconds

FEW = 3  # problems whose summaries all stand at the top
LISTED = 12  # cases without a rank that are listed at once; more are folded away
ALL = (
    "Every case with every metric, every reason and every timing sample, as compressed JSON; "
    "`hbvm-bench export` makes tables of it"
)
CITE = "`hbvm-bench cite` prints how the authors of the methods ask to be cited."
KINDS = ("chosen", "default", "recommended", "as published", "outside its domain")


@dataclass(frozen=True)
class Run:
    """One of the runs that a report is made of: what was asked for, and the cases that have no result yet."""

    index: Index
    missing: list[Case]

    @property
    def title(self) -> str:
        """For readers."""
        return self.index.campaign.title or self.index.campaign.name


class Gathered(NamedTuple):
    """What the stores of one or more runs hold."""

    runs: list[Run]
    records: list[Record]  # of all cases
    series: dict[str, Series]  # of each, by its id; empty where an archive has drawings instead
    drawings: Sequence[Drawing]


def gather(stores: Sequence[Store] | Sequence[Archive]) -> Gathered:
    """Read the stores of one or more runs, or the runs of an archive.

    A case that several runs have is taken from the one that got further with it
    (`hbvm_bench.store.store.progress`).

    Raises
    ------
    problems.errors.InputError
        If a directory holds no run, or no run has a finished case.
    """
    indices = [store.index() for store in stores]
    furthest: dict[str, tuple[Record, Store | Archive]] = {}
    for store in stores:
        for record in reading.records(store):
            if record.id not in furthest or progress(record) > progress(furthest[record.id][0]):
                furthest[record.id] = (record, store)
    if not furthest:
        raise InputError(
            f"none of the {sum(len(index.ids) for index in indices)} cases of the run in "
            f"{str(stores[0].directory)!r} has finished; {again(indices[0], stores[0].directory)}."
        )
    runs = [
        Run(index, [case for number, case in index.listed() if number not in furthest]) for index in indices
    ]
    made = Gathered(runs, [], {}, _drawings(stores))
    last = None
    for number, (key, (record, store)) in enumerate(furthest.items()):
        if store is not last:
            store.learn()  # of two runs each may have a reference of its own
            last = store
        found, made.series[key] = record, {}
        if number < DRAWN_CASES and isinstance(store, Store):
            found, made.series[key] = _read(record, store)
        made.records.append(found)
    return made


def _drawings(stores: Sequence[Store] | Sequence[Archive]) -> Sequence[Drawing]:
    """Return the figures that an archive has in the place of series; its runs have them in common."""
    return stores[0].drawings if isinstance(stores[0], Archive) else ()


def document(stores: Store | Sequence[Store] | Sequence[Archive]) -> Document:
    """Return the report on one or more runs; raises what `gather` does."""
    stores = [stores] if isinstance(stores, Store) else stores
    runs, records, series, drawings = gather(stores)
    look = looks(record.case.method for record in records)
    missing = [case for run in runs for case in run.missing]
    printed = {case.problem: repr(make_problem(case.problem)) for case in missing}  # as the records have it
    tables = tasks(records)
    brief = len(tables) > BRIEF_PROBLEMS or len(records) > BRIEF_CASES
    parts = [
        part(
            task.problem,
            [(record, series[record.id]) for record in members],
            look,
            [case for case in missing if Task.of(replace(case, problem=printed[case.problem])) == task],
            number,
            sampled=task.sampled(tables),
            brief=brief,
            summarized=len(tables) > FEW,
            drawings=pictures(drawings, f"{PLACE}{number}"),
        )
        for number, (task, members) in enumerate(tables.items(), 1)
    ]
    one = len(runs) == 1
    title = runs[0].title if one else f"{len(runs)} runs together: {'; '.join(run.title for run in runs)}"
    overall = _overall(records, look, several=len(parts) > 1)
    references = [text for one in parts for text in one.problem.references]
    return Document(
        title,
        [runs[0].index.campaign.description] if one else [],
        [
            *attempt(("the goals", partial(_goals, runs, records))),
            *(overall if len(parts) > 1 else []),
            _results(parts, runs, records, look),
            *(overall if len(parts) == 1 else []),
            *(one.section for one in parts),
            _fairness(runs, records),
            Section("Raw data", [Files(ALL, [archive.NAME])], "data-files", nav="Data"),
            _again(runs, records),
            Section("Sources", [Items([*dict.fromkeys(references), CITE])], "sources"),
        ],
        list(look.values()),
        name="report.md",
    )


def _goals(runs: Sequence[Run], records: Sequence[Record]) -> Table | None:
    """Return what the campaigns asked for, and what was measured; ``None`` where they asked for nothing."""
    found = [one for run in runs for one in goals.verdicts(run.index.campaign, records)]
    return goals.table(found) if found else None


def _read(record: Record, store: Store) -> tuple[Record, Series]:
    """Return a record and its series; where these are damaged, none and a remark."""
    series = store.series(record.id)
    why = damage(record, series, make_problem(record.case.problem).system.dim)
    if not why:
        return record, reading.drawn(record, series)
    said = f"its series in the store are damaged ({why}): not drawn"
    note = "; ".join(text for text in (record.case.note, said) if text)
    return replace(record, case=replace(record.case, note=note)), {}


def _overall(records: Sequence[Record], look: Looks, *, several: bool) -> list[Block]:
    """Return what the cases say together."""
    title = "Over all problems" if several else "Which integrator to take"
    numbers = {name: look[each[0].case.method].number for name, each in by_family(records).items()}
    made = attempt(
        ("which integrator for which need", partial(needs.table, records)),
        ("which integrator on which problem", partial(_outcomes, records)),
        ("the law of the energy's drift", partial(laws.table, records)),
        ("performance profiles", partial(profiles, records, numbers)),
    )
    return [Section(title, made, "overview", nav="Over all problems" * several)] if made else []


def _outcomes(records: Sequence[Record]) -> list[Block]:
    """Return which integrator reached the end of which problem, and why not; nothing for one problem."""
    table, reasons = outcomes.table(records) or (None, [])
    folded = Details(f"Why not: {len(reasons)} reasons", [Items(reasons)])
    return [*([table] if table else []), *([folded] if reasons else [])]


def _results(
    parts: Sequence[ProblemPart], runs: Sequence[Run], records: Sequence[Record], look: Looks
) -> Section:
    """Return what came out: the sentences where there are few, and every case as a row."""
    blocks: list[Block] = [
        Notice(
            f"{len(run.missing)} of {len(run.index.ids)} cases have no result yet",
            f"({run.title}). To run them: `{run.index.command}`",
        )
        for run in runs
        if run.missing
    ]
    if len(parts) == 1:
        blocks += parts[0].summary
    elif len(parts) <= FEW:
        blocks += [
            Section(one.ranked.title, one.summary, f"summary-{i}", code=one.ranked.problem)
            for i, one in enumerate(parts, 1)
        ]
    else:
        titles = [title for one in parts for title, rows in one.ranked.groups for _ in rows]
        counts = Counter(re.split("[,:]", title)[0].lower() for title in titles)
        said = ", ".join(f"{what}: {count}" for what, count in counts.items())
        blocks.append(f"{len(records)} cases on {len(parts)} problems; {said}.")
    said = [(one.short, one.unit or "–", f"{one.label}. {one.description}") for one in METRICS.values()]
    meaning = Table("", ("column", "unit", "meaning"), said, words=(0, 1, 2))
    blocks += [
        Results(columns(records), [one.ranked for one in parts], look),
        Details("What the columns mean", [meaning]),
    ]
    return Section("What came out", blocks, "results", nav="Results")


def _fairness(runs: Sequence[Run], records: Sequence[Record]) -> Section:
    """Return the rules, the settings of each method, and what was excluded."""
    drawn = f"Drawn are the first {DRAWN_CASES} of {len(records)} cases; tables and data have all of them."
    campaigns = [run.index.campaign for run in runs]
    ends = any(entry.end is not None for campaign in campaigns for entry in campaign.entries())
    timing = dict.fromkeys(words.timing(one.timing) for one in campaigns if one.timing.rounds)
    rules = (
        *([drawn] if len(records) > DRAWN_CASES else []),
        *(*words.RULES, *([words.ENDS] if ends else []), *timing),
        *(*outcomes.sentences(records), *provenance.processors(records)),
    )
    rows = []
    for of, members in by(lambda record: (family_of(record), record.library), records).items():
        kinds = Counter(record.case.settings for record in members)
        rows.append((*of, str(len(members)), *(str(kinds[kind]) for kind in KINDS)))
    head = ("method", "library", "settings", *KINDS)
    settings = Table("How many settings each method has", head, rows, words=(0, 1))
    blocks = [Items(rules, "numbered"), settings, *attempt(provenance.PEERS)]
    if excluded := words.excluded(records):
        title = f"{len(excluded)} cases that take part in no ranking, and why"
        blocks.append(Details(title, [Items(excluded)], open=len(excluded) <= LISTED))
    title = "Fairness: the rules, the settings, what was excluded"
    return Section(title, blocks, "fairness", nav="Fairness")


def _again(runs: Sequence[Run], records: Sequence[Record]) -> Section:
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
