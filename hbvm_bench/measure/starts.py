"""Initial conditions near a problem's own: for the growth of errors, and for ensembles."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.campaign.entries import Ensemble
from hbvm_bench.campaign.grid import GOLDEN
from problems.errors import unknown
from problems.problem import Problem

Array = NDArray[np.float64]

PERTURBATION = 1e-6
"""Relative size of the changes of the initial conditions from which a growth is fitted."""


def scaled(problem: Problem, count: int) -> Array:
    """Return initial conditions for the growth of errors, shape (count, dim); the first is the problem's own.

    All positions are multiplied by one number and all momenta by another (a state without either: by one),
    both within `PERTURBATION` of 1: round-off decorrelates, and a start that is symmetric, at rest or
    in a plane stays so bit for bit. The numbers follow the golden ratio.
    """
    dim, dof = problem.system.dim, problem.system.dof or problem.system.dim
    number = np.arange(2 * count).reshape(count, 2)
    factors = 1.0 + PERTURBATION * (2.0 * ((number * GOLDEN) % 1.0) - 1.0)
    factors[0] = 1.0
    return problem.y0 * np.repeat(factors, [dof, dim - dof], axis=1)


def members(problem: Problem, asked: Ensemble) -> tuple[Array, Array]:
    """Return the initial conditions and the parameters of an ensemble, shapes (n, dim) and (n, n_par).

    The first is the problem's own. Every number of the start, and each parameter that varies, is
    multiplied by 1 + spread x, where x runs evenly through [-1, 1] in all of them together: the Weyl
    sequence of the root of x^(n+1) = x + 1. All numbers of a parameter that is a list are multiplied by one.

    Raises
    ------
    problems.errors.InputError
        For a parameter that the problem does not have.
    """
    system = problem.system
    places = system.unpack(np.arange(system.n_par, dtype=np.float64))
    x = _evenly(asked.count, system.dim + len(asked.vary))
    par = np.tile(problem.par, (asked.count, 1))
    for i, (name, spread) in enumerate(asked.vary, system.dim):
        if name not in places:
            raise unknown(f"parameter of {system.name}", name, places)
        par[:, np.atleast_1d(places[name]).astype(int)] *= 1.0 + spread * x[:, i : i + 1]
    return problem.y0 * (1.0 + asked.spread * x[:, : system.dim]), par


def changed(problem: Problem, start: Array, par: Array, t_end: float) -> Problem:
    """Return a problem with another start, other parameters and another end."""
    parameters: Any = problem.system.unpack(par)
    return problem.replace(y0=start, parameters=parameters, t_end=t_end)


def _evenly(count: int, dim: int) -> Array:
    """Return ``count`` points that fill [-1, 1]^dim evenly; the first is 0."""
    root = 1.5
    for _ in range(64):
        root = (1.0 + root) ** (1.0 / (dim + 1))
    steps = root ** -np.arange(1.0, dim + 1.0)
    return 2.0 * ((0.5 + np.arange(count)[:, None] * steps) % 1.0) - 1.0
