"""What the bench costs each peer beside its library alone, from the results of the campaign `peers`."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from hbvm_bench.measure.timing import Spread
from hbvm_bench.report.document import Block, Items
from hbvm_bench.report.page import Results
from hbvm_bench.store.records import Record
from hbvm_bench.summaries.rows import Task, at_once, reason_of, seconds, tasks
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


def pairs(results: Results) -> list[Pair]:
    """Return every method with its library alone, in the order of the campaign."""
    result = []
    for task, records in tasks([record for run in results.runs for record in run.records]).items():
        alone = {r.case.method.removeprefix(ALONE): r for r in records if r.case.method.startswith(ALONE)}
        for record in records:
            if (other := alone.get(record.case.method)) is not None:
                result.append(Pair(task, record, other, _difference(results, record, other)))
    return result


def healthy(measured: Sequence[Pair]) -> bool:
    """Whether every pair ran and none is beyond what is allowed."""
    return bool(measured) and not any(pair.failed or pair.beyond for pair in measured)


def overhead(results: Results) -> list[Block]:
    """Return the pairs, and what did not run."""
    measured = pairs(results)
    refused = [f"{p.bench.case.method} on {p.task.problem}: {p.failed}" for p in measured if p.failed]
    return [table(measured), *(["Not run:", Items(refused)] if refused else [])]


def counts(results: Results) -> dict[str, float]:
    """Return for the first sentence how many pairs there are, how many are beyond, and the largest ratio."""
    measured = [pair for pair in pairs(results) if not pair.failed]
    ratios = [pair.ratio.median for pair in measured if pair.ratio is not None]
    return {
        "pairs": len(measured),
        "timed": len(ratios),
        "beyond": sum(pair.beyond for pair in measured),
        "largest": max(ratios),
        "middle": median(ratios),
    }


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
            said, spent = f"{ratio.median:.3f} [{low:.3f}, {high:.3f}]", seconds(median(timing.samples))
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
        "Each library through this benchmark, relative to the same library alone",
        (
            *("method", "problem", "benchmark / alone", "time alone"),
            *("steps, benchmark", "steps, alone", "end states differ by"),
        ),
        rows,
        "Median and quartiles of the ratio of CPU times in each round; the two alternate in one process, "
        f"compiled and set up beforehand; an overhead of at most {ALLOWED - 1:.0%}, or of "
        f"{OVERHEAD * 1e6:g} microseconds a call, is allowed. The end states of REBOUND's fixed steps differ "
        "because it adds up its time, which the adapter sets to whole steps.",
        words=(0, 1),
    )


def _difference(results: Results, bench: Record, alone: Record) -> float | None:
    ends = [results.series.get(record.id, {}).get("y", np.empty(0)) for record in (bench, alone)]
    if not all(end.size for end in ends) or ends[0].shape != ends[1].shape:
        return None
    if bench.case.ensemble is None:
        ends = [end[-1] for end in ends]
    return float(np.abs(ends[0] - ends[1]).max() / np.abs(ends[1]).max())
