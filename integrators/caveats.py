"""What a method cannot see, as sentences for `Solution.warnings`: the same for every method."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from problems.analysis import deviations
from problems.analysis.structure import has_kinks, switches_in_time
from problems.analysis.tables import states_beyond
from problems.graph.nodes import T
from problems.problem import Problem, System
from problems.targets.leaving import leaves_range

FEWEST = 4  # nodes whose coefficients can show a discontinuity
ENOUGH = 8  # nodes with which a smooth field is not taken for one with a discontinuity

LOST = 1e-8
"""Relative change of a conserved quantity that a warning tells.

Measured on the 24 problems of the catalogue that arrive, to t = 300, with ``HBVM()``, ``HBVM(tol=1e-8)`` and
``HBVM(tol=1e-4)``: at most 2.4e-14, but for the Pythagorean problem's close encounters (1.3e-10).
"""

LOST_BY_ANY = 0.1
"""The same for what a method does not conserve: an invariant that has changed so much is lost.

What is as large is no matter of accuracy; below it a method that conserves nothing may drift without a
warning. ``tests/faults/test_lost_invariants.py`` looks for false warnings.
"""

PER_STEP = 10.0
"""Times tolerance and number of steps that the change may be where nothing bounds the quadrature error.

Measured there with ``HBVM(k=8, s=7, tol=1e-12)``: at most 0.1.
"""

FEW_DIGITS = 1e-12
"""Part of its terms that a line integral may lose before that is told.

Near a singular position of a linkage rounding is amplified: 70 random ones lost 4e-14 of the terms at most.
"""

LOOKED_AT = 2000  # states of a solution, or of all of an ensemble, at which conserved quantities are compared

TINY = 1e-280
"""Size of a start below which the digits that a step adds have no normal double.

