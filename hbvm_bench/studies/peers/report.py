"""What the bench costs each peer beside its library alone, from the results of the campaign `peers`."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from hbvm_bench.measure import machine
from hbvm_bench.measure.timing import Spread
from hbvm_bench.report.document import Block, Items, Note, Section
from hbvm_bench.report.page import Results
from hbvm_bench.store.records import Record
from hbvm_bench.store.stored_run import StoredRun
from hbvm_bench.summaries import outcomes
from hbvm_bench.summaries.compilations import SPREAD, spread
from hbvm_bench.summaries.rows import Task, at_once, reason_of, tasks
from hbvm_bench.summaries.rows import seconds as in_words
from hbvm_bench.summaries.standings import compare
from hbvm_bench.summaries.table import NONE, Table

ALONE = "peers.alone:"

ALLOWED = 1.05
"""Largest median of the ratio bench over library."""

OVERHEAD = 2e-5
"""Seconds a call may take longer whatever its ratio, which is then that of a very short run."""

DIFFERENCE = 1e-6
"""Most difference of the end states. Measured: 1e-8 for REBOUND, which adds a fixed step to its clock 300,000
times where the adapter sets it to t0 + n h; 2e-7 for diffrax's LeapfrogMidpoint, whose rounding grows
over 1,500,000 steps; 0 where steps vary."""

A_STEP = 1
"""Most difference of the counts of steps: the run that is timed may shorten its last step."""


@dataclass(frozen=True)
class Pair:
    """One method through the bench and alone."""

    task: Task
    bench: Record
    alone: Record
    difference: float | None  # largest difference of the states at the end, over the largest component

    @property
    def ratio(self) -> Spread | None:
        """Bench over library within each round."""
        return compare(self.alone, self.bench).ratio

    @property
    def steps(self) -> tuple[int | None, int | None]:
        """How many steps each took."""
        return self.bench.result.counters.steps, self.alone.result.counters.steps

    @property
    def failed(self) -> str:
        """Why there is nothing to compare; empty where there is."""
        return next((reason for record in (self.bench, self.alone) if (reason := reason_of(record))), "")

    @property
    def beyond(self) -> bool:
        """Whether the bench costs more than is allowed, takes other steps or comes elsewhere."""
        bench, alone = self.steps
        far = self.difference is not None and not self.difference <= DIFFERENCE
        if far or bench is None or alone is None or abs(bench - alone) > A_STEP:
            return True
        spent = [
            record.timing.summary.get("median", 0.0) for record in (self.bench, self.alone) if record.timing
        ]
        slow = self.ratio is not None and self.ratio.median > ALLOWED
        return slow and spent[0] - spent[-1] > OVERHEAD


def pairs(results: Results, run: StoredRun) -> list[Pair]:
    """Return every method of a run with its library alone, in the order of the campaign."""
    result = []
    for task, records in tasks(run.records).items():
        alone = {record.case.method.removeprefix(ALONE): record for record in records if _is_alone(record)}
        for record in records:
            if not _is_alone(record) and record.case.method in alone:
                other = alone[record.case.method]
                result.append(Pair(task, record, other, _difference(results, record, other)))
    return result


def healthy(measured: Sequence[Pair]) -> bool:
    """Whether every pair ran and none is beyond what is allowed."""
    return bool(measured) and not any(pair.failed or pair.beyond for pair in measured)


def table(measured: Sequence[Pair]) -> Table:
    """Return the pairs as a table; those beyond what is allowed are marked."""
    rows = []
    for pair in measured:
        if pair.failed:
            continue
        ratio, timing = pair.ratio, pair.alone.timing
        said, spent = NONE, NONE
        if ratio is not None and timing is not None:
            low, high = (ratio.median if end is None else end for end in (ratio.low, ratio.high))
            said, spent = f"{ratio.median:.3f} [{low:.3f}, {high:.3f}]", in_words(median(timing.samples))
        rows.append(
            (
                pair.bench.case.method,
                pair.task.problem + at_once(pair.task.ensemble),
                said + " (beyond)" * pair.beyond,
                spent,
                *(NONE if count is None else str(count) for count in pair.steps),
                NONE if pair.difference is None else f"{pair.difference:.0e}",
            )
        )
    return Table(
        "Each library through this bench, relative to the same library alone",
        (
            *("method", "problem", "bench / alone", "time alone"),
            *("steps, bench", "steps, alone", "end states differ by"),
        ),
        rows,
        "Median and quartiles of the ratio of CPU times in each round; the two alternate in one process, "
        f"compiled and set up beforehand; {ALLOWED:g} is allowed, or {OVERHEAD * 1e6:g} microseconds a "
        "call. The end states of REBOUND's fixed steps differ because it adds up its time, which the "
        "adapter sets to whole steps.",
        words=(0, 1),
    )


def compiled(measured: Sequence[Pair]) -> Table | None:
    """Return the compilations of each pair; ``None`` where nothing was compiled several times."""
    rows = [
        (pair.bench.case.method, pair.task.problem, where, *spread(times))
        for pair in measured
        for where, record in (("bench", pair.bench), ("alone", pair.alone))
        if len(times := outcomes.by_compilation(record)) > 1
    ]
    if not rows:
        return None
    return Table(
        "Best and median of the compilations",
        ("method", "problem", "through", *SPREAD),
        rows,
        "Each compilation, in a fresh process with empty caches, has the median of its samples.",
        words=(0, 1, 2),
        key="compilations",
    )


def costs(results: Results) -> list[Section]:
    """Return for each kind of processor the table, what did not run, and where it was measured."""
    return [
        Section(kind, [part for run in runs for part in _run(results, run)], key=kind, nav=kind)
        for kind, runs in results.by_processor.items()
    ]


def _run(results: Results, run: StoredRun) -> list[Block]:
    measured_pairs = pairs(results, run)
    refused = [
        f"{pair.bench.case.method} on {pair.task.problem}: {pair.failed}"
        for pair in measured_pairs
        if pair.failed
    ]
    libraries = ", ".join(f"{name} {number}" for name, number in run.versions.items())
    said = [machine.sentence(run.machine), *outcomes.compilations(run.records), *outcomes.beside(run.records)]
    why: list[Block] = ["Not run:", Items(refused)] if refused else []
    measured = f"Measured on {run.started[:10]} with {libraries}: `{run.command}`"
    tables = [table(measured_pairs), *([again] if (again := compiled(measured_pairs)) else [])]
    return [*tables, *why, Note(" ".join(said)), measured]


def _is_alone(record: Record) -> bool:
    return record.case.method.startswith(ALONE)


def _difference(results: Results, bench: Record, alone: Record) -> float | None:
    ends = [results.series[record.id].get("y", np.empty(0)) for record in (bench, alone)]
    if not all(end.size for end in ends) or ends[0].shape != ends[1].shape:
        return None
    if bench.case.ensemble is None:
        ends = [end[-1] for end in ends]
    return float(np.abs(ends[0] - ends[1]).max() / np.abs(ends[1]).max())
