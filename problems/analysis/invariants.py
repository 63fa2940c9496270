"""Quantities along a solution, evaluated in double-double from the double states.

The result is rounded once, so that what is left is the integrator's error.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from problems.derive.function import Function
from problems.double_double import DD
from problems.errors import InputError, shown
from problems.evaluate.pairs import evaluate
from problems.graph.nodes import T
from problems.systems.base import System
from problems.systems.constrained import Constrained
from problems.systems.lagrangian import Lagrangian

Array = NDArray[np.float64]


def as_states(system: System, y: ArrayLike | DD) -> DD:
    """Return states as pairs of doubles, shape (n, dim)."""
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


def along(function: Function, par: Array, states: DD, t: ArrayLike | None) -> list[DD]:
    """Return the outputs of a function at states (n, dim), shape (n,) each."""
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
    states = as_states(system, y)
    quantities: dict[str, Array] = {}
    for name, function in system.invariants.items():
        values = [value.rounded() for value in along(function, par, states, t)]
        quantities[name] = np.stack(values, axis=1) if system.is_vector(name) else values[0]
    return quantities


def guards(system: System, par: Array, y: ArrayLike, t: ArrayLike | None) -> dict[str, Array]:
    """Return the guards along states, see `problems.problem.Problem.guards`."""
    states = as_states(system, y)
    return {
        name: np.abs(along(function, par, states, t)[0].rounded()) for name, function in system.guards.items()
    }


def multipliers(system: System, par: Array, y: ArrayLike, t: ArrayLike | None) -> Array | None:
    """Return the multipliers at states, see `problems.problem.Problem.multipliers`."""
    if not isinstance(system, Constrained):
        return None
    found = along(system.multipliers, par, as_states(system, y), t)
    return np.stack([value.rounded() for value in found], axis=1)


def _scale(system: System, par: Array) -> list[DD]:
    columns = par.shape[1] if par.ndim == 2 else 1
    return evaluate(system.function("velocity_scale"), 0.0, np.zeros((system.dim, columns)), par)


def velocity(system: System, par: Array, y: ArrayLike, t: ArrayLike | None) -> Array | None:
    """Return the velocities at states, see `problems.problem.Problem.velocity`."""
    states, system = as_states(system, y), getattr(system, "free", system)
    if isinstance(system, Lagrangian):
        return np.stack([value.rounded() for value in along(system.velocity, par, states, t)], axis=1)
    if not system.separable or system.dof is None:
        return None
    momenta = states.hi[:, system.dof :]
    return np.stack([(c * momenta[:, i]).rounded() for i, c in enumerate(_scale(system, par))], axis=1)


def momentum(system: System, par: Array, t: float, q: Array, v: Array) -> Array:
    """Return the momenta p = v/c of a separable system, or dL/dv of a Lagrangian, each rounded once."""
    system = getattr(system, "free", system)
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
