"""The one table of metrics: the command line, the reports and the documents read only this.

A metric is a function from what was measured to a number, or to a sentence on why there is none. Its
docstring is its description in reports; a new metric is a function here.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.measure import drift
from hbvm_bench.measure.measured import POSITION, Measured
from hbvm_bench.measure.observables import observables
from hbvm_bench.store.records import Value
from problems.errors import unknown

LOADED = "another case had loaded it; the timing pass measures it"

Quantity = Callable[[Measured], float | str]

# A symmetry guard that left zero by less than this, relative to the size of the
# trajectory, has not yet changed the trajectory; the row says so all the same.
GUARD_TOLERANCE = 1e-9

LOST_ENERGY = 0.5
"""A relative error of the energy from which on nobody calls it the trajectory that was asked for."""


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
    same_trajectory: bool = False  # excluded where a symmetry guard is violated
    whole_interval: bool = True  # excluded for a case that ended early


METRICS: dict[str, Metric] = {}
"""All metrics by key, in the order in which they are declared below."""


def metric(label: str, short: str, unit: str, more: str = "", **rest: Any) -> Callable[[Quantity], Quantity]:
    """Make a function a metric: its name is the key, its docstring, and ``more``, the description."""

    def enter(function: Quantity) -> Quantity:
        key, words = function.__name__, f"{function.__doc__} {more}"
        METRICS[key] = Metric(key, label, short, unit, function, " ".join(words.split()), **rest)
        return function

    return enter


def guard_violation(measured: Measured) -> str:
    """Return a sentence where the symmetry or the energy that was asked for is lost, else ``""``."""
    size = float(np.max(measured.distance, initial=0.0))
    for name, values in measured.guards.items():
        worst = float(np.max(np.abs(values), initial=0.0))
        if not worst <= GUARD_TOLERANCE * size:
            return f"another trajectory: {name.replace('_', ' ')} reached {worst:.2g} instead of 0"
    lost = float(np.max(measured.errors.get("energy", np.empty(0)), initial=0.0))
    if measured.trajectories == 1 and lost >= LOST_ENERGY:
        return f"another trajectory: the energy is wrong by {lost:.1g} times its size"
    return ""


def evaluate(measured: Measured) -> dict[str, Value]:
    """Return the metrics of a case that apply to its problem, by key."""
    return {m.key: _value(m, measured) for m in METRICS.values()}


def _value(metric: Metric, measured: Measured) -> Value:
    """Return a metric of a case, excluded or without a number where it has to be."""
    with np.errstate(all="ignore"):
        number = metric.function(measured)
    if isinstance(number, str):
        return Value(why=number)
    if not np.isfinite(number):
        return Value(why="not finite")
    why = ""
    if metric.whole_interval and not measured.complete:
        why = f"only to t = {measured.t_stop:.4g}"
    elif metric.same_trajectory:
        why = guard_violation(measured)
    return Value(value=float(number), excluded=bool(why), why=why)


def find(key: str) -> Metric:
    """Return the metric called ``key``; an unknown name fails with the nearest ones."""
    if key not in METRICS:
        raise unknown("metric", key, METRICS)
    return METRICS[key]


@metric("energy error", "energy", "relative")
def energy_max(m: Measured) -> float | str:
    """Largest error of the energy over all samples, relative to its terms, evaluated in double-double."""
    return _error_max(m, "energy")


@metric("energy error at the end", "energy, end", "relative")
def energy_end(m: Measured) -> float | str:
    """Relative error of the energy at the last sample."""
    if "energy" not in m.errors:
        return "the problem declares no energy"
    return float(m.errors["energy"][-1]) if m.t.size else "no samples"


@metric("angular momentum error", "ang. mom.", "relative")
def angular_momentum_max(m: Measured) -> float | str:
    """Largest 2-norm of the error of the angular momentum vector, relative to its length."""
    return _error_max(m, "angular_momentum")


@metric("error of the other invariants", "others", "relative")
def invariants_max(m: Measured) -> float | str:
    """Largest error of any invariant but the energy over all samples, relative to its size."""
    others = [errors for name, errors in m.errors.items() if name != "energy"]
    return _largest_of(others, m) if others else "the problem has no invariant but the energy"


@metric("power of t of the energy error", "slope", "", scale="linear", same_trajectory=True)
def energy_slope(m: Measured) -> float | str:
    """Power of t with which the energy error grows, over initial conditions: 1/2 for a random walk."""
    return _of_growth(m, "slope")


@metric("mean energy drift", "drift", "1/time", better=None, scale="linear", same_trajectory=True)
def energy_rate(m: Measured) -> float | str:
    """Mean signed relative energy error per unit of time, over several initial conditions."""
    return _of_growth(m, "rate")


@metric("energy error at the end, over initial conditions", "energy, rms", "relative", same_trajectory=True)
def energy_rms(m: Measured) -> float | str:
    """Root mean square over several initial conditions of the relative energy error at the end."""
    errors = m.drift.get("energy", np.empty((0, 0)))
    return float(drift.rms(errors)[-1]) if errors.size else "no further initial conditions were requested"


@metric("mean energy error over the drift threshold", "bias", "", scale="linear", same_trajectory=True)
def energy_bias(m: Measured) -> float | str:
    """Mean energy error over several initial conditions, in units of the smallest that is called a drift (3
    standard errors; more for few initial conditions): above 1 it is a drift.
    """
    growth = m.growth.get("energy")
    if growth is None or growth.mean is None or not growth.mean_error:
        return "a mean needs several initial conditions"
    return abs(growth.mean) / (drift.limit(growth.starts) * growth.mean_error)


@metric("time-reversal error", "reversal", "length", same_trajectory=True)
def reversal(m: Measured) -> float | str:
    """Time-reversal error: distance from the initial state after integrating forwards and back over part of
    the interval.
    """
    return m.reversal


@metric("MEGNO", "MEGNO", "", better=None, scale="linear", same_trajectory=True)
def megno(m: Measured) -> float | str:
    """Mean exponential growth factor of nearby orbits at the end, from the derivatives of the method's
    steps: near 2 for regular motion, half the largest Lyapunov exponent times the time for chaotic motion.
    """
    return _of_chaos(m, "megno")


@metric("largest Lyapunov exponent", "exponent", "1/time", better=None, scale="linear", same_trajectory=True)
def exponent(m: Measured) -> float | str:
    """Largest Lyapunov exponent over the integration interval, from the derivatives of the method's steps."""
    return _of_chaos(m, "exponent")


