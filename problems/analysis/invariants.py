"""Quantities along a solution, evaluated in double-double from the double states.

The result is rounded once, so that what is left is the integrator's error. Values that
pairs of doubles cannot hold are computed by `problems.evaluate.wide`.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from problems.calculus.function import Function
from problems.double_double import DD
from problems.errors import InputError, shown
from problems.evaluate.pairs import evaluate
from problems.systems.base import System
from problems.systems.lagrangian import Lagrangian
from problems.trace.graph import T

Array = NDArray[np.float64]

_SMALLEST, _LARGEST = 1e-270, 1e290  # sizes between which pairs of doubles have their 32 digits
_TINY = 1e-60  # a product of four states that are as large is not below the smallest double


def _states(system: System, y: ArrayLike | DD) -> DD:
    if isinstance(y, DD):
        return DD(_doubles(system, y.hi), _doubles(system, y.lo))
    return DD(_doubles(system, y))


def _doubles(system: System, y: ArrayLike) -> Array:
    try:
        states = np.asarray(y, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"states must be an array of numbers, not {shown(y)}.") from error
    if states.ndim not in (1, 2) or states.shape[-1] != system.dim:
        raise InputError(f"states must have the shape (n, {system.dim}), not {states.shape}.")
    return np.atleast_2d(states)


def _along(function: Function, par: Array, states: DD, t: ArrayLike | None) -> list[DD]:
    if t is None:
        if any(node.flags & T for node in function.roots):
            raise InputError(
                f"{function.name.split(':')[-1]} depends on time; give the times of the states as t=."
            )
        t = 0.0
    try:
        times = np.asarray(t, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"t must be {len(states.hi)} times, not {shown(t)}.") from error
    if times.ndim > 1 or (times.ndim == 1 and times.size != len(states.hi)):
        raise InputError(f"t must be {len(states.hi)} times, one per state, not of shape {times.shape}.")
    columns = DD(np.ascontiguousarray(states.hi.T), np.ascontiguousarray(states.lo.T))
    return evaluate(function, times, columns, par)


def invariants(system: System, par: Array, y: ArrayLike, t: ArrayLike | None) -> dict[str, Array]:
    """Return the invariants along states, see `problems.problem.Problem.invariants`."""
    states = _states(system, y)
    quantities: dict[str, Array] = {}
    for name, function in system.invariants.items():
        values = [value.rounded() for value in _along(function, par, states, t)]
        quantities[name] = np.stack(values, axis=1) if system.is_vector(name) else values[0]
    return quantities


def errors(
    system: System, par: Array, y: ArrayLike | DD, t: ArrayLike | None, *, start: tuple[float, Array | DD]
) -> dict[str, Array]:
    """Return how far the invariants are from those at ``start``, see `problems.problem.Problem.errors`."""
    from problems.evaluate import wide  # which loads mpmath

    states, begin = _states(system, y), _states(system, start[1])
    t0, y0 = start[0], begin.hi[0]
    by_name: dict[str, Array] = {}
    for name, function in system.invariants.items():
        first = _along(function, par, begin, t0)
        values = _along(function, par, states, t)
        gaps = np.stack([(now - before).rounded() for now, before in zip(values, first, strict=True)])
        size = np.array([value.rounded()[0] for value in first])
        largest = np.abs(size).max()
        unit = largest if 0.0 < largest < np.inf else 1.0  # so that no square under- or overflows
        with np.errstate(all="ignore"):
            errors = np.linalg.norm(gaps / unit, axis=0) / (np.linalg.norm(size / unit) or 1.0)
        before = [] if _SMALLEST <= largest <= _LARGEST else wide.evaluate(function, t0, y0, par)
        # A sum that rounding leaves at 0 is 0; what has become too small for doubles is not.
        lost = any(value != 0 and not _SMALLEST <= abs(value) <= _LARGEST for value in before)
        again = np.isfinite(states.hi).all(axis=1) & (lost | ~np.isfinite(errors))
        if again.any():
            times = np.broadcast_to(np.asarray(0.0 if t is None else t, dtype=np.float64), len(states.hi))
            before = before or wide.evaluate(function, t0, y0, par)
            for i in np.flatnonzero(again):
                errors[i] = wide.relative(wide.evaluate(function, float(times[i]), states.hi[i], par), before)
        by_name[name] = errors
    return by_name


def errors_since(
    system: System, par: Array, y: Array, t: Array, *, starts: tuple[Array, Array]
) -> dict[str, Array]:
    """Return how far the invariants are from those at the start of each state, relative as in `errors`.

    Parameters
    ----------
    system : System
    par : ndarray, shape (n_par, n)
        Parameters of each state, and of its start.
    y, t : ndarray, shapes (n, dim), (n,)
        States and times.
    starts : pair of ndarray, shapes (n,), (n, dim)
        Times and states that they are compared with.

    Returns
    -------
    dict of str to ndarray, shape (n,)
    """
    from problems.evaluate import wide  # which loads mpmath

    t0, y0 = starts
    states, begin = _states(system, y), _states(system, y0)
    tiny = (np.where(y0 == 0.0, 1.0, np.abs(y0)) < _TINY).any(axis=1)  # then an invariant may only seem 0
    by_name: dict[str, Array] = {}
    for name, function in system.invariants.items():
        first, values = _along(function, par, begin, t0), _along(function, par, states, t)
        gaps = np.stack([(now - before).rounded() for now, before in zip(values, first, strict=True)])
        size = np.stack([value.rounded() for value in first])
        largest = np.abs(size).max(axis=0)
        unit = np.where((largest > 0.0) & (largest < np.inf), largest, 1.0)
        with np.errstate(all="ignore"):
            whole = np.linalg.norm(size / unit, axis=0)
            errors = np.linalg.norm(gaps / unit, axis=0) / np.where(whole == 0.0, 1.0, whole)
        ordinary = (largest >= _SMALLEST) & (largest <= _LARGEST) | (largest == 0.0) & ~tiny
        again = np.isfinite(states.hi).all(axis=1) & ~(ordinary & np.isfinite(errors))
        for i in np.flatnonzero(again):
            before = wide.evaluate(function, float(t0[i]), y0[i], par[:, i])
            errors[i] = wide.relative(wide.evaluate(function, float(t[i]), y[i], par[:, i]), before)
        by_name[name] = errors
    return by_name


def guards(system: System, par: Array, y: ArrayLike, t: ArrayLike | None) -> dict[str, Array]:
    """Return the guards along states, see `problems.problem.Problem.guards`."""
    states = _states(system, y)
    return {
        name: np.abs(_along(function, par, states, t)[0].rounded())
        for name, function in system.guards.items()
    }


def _scale(system: System, par: Array) -> list[DD]:
    columns = par.shape[1] if par.ndim == 2 else 1
    return evaluate(system.function("velocity_scale"), 0.0, np.zeros((system.dim, columns)), par)


def velocity(system: System, par: Array, y: ArrayLike, t: ArrayLike | None) -> Array | None:
    """Return the velocities at states, see `problems.problem.Problem.velocity`."""
    states = _states(system, y)
    if isinstance(system, Lagrangian):
        return np.stack([value.rounded() for value in _along(system.velocity, par, states, t)], axis=1)
    if not system.separable or system.dof is None:
        return None
    momenta = states.hi[:, system.dof :]
    return np.stack([(c * momenta[:, i]).rounded() for i, c in enumerate(_scale(system, par))], axis=1)


def momentum(system: System, par: Array, t: float, q: Array, v: Array) -> Array:
    """Return the momenta p = v/c of a separable system, or dL/dv of a Lagrangian, each rounded once."""
    if isinstance(system, Lagrangian):
        state = np.concatenate([q, v])[:, np.newaxis]
        components = evaluate(system.momentum, t, state, par)
        return np.array([float(p.rounded()[0]) for p in components])
    if not system.separable:
        raise InputError(f"v0= needs constant masses, which {system.name} does not have; give p0=.")
    scale = _scale(system, par)
    if any(float(c.hi.ravel()[0]) == 0.0 for c in scale):
        raise InputError(f"H of {system.name} does not depend on every momentum; give p0= instead of v0=.")
    return np.array([float((DD(x) / c).rounded().ravel()[0]) for x, c in zip(v, scale, strict=True)])
