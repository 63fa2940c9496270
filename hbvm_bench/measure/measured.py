"""From a solution to what is measured on it: error series, guards, distances."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.reference.solutions import Reference
from hbvm_bench.store.records import Compile, Counters, Law, Result, Timing
from integrators.protocol import Status
from integrators.solution import Solution
from problems import emit
from problems.problem import Problem

Array = NDArray[np.float64]

PLAIN = ("t", "y", "distance", "position_t", "position", "phase")
PREFIXES = {"errors": "error.", "guards": "guard.", "drift": "drift.", "extra": "extra."}
"""What of a `Measured` the store keeps as series: by its own name, and by that of each with a prefix."""


@dataclass(frozen=True)
class Measured:
    """Everything that a metric may look at."""

    problem: Problem
    t: Array  # of the samples, shape (n,)
    y: Array  # shape (n, dim)
    errors: dict[str, Array]  # of the invariants by name, relative where that has a meaning, shape (n,)
    guards: dict[str, Array]  # what a symmetry keeps at exactly zero, shape (n,)
    distance: Array  # largest of a body (or of q) from the origin, shape (n,)
    position_t: Array  # times of the reference that were reached, shape (m,)
    position: Array  # the error of the position there
    phase: Array  # how far in time the run is ahead of the reference along its trajectory
    reference: Reference | None  # the trusted solution, where there is one
    complete: bool  # whether the end time was reached
    t_stop: float
    counters: Counters = field(default_factory=Counters)
    compile: Compile | None = None
    timing: Timing | None = None
    # of an ensemble more than one: ``y`` has the end of each, and its errors are those against its own start
    trajectories: int = 1
    peak_gib: float | None = None  # largest resident memory of the process
    laws: dict[str, Law] = field(default_factory=dict)  # how the error of each invariant grows
    # what the laws were found from: ``t`` of shape (n,), and the errors by invariant, of shape (starts, n)
    drift: dict[str, Array] = field(default_factory=dict)
    reversal: float | str = "not asked for"  # distance from the start after integrating there and back
    extra: dict[str, Array] = field(default_factory=dict)

    def series(self) -> dict[str, Array]:
        """Return the arrays that the store keeps beside the record."""
        made = {name: getattr(self, name) for name in PLAIN}
        for field_, prefix in PREFIXES.items():
            made |= {f"{prefix}{name}": values for name, values in getattr(self, field_).items()}
        return made


def measure(solution: Solution, reference: Reference | None) -> Measured:
    """Evaluate everything on the samples of a solution, against the trusted one where there is one."""
    problem, t, y = solution.problem, solution.t, solution.y
    # an overflow is a result here: it becomes a sentence in the metrics
    with np.errstate(all="ignore"):
        errors = {name: np.asarray(values, float) for name, values in problem.errors(y, t).items()}
        guards = {name: np.asarray(values, float) for name, values in problem.guards(y, t).items()}
        distance = largest_distance(problem, positions(problem, y))
        position_t, position, phase = _position_error(problem, t, y, reference)
    stats = solution.stats
    counts = {name: getattr(stats, name) for name in ("steps", "rejections", "evaluations", "iterations")}
    counts = {name: None if count is None else int(count) for name, count in counts.items()}
    histories = {name: v for name, v in stats.extra.items() if isinstance(v, np.ndarray)}
    return Measured(
        problem=problem,
        t=t,
        y=y,
        errors=errors,
        guards=guards,
        distance=distance,
        position_t=position_t,
        position=position,
        phase=phase,
        reference=reference,
        complete=solution.status is Status.FINISHED,
        t_stop=float(solution.t_stop),
        counters=Counters(**counts, solver=stats.solver),
        compile=Compile(seconds=float(solution.compile_seconds), cached=solution.from_cache),
        extra={name: values for name, values in histories.items() if values.dtype.kind in "fiu"},
    )


def restore(
    problem: Problem,
    series: dict[str, Array],
    result: Result,
    reference: Reference | None,
    timing: Timing | None,
) -> Measured:
    """Put together again what was measured, from the store, with a timing."""
    arrays: dict[str, Any] = {name: series[name] for name in PLAIN}
    for field_, prefix in PREFIXES.items():
        named = {name: values for name, values in series.items() if name.startswith(prefix)}
        arrays[field_] = {name.removeprefix(prefix): values for name, values in named.items()}
    return Measured(
        problem=problem,
        reference=reference,
        complete=result.status == Status.FINISHED,
        t_stop=float("nan") if result.t_stop is None else result.t_stop,
        counters=result.counters,
        compile=result.compile,
        timing=timing,
        trajectories=result.trajectories,
        laws=result.laws,
        reversal=result.reversal.why if result.reversal.value is None else result.reversal.value,
        peak_gib=result.peak_gib,
        **arrays,
    )


def positions(problem: Problem, y: Array) -> Array:
    """Return the part of the states that says where things are, shape (n, dof) or (n, dim)."""
    dof = problem.system.dof
    return y if dof is None else y[:, :dof]


def largest_distance(problem: Problem, q: Array) -> Array:
    """Return the largest distance of a body from the origin, shape (n,).

    ``q``, shape (n, dof), are positions or differences of them; without bodies all of it is one vector.
    """
    bodies = getattr(problem.system, "bodies", None)
    width = q.shape[1] if bodies is None else bodies.dimension
    # scaled by hand: squares of 1e200 overflow, and such positions do occur
    groups = np.abs(q.reshape(len(q), q.shape[1] // width, width))
    scale = groups.max(axis=2, initial=0.0)
    safe = np.where((scale > 0) & np.isfinite(scale), scale, 1.0)
    return (safe * np.sqrt(((groups / safe[:, :, None]) ** 2).sum(axis=2))).max(axis=1)


POSITION = (
    "A position error is the largest distance of a body from where the 128-bit solution has it, relative to "
    "the largest distance of a body from the origin at the stored times of that solution. Without bodies all "
    "positions together are one vector."
)
"""The one definition, for every page that prints such an error."""


def position_error(problem: Problem, difference: Array, true: Array) -> Array:
    """Return position errors, shape (n,), as `POSITION` says.

    ``difference``, shape (n, dim), are states less the true ones; ``true``, shape (m, dim), the true states
    at all their stored times, which give the size.
    """
    size = float(largest_distance(problem, positions(problem, true)).max(initial=0.0))
    return largest_distance(problem, positions(problem, difference)) / (size or 1.0)


def _position_error(
    problem: Problem, t: Array, y: Array, reference: Reference | None
) -> tuple[Array, Array, Array]:
    if reference is None:
        return np.empty(0), np.empty(0), np.empty(0)
    _, ours, theirs = np.intersect1d(t, reference.t, return_indices=True)
    # the reference is a pair of doubles, so that its own rounding does not enter the difference
    difference = (y[ours] - reference.high[theirs]) - reference.low[theirs]
    error = position_error(problem, difference, reference.high)
    return t[ours], error, ahead(problem, t[ours], reference.high[theirs], difference)


def ahead(problem: Problem, t: Array, y: Array, difference: Array) -> Array:
    """Return how far in time a run is ahead: its difference from the reference along the field there.

    Positions and momenta are each measured in units of their largest value, so that turning
    points, where nothing moves, and the units of either do not matter.
    """
    field_ = emit.numpy(problem.system, "field")
    flow = np.array([field_(time, state, problem.par) for time, state in zip(t, y, strict=True)])
    flow = flow.reshape(y.shape)
    along, speed = np.zeros(len(t)), np.zeros(len(t))
    dof = problem.system.dof or problem.system.dim
    for block in (slice(0, dof), slice(dof, None)):
        size = float(np.abs(y[:, block]).max(initial=0.0)) or 1.0
        along += (difference[:, block] / size * (flow[:, block] / size)).sum(axis=1)
        speed += ((flow[:, block] / size) ** 2).sum(axis=1)
    return along / speed
