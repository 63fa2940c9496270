"""The one table of metrics: the command line, the reports and the documents read only this."""

from collections.abc import Iterable

from hbvm_bench.measure import quantities
from hbvm_bench.measure.measured import POSITION, Measured
from hbvm_bench.measure.metric import GUARD_TOLERANCE, Metric, guard_violation, value
from hbvm_bench.store.records import Value
from problems.errors import unknown

__all__ = ["GUARD_TOLERANCE", "METRICS", "TIMING_KEYS", "Metric", "evaluate", "find", "guard_violation"]


def evaluate(measured: Measured, keys: Iterable[str] | None = None) -> dict[str, Value]:
    """Return the metrics of a case by key.

    Parameters
    ----------
    measured : Measured
        What was measured.
    keys : iterable of str, optional
        Only these; all that apply to the problem by default.
    """
    chosen = METRICS.values() if keys is None else (find(key) for key in keys)
    return {m.key: value(m, measured) for m in chosen if m.problem in (None, measured.problem.name)}


def find(key: str) -> Metric:
    """Return the metric called ``key``; an unknown name fails with the nearest ones."""
    if key not in METRICS:
        raise unknown("metric", key, METRICS)
    return METRICS[key]


_TABLE = [
    Metric(
        key="energy_max",
        label="energy error",
        short="energy",
        unit="relative",
        better="lower",
        scale="log",
        function=quantities.error_max("energy"),
        description="Largest relative error of the energy over all samples, evaluated in double-double.",
    ),
    Metric(
        key="energy_end",
        label="energy error at the end",
        short="energy, end",
        unit="relative",
        better="lower",
        scale="log",
        function=quantities.energy_end,
        description="Relative error of the energy at the last sample.",
    ),
    Metric(
        key="angular_momentum_max",
        label="angular momentum error",
        short="ang. mom.",
        unit="relative",
        better="lower",
        scale="log",
        function=quantities.error_max("angular_momentum"),
        description="Largest 2-norm of the error of the angular momentum vector, relative to its length.",
    ),
    Metric(
        key="invariants_max",
        label="error of the other invariants",
        short="others",
        unit="relative",
        better="lower",
        scale="log",
        function=quantities.others_max,
        description="Largest error of any invariant but the energy over all samples, relative to its size.",
    ),
    Metric(
        key="energy_slope",
        label="power of t of the energy error",
        short="slope",
        unit="",
        better="lower",
        scale="linear",
        function=quantities.law_number("slope"),
        description="Power of t with which the energy error grows, over starts: 1/2 for a random walk.",
        same_trajectory=True,
    ),
    Metric(
        key="energy_rate",
        label="mean energy drift",
        short="drift",
        unit="1/time",
        better=None,
        scale="linear",
        function=quantities.law_number("rate"),
        description="Mean signed relative energy error per unit of time, over several starts.",
        same_trajectory=True,
    ),
    Metric(
        key="energy_rms",
        label="energy error at the end, over the starts",
        short="energy, rms",
        unit="relative",
        better="lower",
        scale="log",
        function=quantities.energy_rms,
        description="Root mean square over several starts of the relative energy error at the end.",
        same_trajectory=True,
    ),
    Metric(
        key="energy_bias",
        label="mean energy error over what is called a drift",
        short="bias",
        unit="",
        better="lower",
        scale="linear",
        function=quantities.energy_bias,
        description="Mean energy error over several starts, in units of the least that is called a drift "
        "(3 of its standard errors, with few starts more): above 1 it is one.",
        same_trajectory=True,
    ),
    Metric(
        key="energy_rate_least",
        label="least energy drift within the interval",
        short="least drift",
        unit="1/time",
        better="lower",
        scale="log",
        function=quantities.energy_rate_least,
        description="The drift nearest to 0 in the 95 % interval over several starts; 0 where that has it.",
        same_trajectory=True,
    ),
    Metric(
        key="reversal",
        label="error of time reversal",
        short="reversal",
        unit="length",
        better="lower",
        scale="log",
        function=quantities.reversal,
        description="Largest distance of a body from its start after integrating part of the span and back.",
        same_trajectory=True,
    ),
    Metric(
        key="guard_max",
        label="off-axis distance",
        short="off axis",
        unit="length",
        better="lower",
        scale="log",
        function=quantities.guard_max,
        description="Largest value of what the problem's symmetry keeps at exactly 0 (Sitnikov: the "
        "planetoid's distance from the axis). Where it is not 0 the run follows another trajectory.",
    ),
    Metric(
        key="position_end",
        label="position error at the end",
        short="position",
        unit="relative",
        better="lower",
        scale="log",
        function=quantities.position_end,
        description="Position error at the end time. " + POSITION,
        same_trajectory=True,
    ),
    Metric(
        key="position_max",
        label="position error",
        short="position, max",
        unit="relative",
        better="lower",
        scale="log",
        function=quantities.position_max,
        description="The same, the largest over the times of the stored reference.",
        same_trajectory=True,
    ),
    Metric(
        key="position_mean",
        label="mean position error",
        short="position, mean",
        unit="relative",
        better="lower",
        scale="log",
        function=quantities.position_mean,
        description="The geometric mean over the times of the stored reference after the start: at "
        "round-off a single one is a matter of luck.",
        same_trajectory=True,
    ),
    Metric(
        key="phase_end",
        label="phase error at the end",
        short="phase",
        unit="time",
        better="lower",
        scale="log",
        function=quantities.phase_end,
        description="How far in time the run is from the reference along its trajectory at the end.",
        same_trajectory=True,
    ),
    Metric(
        key="phase_max",
        label="phase error",
        short="phase, max",
        unit="time",
        better="lower",
        scale="log",
        function=quantities.phase_max,
        description="The same, the largest over the times of the stored reference.",
        same_trajectory=True,
    ),
    Metric(
        key="z_end",
        label="z at the end",
        short="z(end)",
        unit="length",
        better=None,
        scale="linear",
        function=quantities.axis_end,
        description="Where the planetoid is on the axis at the end time.",
        same_trajectory=True,
        problem="sitnikov",
    ),
    Metric(
        key="z_error",
        label="error of z at the end",
        short="z error",
        unit="length",
        better="lower",
        scale="log",
        function=quantities.axis_error,
        description="Distance of z at the end time from the stored 128-bit reference.",
        same_trajectory=True,
        problem="sitnikov",
    ),
    Metric(
        key="distance_max",
        label="largest distance",
        short="distance",
        unit="length",
        better=None,
        scale="log",
        function=quantities.distance_max,
        description="Largest distance of a body from the origin: shows what escaped.",
    ),
    Metric(
        key="steps",
        label="steps",
        short="steps",
        unit="",
        better=None,
        scale="log",
        function=quantities.counter("steps", "steps"),
        description="Accepted steps.",
        same_trajectory=True,
    ),
    Metric(
        key="evaluations",
        label="evaluations",
        short="evals",
        unit="",
        better="lower",
        scale="log",
        function=quantities.counter("evaluations", "right-hand-side evaluations"),
        description="Evaluations of the vector field at one state; Taylor methods and maps have none.",
        same_trajectory=True,
    ),
    Metric(
        key="warm_seconds",
        label="time",
        short="time",
        unit="s",
        better="lower",
        scale="log",
        function=quantities.warm_seconds,
        description="Median wall seconds of a whole integration without output, compiled before, alone.",
        same_trajectory=True,
    ),
    Metric(
        key="throughput",
        label="trajectories per second",
        short="per second",
        unit="1/s",
        better=None,
        scale="log",
        function=quantities.throughput,
        description="Trajectories of an ensemble per second, on one core.",
        same_trajectory=True,
    ),
    Metric(
        key="compile_seconds",
        label="compile time",
        short="compile",
        unit="s",
        better="lower",
        scale="log",
        function=quantities.compile_seconds,
        description="Seconds of compilation before the first step, from a cache where the library keeps one.",
        whole_span=False,
    ),
    Metric(
        key="compile_cold",
        label="compile time, cold",
        short="cold",
        unit="s",
        better="lower",
        scale="log",
        function=quantities.compiled(cached=False),
        description="Seconds of compilation with nothing in a cache.",
        whole_span=False,
    ),
    Metric(
        key="compile_cached",
        label="compile time, cached",
        short="cached",
        unit="s",
        better="lower",
        scale="log",
        function=quantities.compiled(cached=True),
        description="Seconds until compiled code was loaded from the library's cache.",
        whole_span=False,
    ),
    Metric(
        key="peak_memory",
        label="peak memory",
        short="memory",
        unit="MiB",
        better="lower",
        scale="log",
        function=quantities.peak_memory,
        description="Largest resident memory of the process that took the samples, libraries included.",
        whole_span=False,
    ),
]

METRICS: dict[str, Metric] = {metric.key: metric for metric in _TABLE}
TIMING_KEYS = ("warm_seconds", "throughput", "compile_seconds", "compile_cold", "compile_cached")