Measured on an oscillator, to t = 10, with ``HBVM(k=8, s=6, tol=1e-12)``: errors of 1e-14 of the amplitude
down to 1e-270, 7e-12 at 1e-283, 4e-6 at 1e-290, 0.3 at 1e-300.
"""

Array = NDArray[np.float64]


def warnings(
    problem: Problem,
    start: Array,
    par: Array,
    end: Array | None,
    caveat: str | None,
    extra: Mapping[str, Any],
) -> tuple[str, ...]:
    """Return the sentences on discontinuities, lost invariants, too small a start, and units.

    Parameters
    ----------
    problem : Problem
        What was integrated.
    start, par : ndarray, shapes (dim,) and (n_par,)
        From where, and with which parameters.
    end : ndarray, shape (dim,), optional
        The last state known.
    caveat : str or None
        What the method says of the problem.
    extra : mapping
        `integrators.protocol.Stats.extra` of the trajectory.
    """
    discontinuities, implicit = extra.get("kinks"), extra.get("implicit")
    if caveat is None and not discontinuities and implicit and implicit["steps"]:
        caveat = undetected_in_time(
            problem, f"discontinuities are not detected in its {implicit['steps']} Newton steps"
        )
    said = () if caveat is None else (caveat,)
    if 0.0 < (size := float(np.abs(start).max(initial=0.0))) < TINY:
        said += (
            f"the start is as small as {size:.1e}, where doubles have too few digits; take other units.",
        )
    elif any(
        leaves_range(problem.system, problem.t0, state, par) for state in (start, end) if state is not None
    ):
        said += (
            "numbers that the field is calculated from are beyond the range of doubles, though the state "
            "is not: errors may have any size; take other units.",
        )
    said += tuple(
        f"{name} has lost {change / size:.1e} of the size of its terms, first in the step at t = {first!r}: "
        "its line integral needs more nodes, or it is no invariant where the stages are; raise k, or shorten "
        "the steps."
        for name, (first, change, size) in extra.get("lost", {}).items()
        if change > FEW_DIGITS * size
    )
    if not discontinuities:
        return said
    t, h = discontinuities[0]
    place = f"between t = {t!r} and {t + h!r}" if h else f"at t = {t!r}"
    return (
        *said,
        "the right-hand side or one of its derivatives is discontinuous "
        f"(places recorded: {len(discontinuities)}, the first {place}): steps were "
        "cut there, and what lies between two nodes may have been missed; give breakpoints where the "
        "times are known.",
    )


Losses = dict[str, tuple[float, float]]
"""By the name of what is conserved: the first time at which it had changed, and its error there."""


def lost_invariants(
    system: System, conserved: Mapping[str, float], starts: Array, times: Array, states: Array,
    par: Array, steps: NDArray[np.int64],
) -> list[Losses]:  # fmt: skip
    """Return, for each of n trajectories, the invariants that are lost.

    Lost is one that the method conserves and that has changed by more than rounding and its steps explain
    (`LOST`, `PER_STEP`), and any other that has changed by a tenth of the size of its terms (`LOST_BY_ANY`).

    Parameters
    ----------
    system : System
        What was integrated.
    conserved : mapping of str to float
        What the method conserves, see `integrators.protocol.MethodBase.conserved`.
    starts : ndarray, shape (n, dim)
        Where they began.
    times, states : ndarray, shapes (m,) or (n, m), and (n, m, dim)
        Where they came; NaN where a trajectory did not arrive. The last state, and some before it: two
        thousand in all.
    par : ndarray, shape (n, n_par)
        Parameters.
    steps : ndarray of int, shape (n,)
        Steps taken.
    """
    losses: list[Losses] = [{} for _ in par]
    constant = [
        name for name, function in system.invariants.items() if not any(r.flags & T for r in function.roots)
    ]
    if not constant or not times.size:
        return losses
    every = -(-states.shape[1] // max(1, LOOKED_AT // len(par)))
    times = np.broadcast_to(times, states.shape[:2])[:, ::-1][:, ::every][:, ::-1].reshape(-1)
    states = states[:, ::-1][:, ::every][:, ::-1]
    owner = np.repeat(np.arange(len(par)), states.shape[1])
    limit = np.array(
        [
            np.maximum(LOST, PER_STEP * conserved[name] * steps)
            if name in conserved
            else np.full(len(par), LOST_BY_ANY)
            for name in constant
        ]
    )[:, owner]
    flat = states.reshape(owner.size, -1)
    errors = deviations.errors(system, par.T, flat, None, starts=(0.0, starts), owner=owner, names=constant)
    for name, most in zip(constant, limit, strict=True):
        above = np.flatnonzero((errors[name] > most) & np.isfinite(errors[name]))
        for number in np.unique(owner[above]):
            its = above[owner[above] == number]
            worst = its[np.argmax(errors[name][its])]
            by_rounding = _by_rounding(system, name, par[number], flat[owner == number], flat[worst])
            if errors[name][worst] > by_rounding * (1.0 + np.sqrt(steps[number])):
                losses[number][name] = float(times[its[0]]), float(errors[name][its[0]])
    return losses


def _by_rounding(system: System, name: str, par: Array, states: Array, state: Array) -> float:
    """Return how far an invariant moves, relative to its terms, when each component is rounded once.

    Where all its terms are what rounding left, as the rate of a rod that nothing moves, that is 1 or more. A
    component is rounded by the largest of its kind in all states: the positions, or the momenta.
    """
    sizes, dof = np.fmax.reduce(np.abs(states), axis=0), system.dof
    for part in (slice(None),) if dof is None else (slice(dof), slice(dof, None)):
        sizes[part] = sizes[part].max()
    moved = state + np.diag(sizes * np.finfo(np.float64).eps)
    return float(
        deviations.errors(system, par, moved, None, starts=(0.0, state[np.newaxis]), names=[name])[name].sum()
    )


def expected(system: System, conserved: Mapping[str, float]) -> Mapping[str, float]:
    """Return what is held to rounding: what the method conserves, and what constraints demand of all."""
    return {**({"constraints": 0.0} if system.on_manifold else {}), **conserved}


def of_losses(losses: Losses, conserved: Mapping[str, float]) -> tuple[str, ...]:
    """Return the sentences on invariants that are lost, by a method that conserves some of them."""
    return tuple(
        f"{name} has changed by {error:.1e} relative to its terms (first seen at t = {t!r})"
        + (
            ", though the method conserves it: the field may have a pulse or a bump that is narrower than "
            "the steps; give breakpoints or max_step."
            if name in conserved
            else ", as the method does not conserve constraints; use HBVM(), or shorter steps."
            if name == "constraints"
            else ": it is lost, and the trajectory with it; give a smaller tolerance or step."
        )
        for name, (t, error) in losses.items()
    )


def of_atol(problem: Problem, atol: Any, start: Array, y: Array) -> tuple[str, ...]:
    """Return the sentence on an absolute tolerance above all positions, all momenta, or the whole state.

    Parameters
    ----------
    problem : Problem
        What was integrated.
    atol : float or sequence of float, optional
        The method's.
    start, y : ndarray, shapes (dim,) and (n, dim)
        States.
    """
    if atol is None or not np.any(atol):
        return ()
    sizes = np.fmax.reduce(np.abs(np.concatenate([start[np.newaxis], y])), axis=0)
    allowed, dof = np.broadcast_to(np.asarray(atol, dtype=np.float64), sizes.shape), problem.system.dof
    parts = {"the state": slice(None)} if dof is None else {"all q": slice(dof), "all p": slice(dof, None)}
    return tuple(
        f"atol={float(allowed[part].min())!r} is above the size of {name}, {float(sizes[part].max()):.1e} at "
        "most: errors there have any size; give an atol far below it, or take other units."
        for name, part in parts.items()
        if sizes[part].max() > 0.0 and (sizes[part] < allowed[part]).all()
    )


def of_tables(
    system: System, par: Array, t: Array, y: Array, start: tuple[float, Array] | None = None
) -> tuple[str, ...]:
    """Return the sentence on a table that has no data at a start, or at a state; see `states_beyond`."""
    if start is not None:
        t, y = np.append(start[0], t), np.concatenate([start[1][np.newaxis], y])
    left = next(filter(None, states_beyond(system, par, t, y)), None)
    if left is None:
        return ()
    t_, x, first, last = left
    return (
        f"at t = {t_!r} the argument of m.table is {x:.6g}, beyond its data from {first!r} to {last!r}: the "
        "outer piece was extrapolated; give more points, or m.table(..., extrapolate=True).",
    )


def undetected(problem: Problem, why: str | None) -> str | None:
    """Return the sentence on a field with discontinuities that a method does not look for, if it is one.

    Parameters
    ----------
    problem : Problem
        What is integrated; a system that is not traced cannot be asked whether it has discontinuities.
    why : str or None
        Why the method does not see them; ``None`` where it does.
    """
    if why is None or not problem.system.traced or not has_kinks(problem.system):
        return None
    return (
        f"its field has m.abs, m.round or m.where, and {why}: steps go over a discontinuity with any error, "
        "and the run ends as finished."
    )


def undetected_in_time(problem: Problem, why: str | None) -> str | None:
    """As `undetected`, by steps with a tolerance, which formulas tell where they switch in the state."""
    return undetected(problem, why) if problem.system.traced and switches_in_time(problem.system) else None


def detects_discontinuities(k: int, system: System) -> bool:
    """Whether steps with k nodes look for discontinuities.

    With few nodes a smooth field now and then looks like one with a discontinuity. So with few nodes
    discontinuities are looked for only where the traced field is known to have some.
    """
    return k >= ENOUGH or (k >= FEWEST and system.traced and has_kinks(system))


def unknown_discontinuities(
    problem: Problem, k: int | None, tol: float | None, breakpoints: Sequence[float]
) -> str | None:
    """Return the sentence on a field that is not traced and has too few nodes to detect discontinuities.

    Nothing is said where the user gives breakpoints, or a fixed step.
    """
    if problem.system.traced or tol is None or k is None or k >= ENOUGH or breakpoints:
        return None
    return (
        f"its field is a function that is not traced, in which k={k} nodes do not tell a discontinuity from "
        f"a smooth change: if it has some, give breakpoints or k >= {ENOUGH}."
    )


def why_undetected(k: int | None, tol: float | None, solver: str) -> str | None:
    """Return why HBVM(k, s) with these options does not look for discontinuities; ``None`` where it does.

    Where k is chosen, it is large enough.
    """
    if tol is None:
        return "fixed steps are not cut there"
    if solver in ("newton", "blended"):
        return f"discontinuities are not detected with solver={solver!r}"
    if k is not None and k < FEWEST:
        return f"k={k} nodes do not tell a discontinuity from a smooth field"
    return None