@metric(
    "lower end of the exponent's interval", "exponent, low", "1/time",
    better=None, scale="linear", same_trajectory=True,
)  # fmt: skip
def exponent_low(m: Measured) -> float | str:
    """Lower end of the 95 % interval of the largest Lyapunov exponent: above 0, the motion is chaotic."""
    return _of_chaos(m, "exponent", 1)


@metric(
    "upper end of the exponent's interval", "exponent, high", "1/time",
    better=None, scale="linear", same_trajectory=True,
)  # fmt: skip
def exponent_high(m: Measured) -> float | str:
    """Upper end of the 95 % interval of the largest Lyapunov exponent."""
    return _of_chaos(m, "exponent", 2)


@metric("symmetry violation", "symmetry", "length")
def guard_max(m: Measured) -> float | str:
    """Largest value of a quantity that is exactly 0 by the problem's symmetry (Sitnikov: the planetoid's
    distance from the axis). If it is not 0, the run follows another trajectory.
    """
    return _largest_of(list(m.guards.values()), m) if m.guards else "the problem declares no symmetry guard"


@metric("position error at the end", "position", "relative", more=POSITION, same_trajectory=True)
def position_end(m: Measured) -> float | str:
    """Position error at the end time."""
    return _no_reference_at_end(m) or float(m.position[-1])


@metric("position error", "position, max", "relative", same_trajectory=True)
def position_max(m: Measured) -> float | str:
    """The same, the largest over the times of the stored reference."""
    return _not_compared(m) or _largest(m.position, m.position_t)


@metric("mean position error", "position, mean", "relative", same_trajectory=True)
def position_mean(m: Measured) -> float | str:
    """Geometric mean over the times of the stored reference after the start: at round-off a single error is
    random.
    """
    if why := _no_reference_at_end(m):
        return why
    with np.errstate(divide="ignore"):
        return float(np.exp(np.mean(np.log(m.position))))


@metric("phase error at the end", "phase", "time", same_trajectory=True)
def phase_end(m: Measured) -> float | str:
    """Time difference to the reference along its trajectory at the end."""
    return _no_reference_at_end(m) or abs(float(m.phase[-1]))


@metric("phase error", "phase, max", "time", same_trajectory=True)
def phase_max(m: Measured) -> float | str:
    """The same, the largest over the times of the stored reference."""
    return _not_compared(m) or _largest(m.phase, m.position_t)


@metric("observable at the end", "observable", "", better=None, scale="linear", same_trajectory=True)
def observable_end(m: Measured) -> float | str:
    """Value at the end time of the first quantity that the problem declares (Sitnikov: the planetoid's height
    on the axis).
    """
    known = list(observables(m.problem).values())
    if not known:
        return "the problem declares no observable"
    return float(known[0](m.y[-1:])[0]) if m.complete else f"ended at t = {m.t_stop:.4g}"


