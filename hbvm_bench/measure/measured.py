"""From what a worker returned to what is measured on it, by pure functions: errors, guards, distances."""

import math
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.campaign.entries import Checks, Ensemble
from hbvm_bench.measure import drift
from hbvm_bench.measure.starts import members
from hbvm_bench.reference.solutions import Reference
from hbvm_bench.store.records import Compile, Counters, ErrorGrowth, Result, Timing
from integrators.protocol import Status
from problems import targets
from problems.analysis import deviations
from problems.problem import Problem

Array = NDArray[np.float64]
Series = dict[str, Array]
NOTHING = partial(np.empty, 0)

PLAIN = ("t", "y", "distance", "position_t", "position", "phase")
PREFIXES = {"errors": "error.", "guards": "guard.", "drift": "drift.", "extra": "extra."}
"""What of a `Measured` is drawn: by its own name, and by that of each with a prefix."""


@dataclass(frozen=True)
class Measured:
    """Everything that a metric may look at."""

    problem: Problem
    t: Array  # of the samples, shape (n,)
    y: Array  # shape (n, dim)
    reference: Reference | None  # the trusted solution, where there is one
    complete: bool  # whether the end time was reached
    t_stop: float
    # of the invariants by name, relative where that has a meaning, shape (n,)
    errors: dict[str, Array] = field(default_factory=dict)
    guards: dict[str, Array] = field(default_factory=dict)  # what a symmetry keeps at exactly zero, (n,)
    distance: Array = field(
        default_factory=NOTHING
    )  # largest of a body (or of q) from the origin, shape (n,)
    position_t: Array = field(default_factory=NOTHING)  # times of the reference that were reached, shape (m,)
    position: Array = field(default_factory=NOTHING)  # the error of the position there
    # how far in time the run is ahead of the reference along its trajectory
    phase: Array = field(default_factory=NOTHING)
    counters: Counters = field(default_factory=Counters)
    compile: Compile | None = None
    timing: Timing | None = None
    # of an ensemble more than one: ``y`` has the end of each, and its errors are those against its own start
    trajectories: int = 1
    peak_gib: float | None = None  # largest resident memory of the process
    growth: dict[str, ErrorGrowth] = field(default_factory=dict)  # how the error of each invariant grows
    # what that was fitted to: ``t`` of shape (n,), and the errors by invariant, of shape (starts, n)
    drift: dict[str, Array] = field(default_factory=dict)
    reversal: float | str = "not asked for"  # distance from the start after integrating there and back
    # MEGNO, the exponent and its interval by the names of `hbvm_bench.measure.chaos`, or why there is none
    chaos: dict[str, Array | str] = field(default_factory=dict)
    extra: dict[str, Array] = field(default_factory=dict)

    def series(self) -> dict[str, Array]:
        """Return the arrays that figures are drawn from, and tables of series made."""
        arrays = {name: getattr(self, name) for name in PLAIN}
        for field_, prefix in PREFIXES.items():
            arrays |= {f"{prefix}{name}": values for name, values in getattr(self, field_).items()}
        return arrays


def measure(
    problem: Problem,
    result: Result,
    series: Series,
    reference: Reference | None = None,
    timing: Timing | None = None,
    *,
    ensemble: Ensemble | None = None,
) -> Measured:
    """Evaluate everything that does not judge on what a worker returned; see `hbvm_bench.measure.raw`.

    ``reference`` is the trusted solution, where there is one; an ensemble brings its own.
    """
    t, y = series["t"], series["y"]
    measured = Measured(
        problem=problem,
        t=t,
        y=y,
        reference=reference,
        complete=result.status == Status.FINISHED,
        t_stop=math.nan if result.t_stop is None else result.t_stop,
        counters=result.counters,
        compile=result.compile,
        timing=timing,
        trajectories=result.trajectories,
        peak_gib=result.peak_gib,
        reversal=_reversal(problem, result, series),
        chaos={**result.chaos, **_named(series, "chaos.")},
        extra=_named(series, "extra."),
    )
    # an overflow is a result here: it becomes a sentence in the metrics
    with np.errstate(all="ignore"):
        of_all = {
            "distance": largest_distance(problem, positions(problem, y)),
            "guards": {name: np.asarray(v, float) for name, v in problem.guards(y, t).items()},
        }
        if ensemble is not None:
            return replace(measured, **of_all, **_of_ensemble(problem, ensemble, series))
        errors = {name: np.asarray(values, float) for name, values in problem.errors(y, t).items()}
        position_t, position, phase = _position_error(problem, t, y, reference)
    return replace(
        measured,
        **of_all,
        errors=errors,
        position_t=position_t,
        position=position,
        phase=phase,
        drift=_drift(problem, series),
    )


