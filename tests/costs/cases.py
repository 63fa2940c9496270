"""Fifteen problems whose cost is recorded, and how it is counted: no clock, so that any machine can tell."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import problems
from hbvm_bench.campaign.shipped.general import brusselator, decay_chain, diffusion, hires, lorenz
from integrators import HBVM, Gauss, integrate
from integrators.protocol import Status
from problems import Problem

RECORDED = Path(__file__).with_name("recorded.json")
"""The counts, which ``python -m tests.costs.record`` rewrites."""


@dataclass(frozen=True)
class Case:
    """A problem and the methods whose cost on it is recorded.

    Attributes
    ----------
    problem : callable
        Makes the problem; its ``t_end`` is the interval.
    methods : tuple of HBVM or Gauss
        What integrates it.
    """

    problem: Callable[[], Problem]
    methods: tuple[Any, ...]


def _catalogue(name: str, **options: Any) -> Callable[[], Problem]:
    return lambda: problems.load(name, **options)


CHOSEN = (HBVM(), HBVM(tol=1e-9), HBVM(tol=1e-6), HBVM(tol=1e-3))
PROJECTED = HBVM(tol=1e-6, projection="energy")

CASES = {
    "kepler": Case(
        _catalogue("kepler", e=0.6, t_end=300.0),
        (*CHOSEN, PROJECTED, HBVM(k=8, s=7, tol=1e-6), Gauss(s=8, h=0.1)),
    ),
    "kepler09": Case(_catalogue("kepler", e=0.9, t_end=300.0), CHOSEN),
    "henon_heiles": Case(
        _catalogue("henon_heiles", energy=0.125, q2=0.1, t_end=400.0), (*CHOSEN, Gauss(s=8, h=0.5))
    ),
    "outer_solar_system": Case(
        _catalogue("outer_solar_system", t_end=600.0),
        (*CHOSEN, PROJECTED, Gauss(s=8, h=1.0), HBVM(k=16, s=8, h=2.0)),
    ),
    "sitnikov": Case(_catalogue("sitnikov", e=0.75, t_end=200.0), (*CHOSEN, HBVM(k=12, s=4, h=0.1))),
    "pendulum": Case(_catalogue("pendulum", t_end=300.0), CHOSEN),
    "double_pendulum": Case(
        _catalogue("double_pendulum", q1=0.5, q2=0.7, t_end=100.0), (*CHOSEN, HBVM(k=8, s=4, h=0.1))
    ),
    "cr3bp": Case(_catalogue("cr3bp"), CHOSEN),
    "fput": Case(_catalogue("fput", t_end=100.0), (*CHOSEN, HBVM(k=8, s=4, h=0.2))),
    "lattice": Case(lambda: lattice(400), (HBVM(), HBVM(k=8, s=4, h=0.1))),
    "decays": Case(decay_chain, (HBVM(), HBVM(tol=1e-6))),
    "diffusion": Case(lambda: diffusion(51), (HBVM(), HBVM(tol=1e-6))),
    "hires": Case(hires, (HBVM(), HBVM(tol=1e-6))),
    "lorenz": Case(lorenz, (HBVM(), HBVM(tol=1e-6))),
    "brusselator": Case(brusselator, (HBVM(), HBVM(tol=1e-6))),
}


def lattice(n: int, t_end: float = 10.0) -> Problem:
    """Return the discrete nonlinear Schroedinger equation on a ring of n places, from a rough start."""

    def energy(q, p, m):
        hops = m.sum(lambda i: q[i] * q[i + 1] + p[i] * p[i + 1], range(n - 1))
        squares = m.sum(lambda i: (q[i] ** 2 + p[i] ** 2) ** 2, range(n))
        return hops + q[n - 1] * q[0] + p[n - 1] * p[0] - squares / 4

    system = problems.Hamiltonian(energy, dof=n, name=f"lattice_{n}")
    return Problem(
        system,
        y0=0.5 * np.random.default_rng(1).standard_normal(2 * n),
        t_end=t_end,
        title=f"lattice of {n} places",
    )


def counted(name: str) -> dict[str, dict[str, int]]:
    """Return the counts of a case's methods, each by its text."""
    problem = CASES[name].problem()
    costs = {}
    for method in CASES[name].methods:
        solution = integrate(problem, method, [problem.t_end])
        assert solution.status is Status.FINISHED, (name, method, solution.reason)
        stats = solution.stats
        costs[repr(method)] = {
            "steps": stats.steps,
            "iterations": stats.iterations,
            "evaluations": stats.evaluations,
        }
    return costs


def recorded() -> dict[str, Any]:
    """Return the counts on record."""
    return json.loads(RECORDED.read_text("utf-8"))
