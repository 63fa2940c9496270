"""Checkpoints given to a stepper that they are not of."""

from dataclasses import dataclass

import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, LineIntegral, registry
from integrators.protocol import MethodBase
from tests.faults.fault import Fault, is_met

KEPLER = problems.load("kepler")
TWIN = problems.Problem(  # of the same dimension
    problems.Hamiltonian(
        lambda q, p, m: (p[0] * p[0] + p[1] * p[1] + q[0] * q[0] + q[1] * q[1]) / 2, dof=2, name="springs"
    ),
    q0=[1.0, 0.0],
    p0=[0.0, 1.0],
    t_end=10.0,
)
WEIGHTED = problems.Problem(
    problems.Hamiltonian(
        lambda q, p, par, m: p[0] * p[0] / (2 * par.m) - par.g * m.cos(q[0]),
        dof=1,
        parameters={"m": 1.0, "g": 1.0},
        name="weight",
    ),
    q0=[1.0],
    p0=[0.0],
    t_end=10.0,
)


def start(method, problem=KEPLER, par=None):
    stepper = method.compile(problem.system).start(problem.y0, problem.par if par is None else par)
    stepper.advance([0.3])
    return stepper


@dataclass(frozen=True)
class Case:
    """A method, and the same with another option."""

    method: MethodBase
    changed: MethodBase

    def __str__(self):
        return repr(self.method)


CASES = [
    Case(HBVM(k=4, s=2, h=0.1), HBVM(k=4, s=2, h=0.2)),
    Case(HBVM(k=4, s=2, h=0.1, solver="newton"), HBVM(k=4, s=2, h=0.1)),
    Case(HBVM(k=4, s=2, tol=1e-6), HBVM(k=4, s=2, h=0.1)),
    Case(HBVM(k=4, s=2, h=0.1), HBVM(k=4, s=2, tol=1e-6)),
    Case(Gauss(s=2, h=0.1), Gauss(s=3, h=0.1)),
    Case(
        LineIntegral(k=4, s=2, tol=1e-6, invariants=["energy"]),
        LineIntegral(k=4, s=2, h=0.1, invariants=["energy"]),
    ),
    Case(registry.create("DOP853", rtol=1e-6, atol=1e-6), registry.create("DOP853", rtol=1e-8, atol=1e-6)),
    Case(registry.create("WHFast", h=0.1), registry.create("WHFast", h=0.05)),
]
ANYWHERE = [case for case in CASES if not isinstance(case.method, LineIntegral)]


def refused(name, stepper, checkpoint, says):
    """Assert that the refusal is one sentence, and that the stepper is where it was."""
    t, y = stepper.t, stepper.y
    is_met(Fault(name, lambda: stepper.restore(checkpoint), says))
    assert stepper.t == t
    assert np.array_equal(stepper.y, y)


@pytest.mark.parametrize("case", CASES, ids=str)
@pytest.mark.parametrize("garbage", [None, (), 3.5, "a checkpoint", {}], ids=repr)
def test_what_is_no_checkpoint(case, garbage):
    problem = bodies() if type(case.method).__name__ == "WHFast" else KEPLER
    refused("garbage", start(case.method, problem), garbage, f"not a {type(garbage).__name__}: give it")


@pytest.mark.parametrize("case", CASES, ids=str)
def test_other_options(case):
    problem = bodies() if type(case.method).__name__ == "WHFast" else KEPLER
    other = start(case.changed, problem).checkpoint()
    refused("options", start(case.method, problem), other, "belongs to another method or system: .*, not")


@pytest.mark.parametrize("case", ANYWHERE[:-1], ids=str)
def test_another_system_of_the_same_dimension(case):
    other = start(case.method, TWIN).checkpoint()
    refused("system", start(case.method), other, "on springs, not .* on kepler")


class Rate:
    def __init__(self, k):
        self.k = k

    def field(self, t, y):
        return [self.k * y[0]]


@pytest.mark.parametrize(
    "make", [lambda k: Rate(k).field, lambda k: lambda t, y: [k * y[0]]], ids=["method", "closure"]
)
def test_another_field_of_the_same_name_that_is_not_traced(make):
    growing, falling = (
        problems.Problem(problems.Opaque(make(k), dim=1, name="rate"), y0=[1.0], t_end=1.0)
        for k in (1.0, -5.0)
    )
    other = start(CASES[0].method, growing).checkpoint()
    refused("field", start(CASES[0].method, falling), other, "on rate, not .* on rate as it is defined here")


@pytest.mark.parametrize("case", ANYWHERE, ids=str)
def test_other_parameters(case):
    problem = bodies() if type(case.method).__name__ == "WHFast" else WEIGHTED
    other = start(case.method, problem, problem.par * 2.0).checkpoint()
    says = "belongs to other parameters of .*: start a stepper with the same parameters"
    refused("parameters", start(case.method, problem), other, says)


@pytest.mark.parametrize("case", CASES, ids=str)
def test_one_of_another_program_of_the_same_method_is_taken(case):
    problem = bodies() if type(case.method).__name__ == "WHFast" else KEPLER
    one, other = start(case.method, problem), start(case.method, problem)
    kept = one.checkpoint()
    expected = one.advance([0.7]).y
    other.advance([0.5])
    other.restore(kept)
    assert np.array_equal(other.advance([0.7]).y, expected)


def bodies():
    return problems.load("outer_solar_system")
