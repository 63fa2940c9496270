"""The results as rows: grouped, sorted, formatted; what the terminal and the reports print."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeVar

import msgspec

from hbvm_bench.campaign.file import Case, Ensemble, Grid
from hbvm_bench.measure.metrics import METRICS, Metric, find
from hbvm_bench.store.records import Record, Value
from hbvm_bench.summaries.table import NONE

# In this order a reader needs them; position and its error stand beside the energy, always.
HEADLINE = (
    *("energy_max", "angular_momentum_max", "guard_max", "position_end", "phase_end", "observable_end"),
    *("observable_error", "steps", "evaluations", "warm_seconds", "throughput", "compile_seconds"),
    *("megno", "exponent"),
)
RANKED_BY = "position_end"
APART = 0.1  # position error at the end; the trajectory is another one there
K = TypeVar("K")
R = TypeVar("R")

GROUPS = {
    "on": "On the requested trajectory",
    "apart": "Reached the end with a position error of 10 % or more",
    "uncompared": "At the end; without a reference solution, so that the position error is unknown",
    "off": "On another trajectory: the symmetry or the energy was lost; position and time are excluded",
    "ended": "Did not reach the end",
}


@dataclass(frozen=True)
class Cell:
    """One metric of one case, formatted."""

    text: str
    excluded: bool  # whether the number must not be compared
    why: str  # why it is excluded or missing
    sort: float  # for sorting; infinite where there is no number

    @property
    def shown(self) -> str:
        """The text, in brackets where it is excluded."""
        return f"({self.text})" if self.excluded else self.text


@dataclass(frozen=True)
class Row:
    """One case."""

    record: Record
    group: str  # key of `GROUPS`
    cells: dict[str, Cell]  # by metric key
    remark: str  # what went otherwise than asked, what the solution warns of, and the campaign's note

    def shown(self, key: str) -> str:
        """Return a metric as a cell shows it; a dash where there is none."""
        return self.cells[key].shown if key in self.cells else NONE


def columns(records: Sequence[Record], keys: Sequence[str] | None = None) -> list[Metric]:
    """Return the metrics to show: those asked for, or the headline ones that any case has a value of."""
    if keys:
        return [find(key) for key in keys]
    metrics = [item for record in records for item in record.result.metrics.items()]
    present = {key for key, value in metrics if value.value is not None}
    return [METRICS[key] for key in HEADLINE if key in present or not present]


def rows(records: Sequence[Record], sort: str | None = None) -> list[Row]:
    """Return the rows of one problem, group by group, sorted by a metric within each.

    By default that is the position error; without a reference the order of the campaign stays, for
    energy alone ranks nobody.
    """
    key = find(sort).key if sort else RANKED_BY
    result = [_row(record) for record in records]
    order = list(GROUPS)
    # sorting is stable: what has no number keeps the campaign's order
    return sorted(result, key=lambda row: (order.index(row.group), _sort_value(row, key)))


def grouped_by(key: Callable[[R], K], records: Iterable[R]) -> dict[K, list[R]]:
    """Return the records that have one key together, in order."""
    groups: dict[K, list[R]] = {}
    for record in records:
        groups.setdefault(key(record), []).append(record)
    return groups


class Task(NamedTuple):
    """What the rows of one table share: one trajectory of a problem, or an ensemble, and its samples."""

    problem: str
    ensemble: Ensemble | None
    grid: str  # as JSON

    @classmethod
    def from_case(cls, case: Case) -> "Task":
        """Return that of a case."""
        return cls.on(case.problem, case.grid, case.ensemble)

    @classmethod
    def on(cls, problem: str, grid: Grid | None = None, ensemble: Ensemble | None = None) -> "Task":
        """Return that of a problem, as it prints."""
        return cls(problem, ensemble, msgspec.json.encode(grid or Grid()).decode())

    def sampled(self, tasks: Iterable["Task"]) -> str:
        """Return what tells it from others of ``tasks`` that differ in their samples alone; else ``""``."""
        if not any(task != self and task[:2] == self[:2] for task in tasks):
            return ""
        said = [f"{name}={value!r}" for name, value in msgspec.json.decode(self.grid).items()]
        return f", sampled with {', '.join(said) or 'the usual grid'}"


def tasks(records: Sequence[Record]) -> dict[Task, list[Record]]:
    """Return the records of each table, in order: errors at different times are not compared."""
    return grouped_by(lambda record: Task.from_case(record.case), records)


def at_once(ensemble: Ensemble | None) -> str:
    """Return what follows a problem's name where it is an ensemble, else ``""``."""
    if ensemble is None:
        return ""
    varied = "".join(f", {name} ± {100 * spread:g} %" for name, spread in ensemble.vary)
    return f", {ensemble.count} trajectories at once{varied}"


