"""Two runs of the same cases: what changed beyond noise."""

import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from statistics import fmean, median, variance

import msgspec

from hbvm_bench.campaign.file import Case
from hbvm_bench.measure import machine, reading
from hbvm_bench.measure.metrics import METRICS, Metric
from hbvm_bench.store.records import Record, Value
from hbvm_bench.store.store import Store
from hbvm_bench.summaries.rows import format_value, seconds, status_of

COSTS = ("s", "1/s", "MiB")  # units of what differs from run to run
# Other sources, versions or machines round otherwise. A truncation error hardly feels that; an error
# that is all rounding does.
SAME_TO = 1e-6
ROUNDING, ROUNDING_FACTOR = 1e-11, 4.0
# Of times, below which nothing is said: the same sources on the same quiet machine differed by up to
# 1.14 from run to run where a call takes 0.2 ms.
SMALLEST_RATIO = 1.2
DEVIATIONS = 4.0


@dataclass(frozen=True)
class Change:
    """One thing that differs between two runs of a case."""

    problem: str
    method: str
    quantity: str  # a metric's label, ``"outcome"`` or ``"time"``
    before: str
    after: str


@dataclass
class RunComparison:
    """What changed from a first run to a second one."""

    cases: int = 0  # those that both have
    only_first: list[str] = field(default_factory=list)  # cases that the other lacks
    only_second: list[str] = field(default_factory=list)
    behind: list[str] = field(default_factory=list)  # versions, sources and machines that differ
    equal: int = 0  # metrics that are the same number
    rounded: int = 0  # and that differ by rounding only
    changed: list[Change] = field(default_factory=list)  # outcomes and metrics that differ by more
    timed: int = 0  # times compared, each divided by the calibration beside it
    noise: float | None = None  # ratio of two times that is not told from 1 in a typical case
    slower: list[Change] = field(default_factory=list)  # by more than the samples' scatter explains
    faster: list[Change] = field(default_factory=list)
    untimed: list[str] = field(default_factory=list)  # why times were not compared

    @property
    def unchanged(self) -> bool:
        """Whether nothing changed beyond noise and no case is missing."""
        return not (self.only_first or self.only_second or self.changed or self.slower or self.faster)


def compare(first: Store, second: Store) -> RunComparison:
    """Compare two runs case by case.

    A case of one run is that of the other if problem, method and sampling are the
    same; sources, versions and machines may differ.
    """
    first_records, other = _by_case(reading.records(first)), _by_case(reading.records(second))
    both = [(record, other[key]) for key, record in first_records.items() if key in other]
    comparison = RunComparison(
        cases=len(both),
        only_first=[_name(record.case) for key, record in first_records.items() if key not in other],
        only_second=[_name(record.case) for key, record in other.items() if key not in first_records],
        behind=_behind(both),
    )
    for before, after in both:
        _compare_numbers(before, after, comparison)
    _compare_times(both, comparison)
    return comparison


def _by_case(records: Sequence[Record]) -> dict[bytes, Record]:
    plain = {"settings": "chosen", "note": ""}  # words about the case
    return {msgspec.json.encode(msgspec.structs.replace(record.case, **plain)): record for record in records}


def _name(case: Case) -> str:
    return f"{case.method} on {case.problem}"


def _behind(both: Sequence[tuple[Record, Record]]) -> list[str]:
    reasons: list[str] = []
    for before, after in both:
        for name in sorted(before.versions.keys() | after.versions.keys()):
            was, now = before.versions.get(name, "none"), after.versions.get(name, "none")
            reasons += [f"{name} {was} → {now}"] if was != now else []
        if before.versions == after.versions and before.id != after.id:
            reasons.append("the sources of hbvm-bench or of a method")
        for name, was in before.machine.items():
            if (now := after.machine.get(name, was)) != was and name not in machine.MEASURED:
                reasons.append(f"{name.replace('_', ' ')} {was} → {now}")
    return list(dict.fromkeys(reasons))


