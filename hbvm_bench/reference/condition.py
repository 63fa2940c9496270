"""How far the end of a trajectory moves where a state on the way to it is rounded."""

from typing import Any

import numpy as np

from integrators import Gauss
from integrators.protocol import Array, Status
from problems.problem import Problem

METHOD = Gauss(s=12, tol=1e-14)
"""Symplectic, and so is the derivative of its steps, whose inverse then needs no solving."""


def conditions(problem: Problem, ends: Array, states: Array) -> Array | None:
    """Return the condition number of the positions at each of some times, to within a factor of about 2.

    The largest distance that a body at the end moves where every component of the state at one time, the
    worst between the start and the end, is changed by a small part u of itself, over u and over the largest
    distance of a body from the origin. Doubles round by u = 1.1e-16: a method that keeps nothing but doubles
    of the state cannot be relied on for less than the condition number times u.

    Parameters
    ----------
    problem : Problem
        A Hamiltonian system in canonical coordinates; ``None`` is returned for any other.
    ends : ndarray, shape (n,)
        The times, monotone from the start on.
    states : ndarray, shape (n, dim)
        The states there.

    Returns
    -------
    ndarray, shape (n,), or None

    Notes
    -----
    From each end the trajectory is followed back to the start, with the derivative B(t) of the state at t
    after that at the end. A change d at t moves the end by B(t)^-1 d. B is symplectic, so that
    B^-1 = -J B^T J: one matrix, where the product of one from the start to the end and of the inverse of one
    from the start to t cancels.
    """
    if problem.system.dof is None or not problem.system.traced:
        return None
    width = problem.system.bodies.dimension if problem.system.bodies is not None else problem.system.dof
    size = _lengths(states, problem.system.dof, width).max()
    return (
        np.array([_moved(problem, *pair, width) for pair in zip(ends.tolist(), states, strict=True)]) / size
    )


def _moved(problem: Problem, end: float, state: Array, width: int) -> float:
    """Return how far the position at the end moves at most, over the part of the state that is changed."""
    n, back = problem.system.dof or 0, np.array([problem.t0])
    program = METHOD.compile(problem.system)
    if end == problem.t0:
        return float(_lengths(state[None], n, width).max())
    steps = program.start(state, problem.par, end).advance(back, sample="steps").t
    stepper: Any = program.start(state, problem.par, end)  # with the capability `Variations`
    stepper.follow(np.eye(2 * n), np.zeros((problem.system.n_par, 2 * n)))
    samples = stepper.advance(np.concatenate([steps[steps != problem.t0], back]))
    B = stepper.variations
    if samples.status is not Status.FINISHED or B is None:
        return np.nan
    forward = np.concatenate([B[:, n:, n:].mT, -B[:, :n, n:].mT], axis=2)  # the upper half of B^-1
    by_body = np.linalg.norm(forward.reshape(len(B), -1, width, 2 * n), axis=2)
    return float((by_body * np.abs(samples.y[:, None, :])).sum(axis=2).max())


def _lengths(states: Array, n: int, width: int) -> Array:
    return np.linalg.norm(states[:, :n].reshape(len(states), -1, width), axis=2)