def grouped(rows_: Sequence[Row]) -> list[tuple[str, list[Row]]]:
    """Return the groups that have rows, each with its title, which says what ranks them."""
    groups = []
    for group, title in GROUPS.items():
        members = [row for row in rows_ if row.group == group]
        ranked = group in ("on", "apart")
        groups += [(title + ", by position error at the end" * ranked, members)] if members else []
    return groups


def numbers(records: Sequence[Record]) -> dict[str, int]:
    """Return the number of every case by its id: that of its method, from 1 in the campaign's order."""
    methods: dict[str, int] = {}
    return {record.id: methods.setdefault(record.case.method, len(methods) + 1) for record in records}


Group = Literal["on", "apart", "uncompared", "off", "ended"]


def group_of(record: Record) -> Group:
    """Return the key in `GROUPS` of a case."""
    result = record.result
    if result.outcome != "ok" or result.status != "finished":
        return "ended"
    if result.violation:
        return "off"
    position = result.metrics.get(RANKED_BY, Value()).value
    return "uncompared" if position is None else "on" if position < APART else "apart"


def reached(record: Record) -> bool:
    """Whether a case reached its end with its symmetry and its energy: its numbers may be compared."""
    return group_of(record) not in ("off", "ended")


def status_of(record: Record) -> str:
    """Say in a few words how a case ended: ``"ok"``, ``"stalled at t = 8.534"``, ..."""
    result = record.result
    if (result.outcome, result.status) == ("ok", "finished"):
        return "ok"
    words = result.status.replace("_", " ") if result.outcome == "ok" else result.outcome
    return words if result.t_stop is None else f"{words} at t = {result.t_stop:.4g}"


def reason_of(record: Record) -> str:
    """Return why a case did not reach the end on its trajectory; empty if it did."""
    if group_of(record) != "ended":
        return record.result.violation
    head, reason = status_of(record), record.result.reason
    return f"{head}: {reason}" if reason else head


def format_value(metric: Metric, value: Value) -> Cell:
    """Format one metric."""
    if value.value is None:
        return Cell(NONE, False, value.why, math.inf)
    number = value.value
    if metric.unit == "s":
        text = seconds(number)
    elif metric.key in ("steps", "evaluations", "throughput"):
        text = f"{int(number):,}".replace(",", "\u202f")
    elif metric.scale == "linear":
        text = f"{number:.6f}" if 1e-3 < abs(number) < 10 else f"{number:.4g}"
    else:
        text = "0" if number == 0 else f"{number:.1e}"
    return Cell(text, value.excluded, value.why, math.inf if value.excluded else number)


def format_metric(record: Record, key: str) -> str:
    """Format a metric of a case; in brackets where it is excluded, a dash where there is none."""
    return format_value(METRICS[key], record.result.metrics.get(key, Value())).shown


def seconds(number: float) -> str:
    """Format seconds with three digits and their unit."""
    factor, unit = (1.0, "s") if number >= 1 else (1e3, "ms") if number * 1e3 >= 1 else (1e6, "µs")
    return f"{number * factor:.3g} {unit}"


def _sort_value(row: Row, key: str) -> float:
    return row.cells[key].sort if key in row.cells else math.inf


def _row(record: Record) -> Row:
    metrics = record.result.metrics
    cells = {key: format_value(METRICS[key], value) for key, value in metrics.items() if key in METRICS}
    return Row(record, group_of(record), cells, _remark(record))


def _remark(record: Record) -> str:
    result = record.result
    parts: list[str] = []
    if reason := reason_of(record):
        parts.append(reason)
    elif (guard := result.metrics.get("guard_max")) is not None and guard.value:
        parts.append(f"the symmetry is violated by {guard.value:.1e}, too little to change the trajectory")
    parts += result.warnings
    if record.case.note:
        parts.append(record.case.note)
    return "; ".join(part.rstrip(". ") for part in parts)
