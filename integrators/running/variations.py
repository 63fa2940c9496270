"""Tangent vectors at the start of a trajectory, from what a user asks for."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from integrators.protocol import Array, MethodBase, Variations, offers
from problems import targets
from problems.errors import InputError, shown, unknown
from problems.problem import Problem, System
from problems.quantities import plain_numbers

START, TIME = "y0", "t0"


def directions(problem: Problem, wanted: Any) -> tuple[Array, Array]:
    """Return the parts of tangent vectors in the state, (dim, n), and in the parameters, (n_par, n).

    Parameters
    ----------
    problem : Problem
        Whose start and parameters they are at.
    wanted : array_like, shape (dim, n), or str, or sequence of str
        The vectors, or what to differentiate with respect to: ``"y0"``, ``"t0"``, names of parameters.

    Raises
    ------
    problems.errors.InputError
        For vectors of another length, and names of nothing.
    """
    system = problem.system
    names = _names(wanted)
    if names is None:
        vectors = _vectors(system, wanted)
        return vectors, np.zeros((system.n_par, vectors.shape[1]))
    if not system.traced:
        raise InputError(f"variations of {system.name} need a formula; its field is code.")
    known = {name: np.arange(system.n_par)[part] for name, part in places(problem).items()}
    states, parameters = [], []
    for name in names:
        if name not in (START, TIME, *known):
            raise unknown("variation", name, (START, TIME, *known))
        if name == START:
            state, parameter = np.eye(system.dim), np.zeros((system.n_par, system.dim))
        elif name == TIME:
            slope = _slope(problem, problem.y0, problem.par)
            state, parameter = -slope[:, np.newaxis], np.zeros((system.n_par, 1))
        else:
            parameter = np.eye(system.n_par)[:, known[name]]
            state = np.zeros((system.dim, parameter.shape[1]))
        states.append(state)
        parameters.append(parameter)
    return np.concatenate(states, axis=1), np.concatenate(parameters, axis=1)


def directions_of_each(problem: Problem, wanted: Any, starts: Array, par: Array) -> tuple[Array, Array]:
    """Return the same of many trajectories, shapes (count, dim, n) and (count, n_par, n).

    Parameters
    ----------
    problem : Problem
        Of which trajectories they are.
    wanted : array_like, shape (dim, n) or (count, dim, n), or str, or sequence of str
        The vectors of all or of each, or names, as for `directions`.
    starts, par : ndarray, shapes (count, dim), (count, n_par)
        Where the trajectories start, and their parameters.

    Raises
    ------
    problems.errors.InputError
        As `directions`, and for vectors of another number of trajectories.
    """
    system, count, names = problem.system, len(starts), _names(wanted)
    if names is None and plain_numbers("variations", wanted).ndim == 3:
        vectors = _vectors(system, wanted, count)
        return vectors, np.zeros((count, system.n_par, vectors.shape[2]))
    state, parameters = directions(problem, wanted)
    states = np.tile(state, (count, 1, 1))
    if names is not None and TIME in names:  # all else is the same wherever it starts
        widths = [directions(problem, name)[0].shape[1] for name in names]
        ends = np.cumsum(widths)
        slopes = np.array([_slope(problem, *each) for each in zip(starts, par, strict=True)])
        for name, end in zip(names, ends.tolist(), strict=True):
            if name == TIME:
                states[:, :, end - 1] = -slopes
    return states, np.tile(parameters, (count, 1, 1))


def _names(wanted: Any) -> list[str] | None:
    """Return names that are given, or ``None`` for vectors."""
    names = [wanted] if isinstance(wanted, str) else wanted
    given = isinstance(names, Sequence) and names and all(isinstance(name, str) for name in names)
    return list(names) if given else None


def _vectors(system: System, wanted: Any, *count: int) -> Array:
    """Return vectors that are given, of one trajectory, or of each of ``count``."""
    vectors = plain_numbers("variations", wanted)
    shape = (*count, system.dim)
    if vectors.ndim != len(shape) + 1 or vectors.shape[:-1] != shape or vectors.shape[-1] == 0:
        whose = f" of {count[0]} trajectories" if count else ""
        raise InputError(
            f"variations of shape {vectors.shape} must be vectors of {system.dim} components each{whose}, "
            f"({', '.join(map(str, shape))}, n), or names such as ['y0']."
        )
    if not np.isfinite(vectors).all():
        raise InputError(f"variations={shown(wanted)} must be finite.")
    return vectors


def _slope(problem: Problem, y0: Array, par: Array) -> Array:
    """Return the field at the start, shape (dim,)."""
    return targets.numpy(problem.system, "field")(problem.t0, y0, par)


def places(problem: Problem) -> dict[str, slice]:
    """Return where each parameter lies in the parameter vector."""
    slices, end = {}, 0
    for name, value in problem.system.parameters.items():
        start, end = end, end + np.size(value)
        slices[name] = slice(start, end)
    return slices


def follow(
    stepper: Any, method: MethodBase, problem: Problem, wanted: Any, sample: str | None
) -> tuple[Array, Array]:
    """Let the vectors that are wanted follow a trajectory at its start; return them, as `directions` does.

    Raises
    ------
    problems.errors.InputError
        If the method cannot, and as `directions`.
    """
    check(stepper, method, sample)
    state, parameters = directions(problem, wanted)
    stepper.follow(state, parameters)
    return state, parameters


def check(stepper: Any, method: MethodBase, sample: str | None) -> None:
    """Refuse a method whose steppers have no variations, and samples that have none.

    Raises
    ------
    problems.errors.InputError
        With what to use.
    """
    if not offers(stepper, Variations):
        raise InputError(
            f"{method!r} has no variations: it does not offer the stages of its steps; use Gauss or HBVM."
        )
    if sample == "dense":
        raise InputError("variations are those of solved steps, which sample='dense' is not; use 'partial'.")
