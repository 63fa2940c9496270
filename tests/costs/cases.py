"""Fifteen problems whose cost is recorded, and how it is counted: no clock, so that any machine can tell."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import problems
from hbvm_bench.studies.general import brusselator, decay_chain, diffusion, hires, lorenz
from integrators import HBVM, Gauss, integrate
from integrators.protocol import Status
from problems import Problem
from tests.hbvm_bench.study_folders import module

lattice = module("costs", "lattice").lattice

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