@metric("error of the observable at the end", "obs. error", "", same_trajectory=True)
def observable_error(m: Measured) -> float | str:
    """Distance of this quantity at the end time from that of the stored 128-bit reference."""
    known = list(observables(m.problem).values())
    if not known:
        return "the problem declares no observable"
    if (why := _no_reference_at_end(m)) or m.reference is None:
        return why
    (last,) = np.flatnonzero(m.reference.t == m.t[-1])
    return abs(float((known[0](m.y[-1:]) - known[0](m.reference.high[last : last + 1]))[0]))


@metric("largest distance", "distance", "length", better=None)
def distance_max(m: Measured) -> float | str:
    """Largest distance of a body from the origin; large if a body escaped."""
    return _largest(m.distance, m.t)


@metric("steps", "steps", "", better=None, same_trajectory=True)
def steps(m: Measured) -> float | str:
    """Accepted steps."""
    return "not applicable: the library counts no steps" if m.counters.steps is None else m.counters.steps


@metric("evaluations", "evals", "", same_trajectory=True)
def evaluations(m: Measured) -> float | str:
    """Evaluations of the vector field at one state; Taylor methods and maps have none."""
    if m.counters.evaluations is None:
        return "not applicable: the library counts no right-hand-side evaluations"
    return m.counters.evaluations


@metric("time", "time", "s", same_trajectory=True)
def warm_seconds(m: Measured) -> float | str:
    """Median seconds of a whole integration without output, after compilation, with no other case running;
    wall time or CPU time, as the campaign specifies.
    """
    if m.timing is None:
        return "not timed"
    return m.timing.summary.get("median", m.timing.why or "not timed")


@metric("trajectories per second", "per second", "1/s", better=None, same_trajectory=True)
def throughput(m: Measured) -> float | str:
    """Trajectories of an ensemble per second, on one core."""
    if m.trajectories == 1:
        return "one trajectory, no ensemble"
    seconds = warm_seconds(m)
    return seconds if isinstance(seconds, str) else m.trajectories / seconds


@metric("compile time", "compile", "s", whole_interval=False)
def compile_seconds(m: Measured) -> float | str:
    """Seconds of compilation before the first step, without what an earlier case of the same process has
    compiled: where a library shares code among settings, all but the first of them take less.
    """
    compiled = m.timing.compile if m.timing is not None and m.timing.compile else m.compile
    if compiled is None:
        return LOADED
    return "nothing is compiled at run time" if compiled.cached is None else compiled.seconds


@metric("peak memory", "memory", "MiB", whole_interval=False)
def peak_memory(m: Measured) -> float | str:
    """Largest resident memory of the process that took the samples, libraries included."""
    return "not measured" if m.peak_gib is None else 1024.0 * m.peak_gib


def _error_max(m: Measured, invariant: str) -> float | str:
    if invariant not in m.errors:
        return f"the problem declares no {invariant.replace('_', ' ')}"
    return _largest(m.errors[invariant], m.t)


def _of_chaos(m: Measured, name: str, place: int = 0) -> float | str:
    """Return a number of what `hbvm_bench.measure.chaos` stored under a name."""
    value = m.chaos.get(name, "not asked for")
    return value if isinstance(value, str) else float(value[place])


def _of_growth(m: Measured, name: str) -> float | str:
    """Return a number of the growth of the energy error."""
    growth = m.growth.get("energy")
    if growth is None:
        return "no error growth was fitted"
    number = getattr(growth, name)
    return growth.why or "the samples do not determine it" if number is None else number


def _largest(values: NDArray[np.float64], t: NDArray[np.float64]) -> float | str:
    if values.size == 0:
        return "no samples"
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        return f"not finite from t = {t[bad[0]]:.4g}"
    return float(np.max(np.abs(values)))


def _largest_of(series: list[NDArray[np.float64]], m: Measured) -> float | str:
    largest: list[Any] = [_largest(values, m.t) for values in series]
    return next((value for value in largest if isinstance(value, str)), None) or max(largest)


def _not_compared(m: Measured) -> str:
    """Return why no position was compared after the start, else ``""``."""
    if m.reference is None:
        return "no stored reference for this problem"
    return "" if m.position_t.size else "the stored reference has none of the run's times after the start"


def _no_reference_at_end(m: Measured) -> str:
    if m.reference is not None and not m.complete:
        return f"ended at t = {m.t_stop:.4g}"
    if m.position_t.size and m.position_t[-1] != m.t[-1]:
        return f"the reference ends at t = {m.position_t[-1]:.6g}; nothing was compared after it"
    return _not_compared(m)
