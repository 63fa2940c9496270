"""Everything a report says, gathered once and printed twice: as markdown and as a page."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from hbvm_bench.campaign.file import Case
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.measure import reading
from hbvm_bench.measure.metrics import METRICS, Metric
from hbvm_bench.report import provenance, words
from hbvm_bench.report.figures.canvas import Picture
from hbvm_bench.report.figures.style import Look, looks, method_name
from hbvm_bench.report.overview import Overview, overview
from hbvm_bench.report.sections import Section, section
from hbvm_bench.store.records import Record
from hbvm_bench.store.store import Store, damage, progress
from hbvm_bench.summaries import fairness, peers
from hbvm_bench.summaries.rows import columns, tasks
from hbvm_bench.summaries.table import Table

# A report of more than these draws only its main figures.
BRIEF_PROBLEMS = 3
BRIEF_CASES = 150
DRAWN_CASES = 300  # of a larger campaign the first so many are drawn: a figure takes seconds


@dataclass(frozen=True)
class Run:
    """One of the runs that a report is made of.

    Attributes
    ----------
    title, command, version
        Of its campaign.
    planned : int
        How many cases it has.
    missing : list of Case
        Those that have no result yet.
    """

    title: str
    command: str
    version: str
    planned: int
    missing: list[Case]


@dataclass(frozen=True)
class Content:
    """A whole report.

    Attributes
    ----------
    title, description : str
        For readers.
    runs : list of Run
        What it is made of.
    measured : str
        The days on which the cases ran.
    overview : Overview
        What they say together.
    sections : list of Section
        Problem by problem; an ensemble has one of its own.
    columns : list of Metric
        Of the table of results.
    looks : dict of Look
        By case id.
    records : list of Record
        All cases.
    rules : tuple of str
        Of a fair comparison.
    settings : list
        See `words.settings_count`.
    peers : Table or None
        What the bench costs every peer; see `hbvm_bench.summaries.peers`.
    excluded : list of str
        What takes no part in the ranking, and why.
    versions, machine : list of (str, str)
        What it ran on.
    metrics : list of Metric
        All, with their descriptions.
    references : list of str
        Where problems come from.
    """

    title: str
    description: str
    runs: list[Run]
    measured: str
    overview: Overview
    sections: list[Section]
    columns: list[Metric]
    looks: dict[str, Look]
    records: list[Record]
    rules: tuple[str, ...]
    settings: list[tuple[str, str, dict[str, int]]]
    peers: Table | None
    excluded: list[str]
    versions: list[tuple[str, str]]
    machine: list[tuple[str, str]]
    metrics: list[Metric]
    references: list[str]

    @property
    def pictures(self) -> list[Picture]:
        """Return all figures, in order."""
        return [*self.overview.pictures, *(p for section in self.sections for p in section.pictures)]


def gather(stores: Sequence[Store]) -> Content:
    """Read the stores of one or more runs and make everything a report says.

    A case that several runs have is taken from the one that got further with it
    (`hbvm_bench.store.store.progress`).

    Raises
    ------
    problems.errors.InputError
        If a directory holds no run.
    """
    indices = [store.index() for store in stores]
    furthest: dict[str, tuple[Record, Store]] = {}
    for store in stores:
        for record in reading.records(store):
            if record.id not in furthest or progress(record) > progress(furthest[record.id][0]):
                furthest[record.id] = (record, store)
    found = {
        key: _read(record, store) if number < DRAWN_CASES else (record, {})
        for number, (key, (record, store)) in enumerate(furthest.items())
    }
    records = [record for record, _ in found.values()]
    look = looks(records)
    tables = tasks(records)
    runs = [
        Run(
            title=index.campaign.title or index.campaign.name,
            command=index.command,
            version=index.version,
            planned=len(index.ids),
            missing=[case for number, case in index.listed() if number not in furthest],
        )
        for index in indices
    ]
    planned = {case.problem for run in runs for case in run.missing}
    printed = {text: repr(make_problem(text)) for text in planned}  # as the records have it
    sections = [
        section(
            text,
            [found[record.id] for record in members],
            look,
            [
                case
                for run in runs
                for case in run.missing
                if (printed[case.problem], case.ensemble) == (text, ensemble)
            ],
            number,
            brief=len(tables) > BRIEF_PROBLEMS or len(records) > BRIEF_CASES,
        )
        for number, ((text, ensemble), members) in enumerate(tables.items(), 1)
    ]
    first = indices[0].campaign
    together = f"{len(runs)} runs together"
    drawn = f"Drawn are the first {DRAWN_CASES} of {len(records)} cases; tables and data have all of them."
    return Content(
        title=runs[0].title if len(runs) == 1 else f"{together}: {'; '.join(run.title for run in runs)}",
        description=" ".join(first.description.split()) if len(runs) == 1 else "",
        runs=runs,
        measured=provenance.days(records),
        overview=overview(records, _first_numbers(records, look)),
        sections=sections,
        columns=columns(records),
        looks=look,
        records=records,
        rules=(
            *([drawn] if len(records) > DRAWN_CASES else []),
            *(*words.RULES, *fairness.sentences(records), *provenance.processors(records)),
        ),
        settings=words.settings_count(records),
        peers=peers.kept(),
        excluded=words.excluded(records),
        versions=provenance.versions(records),
        machine=provenance.machines(records),
        metrics=list(METRICS.values()),
        references=list(dict.fromkeys(ref for s in sections for ref in s.problem.references)),
    )


def _read(record: Record, store: Store) -> tuple[Record, dict[str, NDArray[np.float64]]]:
    """Return a record and its series; where these are damaged, none and a remark."""
    series = store.series(record.id)
    why = damage(record, series, make_problem(record.case.problem).system.dim)
    if not why:
        return record, series
    words = f"its series in the store are damaged ({why}): not drawn"
    note = "; ".join(text for text in (record.case.note, words) if text)
    return replace(record, case=replace(record.case, note=note)), {}


def _first_numbers(records: Sequence[Record], look: dict[str, Look]) -> dict[str, int]:
    numbers: dict[str, int] = {}
    for record in records:
        numbers.setdefault(method_name(record), look[record.id].number)
    return numbers