def _compare_numbers(before: Record, after: Record, comparison: RunComparison) -> None:
    strict = before.id == after.id and machine.same(before.machine, after.machine)

    def differs(label: str, was: str, now: str) -> None:
        comparison.changed.append(Change(before.case.problem, before.case.method, label, was, now))

    lost = (", on another trajectory" * bool(record.result.violation) for record in (before, after))
    was, now = (status_of(record) + words for record, words in zip((before, after), lost, strict=True))
    if was != now:
        differs("outcome", was, now)
    metrics_before, other = before.result.metrics, after.result.metrics
    for key, metric in METRICS.items():
        if metric.unit in COSTS or not (key in metrics_before or key in other):
            continue
        a, b = metrics_before.get(key, Value()), other.get(key, Value())
        if a.value == b.value and a.excluded == b.excluded:
            comparison.equal += 1
        elif a.value is None or b.value is None or a.excluded != b.excluded:
            differs(metric.label, _shown(metric, a), _shown(metric, b))
        elif not strict and _is_rounding(metric, a.value, b.value):
            comparison.rounded += 1
        else:
            differs(metric.label, f"{a.value:.17g}", f"{b.value:.17g}")


def _shown(metric: Metric, value: Value) -> str:
    text = format_value(metric, value).text
    if value.excluded:
        return f"({text}), {value.why}"
    return text if value.value is not None else value.why or text


def _is_rounding(metric: Metric, a: float, b: float) -> bool:
    if abs(a - b) <= SAME_TO * max(abs(a), abs(b)):
        return True
    if metric.scale != "log" or metric.better != "lower":
        return False
    small, large = sorted((abs(a), abs(b)))
    return large <= ROUNDING and large <= ROUNDING_FACTOR * max(small, sys.float_info.epsilon)


def _compare_times(both: Sequence[tuple[Record, Record]], comparison: RunComparison) -> None:
    pairs: list[tuple[Record, Record, list[float], list[float]]] = []
    for before, after in both:
        why = next(_untimed((before, after)), "")
        if why:
            comparison.untimed.append(f"{_name(before.case)}: {why}")
        elif before.timing and after.timing:
            pairs.append((before, after, _logarithms(before), _logarithms(after)))
    comparison.timed = len(pairs)
    if not pairs:
        return
    common = _typical_variance([logs for *_, first_logs, other in pairs for logs in (first_logs, other)])
    doubts = [
        max(math.log(SMALLEST_RATIO), _doubt(first_logs, other, common)) for *_, first_logs, other in pairs
    ]
    comparison.noise = math.exp(median(doubts))
    for (before, after, first_logs, other), doubt in zip(pairs, doubts, strict=True):
        shift = fmean(other) - fmean(first_logs)
        if abs(shift) <= doubt:
            continue
        was, now = (seconds(record.timing.summary["median"]) for record in (before, after) if record.timing)
        case, said = before.case, f"{now}, {math.exp(shift):.2f} times as long"
        change = Change(case.problem, case.method, "time", was, said)
        (comparison.slower if shift > 0 else comparison.faster).append(change)


def _untimed(records: Sequence[Record]) -> Iterator[str]:
    for record in records:
        timing = record.timing
        if timing is None or not timing.rounds:
            if timing is not None and timing.why:
                yield timing.why
            elif any(other.timing and other.timing.rounds for other in records):
                yield "timed in one run only"
        elif not all(round_.calibration for round_ in timing.rounds):
            yield "taken without the calibration"
        elif timing.load is not None and (busy := timing.load.verdict()):
            yield busy


def _logarithms(record: Record) -> list[float]:
    """Return the logarithm of each round's median time in units of the calibration."""
    assert record.timing is not None
    return [math.log(median(round_.calibrated)) for round_ in record.timing.rounds]


def _typical_variance(groups: Sequence[Sequence[float]]) -> float:
    """Return the variance between rounds of a typical case: the median, for outliers stay outliers.

    The median of a sample variance of n normal numbers is below their variance by the
    factor (1 - 2/9(n - 1))^3, Wilson and Hilferty's approximation.
    """
    scaled = [variance(group) / (1 - 2 / (9 * (len(group) - 1))) ** 3 for group in groups if len(group) > 1]
    return median(scaled) if scaled else 0.0


def _doubt(first: Sequence[float], other: Sequence[float], common: float) -> float:
    own = ((variance(group) if len(group) > 1 else 0.0, len(group)) for group in (first, other))
    return DEVIATIONS * math.sqrt(sum(max(scatter, common) / count for scatter, count in own))
