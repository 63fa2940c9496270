"""What a metric is, and when its number must not be compared."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from hbvm_bench.measure.measured import Measured
from hbvm_bench.store.records import Value

Quantity = Callable[[Measured], float | str]

# A symmetry guard that left zero by less than this, relative to the size of the
# trajectory, has not yet changed the trajectory; the row says so all the same.
GUARD_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Metric:
    """One thing that is measured on every case."""

    key: str  # the name on the command line and in JSON
    label: str  # for sentences and axes
    short: str  # for column heads
    unit: str
    function: Quantity  # from `Measured` to the number, or to the sentence that says why there is none
    description: str  # one sentence for readers
    better: Literal["lower"] | None = "lower"  # which way is better; ``None`` where neither is
    scale: Literal["log", "linear"] = "log"  # for axes and number formats
    same_trajectory: bool = False  # void where a symmetry guard is violated
    whole_span: bool = True  # void for a case that ended early
    problem: str | None = None  # the only problem that has it, if it is not for all


METRICS: dict[str, Metric] = {}
"""All metrics by key, in the order of `hbvm_bench.measure.metrics`."""


def metric(label: str, short: str, unit: str, more: str = "", **rest: Any) -> Callable[[Quantity], Quantity]:
    """Make a function a metric: its name is the key, its docstring, and ``more``, the description."""

    def enter(function: Quantity) -> Quantity:
        key, words = function.__name__, f"{function.__doc__} {more}"
        METRICS[key] = Metric(key, label, short, unit, function, " ".join(words.split()), **rest)
        return function

    return enter


def guard_violation(measured: Measured) -> str:
    """Return a sentence where the trajectory left the one that was asked for, else ``""``."""
    size = float(np.max(measured.distance, initial=0.0))
    for name, values in measured.guards.items():
        worst = float(np.max(np.abs(values), initial=0.0))
        if not worst <= GUARD_TOLERANCE * size:
            return f"another trajectory: {name.replace('_', ' ')} reached {worst:.2g} instead of 0"
    return ""


def value(metric: Metric, measured: Measured) -> Value:
    """Return a metric of a case, void or without a number where it has to be."""
    with np.errstate(all="ignore"):
        number = metric.function(measured)
    if isinstance(number, str):
        return Value(why=number)
    if not np.isfinite(number):
        return Value(why="not finite")
    if metric.whole_span and not measured.complete:
        return Value(value=float(number), void=True, why=f"only to t = {measured.t_stop:.4g}")
    if metric.same_trajectory and (why := guard_violation(measured)):
        return Value(value=float(number), void=True, why=why)
    return Value(value=float(number))
