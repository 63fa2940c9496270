"""The report of a campaign: everything that its stores say, as one document."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from hbvm_bench.campaign.file import Case
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.measure import reading
from hbvm_bench.measure.metrics import METRICS
from hbvm_bench.report import provenance, words
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
from hbvm_bench.report.figures.style import looks
from hbvm_bench.report.problem import ProblemPart, part
from hbvm_bench.store.files import json_of
from hbvm_bench.store.records import Record
from hbvm_bench.store.store import Index, Store, again, damage, progress
from hbvm_bench.summaries import export, fairness, goals, laws, needs, outcomes
from hbvm_bench.summaries.points import family_of
from hbvm_bench.summaries.rows import columns, tasks
from hbvm_bench.summaries.table import Table
from problems.errors import InputError

Series = dict[str, NDArray[np.float64]]

# A report of more than these draws only its main figures.
BRIEF_PROBLEMS = 3
BRIEF_CASES = 150
DRAWN_CASES = 300  # of a larger campaign the first so many are drawn: a figure takes seconds

FEW = 3  # problems whose summaries all stand at the top
LISTED = 12  # cases without a rank that are listed at once; more are folded away
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


@dataclass(frozen=True)
class Gathered:
    """What the stores of one or more runs hold: the runs, and every case with its series."""

    runs: list[Run]
    found: list[tuple[Record, Series]]

    @property
    def records(self) -> list[Record]:
        """All cases."""
        return [record for record, _ in self.found]


def gather(stores: Sequence[Store]) -> Gathered:
    """Read the stores of one or more runs.

    A case that several runs have is taken from the one that got further with it
    (`hbvm_bench.store.store.progress`).

    Raises
    ------
    problems.errors.InputError
        If a directory holds no run, or no run has a finished case.
    """
    indices = [store.index() for store in stores]
    furthest: dict[str, tuple[Record, Store]] = {}
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
    found = [
        _read(record, store) if number < DRAWN_CASES else (record, {})
        for number, (record, store) in enumerate(furthest.values())
    ]
    return Gathered(runs, found)


def document(stores: Store | Sequence[Store]) -> Document:
    """Return the report on one or more runs.

    Raises
    ------
    problems.errors.InputError
        See `gather`.
    """
    stores = [stores] if isinstance(stores, Store) else stores
    gathered = gather(stores)
    runs, records = gathered.runs, gathered.records
    series = {record.id: (record, series) for record, series in gathered.found}
    look = looks(record.case.method for record in records)
    missing = [case for run in runs for case in run.missing]
    printed = {case.problem: repr(make_problem(case.problem)) for case in missing}  # as the records have it
    tables = tasks(records)
    brief = len(tables) > BRIEF_PROBLEMS or len(records) > BRIEF_CASES
    parts = [
        part(
            text,
            [series[record.id] for record in members],
            look,
            [case for case in missing if (printed[case.problem], case.ensemble) == (text, ensemble)],
            number,
            brief=brief,
            summarized=len(tables) > FEW,
        )
        for number, ((text, ensemble), members) in enumerate(tables.items(), 1)
    ]
    one = len(runs) == 1
    title = runs[0].title if one else f"{len(runs)} runs together: {'; '.join(run.title for run in runs)}"
    overall = _overall(records, several=len(parts) > 1)
    return Document(
        title,
        [runs[0].index.campaign.description] if one else [],
        [
            *attempt(("the goals", partial(_goals, stores, records))),
            *(overall if len(parts) > 1 else []),
            _results(parts, runs, records),
            *(overall if len(parts) == 1 else []),
            *(one.section for one in parts),
            _fairness(runs, records),
            Section(
                "Raw data",
                attempt(("the results as files", partial(_files, title, runs, records))),
                "data-files",
                nav="Data",
            ),
            _again(runs, records),
            Section("Sources", [Items(_sources(parts))], "sources"),
        ],
        list(look.values()),
        name="report.md",
    )


def _goals(stores: Sequence[Store], records: Sequence[Record]) -> Table | None:
    """Return what the campaigns asked for, and what was measured; ``None`` where they asked for nothing."""
    found = [one for store in stores for one in goals.verdicts(store.index().campaign, records)]
    return goals.table(found) if found else None


def _read(record: Record, store: Store) -> tuple[Record, Series]:
    """Return a record and its series; where these are damaged, none and a remark."""
    series = store.series(record.id)
    why = damage(record, series, make_problem(record.case.problem).system.dim)
    if not why:
        return record, series
    said = f"its series in the store are damaged ({why}): not drawn"
    note = "; ".join(text for text in (record.case.note, said) if text)
    return replace(record, case=replace(record.case, note=note)), {}


def _overall(records: Sequence[Record], *, several: bool) -> list[Block]:
    """Return what the cases say together."""
    title = "Over all problems" if several else "Which integrator to take"
    look = looks(record.case.method for record in records)
    numbers: dict[str, int] = {}
    for record in records:
        numbers.setdefault(family_of(record), look[record.case.method].number)
    made = attempt(
        ("which integrator for which need", partial(needs.table, records)),
        ("which integrator on which problem", partial(_outcomes, records)),
        ("the law of the energy's drift", partial(laws.table, records)),
        ("performance profiles", partial(profiles, records, numbers)),
    )
    return [Section(title, made, "overview", nav="Over all problems" * several)] if made else []


def _outcomes(records: Sequence[Record]) -> list[Block]:
    """Return which integrator reached the end of which problem, and why not; nothing for one problem."""
    if (found := outcomes.table(records)) is None:
        return []
    table, reasons = found
    return [table, *([Details(f"Why not: {len(reasons)} reasons", [Items(reasons)])] if reasons else [])]


def _results(parts: Sequence[ProblemPart], runs: Sequence[Run], records: Sequence[Record]) -> Section:
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
        counts: Counter[str] = Counter()
        for one in parts:
            for title, rows in one.ranked.groups:
                counts[title.split(",")[0].split(":")[0].lower()] += len(rows)
        said = ", ".join(f"{what}: {count}" for what, count in counts.items())
        blocks.append(f"{len(records)} cases on {len(parts)} problems; {said}.")
    shown = columns(records)
    meaning = Table(
        "",
        ("column", "unit", "meaning"),
        [
            (metric.short, metric.unit or "–", f"{metric.label}. {metric.description}")
            for metric in METRICS.values()
        ],
        words=(0, 1, 2),
    )
    look = looks(record.case.method for record in records)
    blocks += [
        Results(shown, [one.ranked for one in parts], look),
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
        *(
            *words.RULES,
            *([words.ENDS] if ends else []),
            *timing,
            *fairness.sentences(records),
            *provenance.processors(records),
        ),
    )
    settings = Table(
        "How many settings each method has",
        ("method", "library", "settings", *KINDS),
        [
            (name, library, str(kinds.total()), *(str(kinds[kind]) for kind in KINDS))
            for name, library, kinds in words.settings_count(records)
        ],
        words=(0, 1),
    )
    excluded = words.excluded(records)
    left_out = Details(
        f"{len(excluded)} cases that take part in no ranking, and why",
        [Items(excluded)],
        open=len(excluded) <= LISTED,
    )
    return Section(
        "Fairness: the rules, the settings, what was excluded",
        [Items(rules, "numbered"), settings, *attempt(provenance.PEERS), *([left_out] if excluded else [])],
        "fairness",
        nav="Fairness",
    )


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


def _sources(parts: Sequence[ProblemPart]) -> list[str]:
    references = dict.fromkeys(text for one in parts for text in one.problem.references)
    return [*references, "`hbvm-bench cite` prints how the authors of the methods ask to be cited."]


def _files(title: str, runs: Sequence[Run], records: Sequence[Record]) -> Files:
    commands = [{"command": run.index.command, "version": run.index.version} for run in runs]
    made_by = {"title": title, "runs": commands}
    return Files(
        "Every case with every metric, every reason and every timing sample",
        {
            "data/results.csv": export.cases_csv(records),
            "data/results.json": json_of(made_by | export.as_json(records)),
        },
    )