def with_growth(measured: Measured, asked: Checks) -> Measured:
    """Return what was measured with the growth of each invariant's error, where a campaign asks for them."""
    if not asked.starts:
        return measured
    if not measured.complete:
        unknown = ErrorGrowth(why=f"the trajectory ends at t = {measured.t_stop:.4g}", starts=1)
        return replace(measured, growth=dict.fromkeys(measured.problem.system.invariants, unknown))
    rows = {name: values for name, values in measured.drift.items() if name != "t"}
    growth = {
        name: drift.fit(measured.drift["t"], values, signed=name == "energy")
        if values.shape[1]
        else ErrorGrowth(why="no samples")
        for name, values in rows.items()
    }
    return replace(measured, growth=growth)


def _named(series: Series, prefix: str) -> Series:
    return {name.removeprefix(prefix): v for name, v in series.items() if name.startswith(prefix)}


def _reversal(problem: Problem, result: Result, series: Series) -> float | str:
    if "reversal.y" not in series:
        return result.reversal.why
    with np.errstate(all="ignore"):
        return float(largest_distance(problem, positions(problem, series["reversal.y"] - problem.y0))[0])


def _drift(problem: Problem, series: Series) -> Series:
    """Return the errors that a growth is fitted to, shape (starts, n), and their times since the start."""
    if "starts.y0" not in series:
        return _named(series, "drift.")  # of a report, which has these errors instead of the states
    t = np.abs(series["t"] - problem.t0)
    starts = [problem.y0, *series["starts.y0"]]
    states = [series["y"], *series["starts.y"]]
    each = [_signed(problem, start, series["t"], y) for start, y in zip(starts, states, strict=True)]
    errors = {name: np.stack([errors_[name] for errors_ in each])[:, t > 0.0] for name in each[0]}
    return {"t": t[t > 0.0], **errors} if errors else {}


def _signed(problem: Problem, start: Array, t: Array, y: Array) -> Series:
    """Return the errors against the values at ``start``, the energy's with their sign, shape (n,) each."""
    starts = problem.t0, start
    errors = deviations.errors(problem.system, problem.par, y, t, starts=starts, signed=True)
    return {name: values if name == "energy" else np.abs(values) for name, values in errors.items()}


def _of_ensemble(problem: Problem, ensemble: Ensemble, series: Series) -> dict[str, Any]:
    """Return what differs of an ensemble: each trajectory's errors are against its own start."""
    starts, par = members(problem, ensemble)
    begins, owner = (problem.t0, starts), np.arange(len(starts))
    errors = deviations.errors(problem.system, par.T, series["y"], problem.t_end, starts=begins, owner=owner)
    if "witness.index" not in series:
        return {"errors": errors}
    high, low = series["witness.high"], series["witness.low"]
    gap = (series["y"][series["witness.index"].astype(int)] - high) - low
    t = np.full(len(gap), problem.t_end)
    return {
        "errors": errors,
        "position_t": t,
        "position": np.sort(position_error(problem, gap, high)),  # the last is the largest
        "phase": np.sort(np.abs(ahead(problem, t, high, gap))),
        "reference": Reference(t, high, low, {}),
    }


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
    later = t[ours] != problem.t0  # at the start every run is right
    ours, theirs = ours[later], theirs[later]
    # the reference is a pair of doubles, so that its own rounding does not enter the difference
    difference = (y[ours] - reference.high[theirs]) - reference.low[theirs]
    error = position_error(problem, difference, reference.high)
    return t[ours], error, ahead(problem, t[ours], reference.high[theirs], difference)


def ahead(problem: Problem, t: Array, y: Array, difference: Array) -> Array:
    """Return how far a run is ahead in time: its difference from the reference along the vector field.

    Positions and momenta are each measured in units of their largest value, so that turning
    points, where nothing moves, and the units of either do not matter.
    """
    field_ = targets.numpy(problem.system, "field")
    flow = np.array([field_(time, state, problem.par) for time, state in zip(t, y, strict=True)])
    flow = flow.reshape(y.shape)
    along, speed = np.zeros(len(t)), np.zeros(len(t))
    dof = problem.system.dof or problem.system.dim
    for block in (slice(0, dof), slice(dof, None)):
        size = float(np.abs(y[:, block]).max(initial=0.0)) or 1.0
        along += (difference[:, block] / size * (flow[:, block] / size)).sum(axis=1)
        speed += ((flow[:, block] / size) ** 2).sum(axis=1)
    return along / speed
