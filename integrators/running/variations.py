"""Tangent vectors at the start of a trajectory, from what a user asks for."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from integrators.protocol import Array, MethodBase, Variations, offers
from integrators.refusals import as_numbers
from problems import emit
from problems.errors import InputError, shown, unknown
from problems.problem import Problem

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
    names = [wanted] if isinstance(wanted, str) else wanted
    if not (isinstance(names, Sequence) and names and all(isinstance(name, str) for name in names)):
        vectors = as_numbers("variations", wanted)
        if vectors.ndim != 2 or vectors.shape[0] != system.dim or vectors.shape[1] == 0:
            raise InputError(
                f"variations of shape {vectors.shape} must be vectors of {system.dim} components each, "
                f"({system.dim}, n), or names such as ['y0']."
            )
        if not np.isfinite(vectors).all():
            raise InputError(f"variations={shown(wanted)} must be finite.")
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
            slope = emit.numpy(system, "field")(problem.t0, problem.y0, problem.par)
            state, parameter = -slope[:, np.newaxis], np.zeros((system.n_par, 1))
        else:
            parameter = np.eye(system.n_par)[:, known[name]]
            state = np.zeros((system.dim, parameter.shape[1]))
        states.append(state)
        parameters.append(parameter)
    return np.concatenate(states, axis=1), np.concatenate(parameters, axis=1)


def places(problem: Problem) -> dict[str, slice]:
    """Return where each parameter lies in the parameter vector."""
    found, end = {}, 0
    for name, value in problem.system.parameters.items():
        start, end = end, end + np.size(value)
        found[name] = slice(start, end)
    return found


def follow(
    stepper: Any, method: MethodBase, problem: Problem, wanted: Any, sample: str | None
) -> tuple[Array, Array]:
    """Let the vectors that are wanted follow a trajectory at its start; return them, as `directions` does.

    Raises
    ------
    problems.errors.InputError
        If the method cannot, and as `directions`.
    """
    if not offers(stepper, Variations):
        raise InputError(
            f"{method!r} has no variations: it does not offer the stages of its steps; use Gauss or HBVM."
        )
    if sample == "dense":
        raise InputError("variations are those of solved steps, which sample='dense' is not; use 'partial'.")
    state, parameters = directions(problem, wanted)
    stepper.follow(state, parameters)
    return state, parameters
