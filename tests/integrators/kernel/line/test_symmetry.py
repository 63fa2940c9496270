"""Forth and back: a symmetric method returns to its start."""

import numpy as np
import pytest

import integrators
import problems
from integrators import HBVM, LineIntegral

METHODS = [
    LineIntegral(k=12, s=4, h=0.1, invariants=["energy", "angular_momentum"]),
    LineIntegral(k=8, s=2, h=0.1, invariants=["energy", "angular_momentum", "lenz[1]"]),
    LineIntegral(k=6, s=1, h=0.1, invariants=["energy"]),
]


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_forth_and_back_is_the_start(method):
    problem = problems.load("kepler", e=0.6)
    stepper = method.compile(problem.system).start(problem.y0, problem.par)
    there = stepper.advance([10.0])
    stepper.advance([0.0])
    assert stepper.t == 0.0
    # At s = 1 the way there is wrong by 0.3; the way back undoes it.
    assert np.abs(stepper.y - problem.y0).max() <= 2e-12  # measured 6.1e-16 to 2.6e-13
    assert np.abs(there.y[-1] - problem.y0).max() > 0.1


def test_reversed_momenta_retrace_the_orbit():
    problem = problems.load("kepler", e=0.6)
    flip = np.array([1.0, 1.0, -1.0, -1.0])
    times = np.arange(0, 10.05, 0.1)
    forth = integrators.integrate(problem, METHODS[0], times)
    program = METHODS[0].compile(problem.system)
    back = program.start(forth.y[-1] * flip, problem.par).advance(times)
    assert np.abs(back.y[::-1] * flip - forth.y).max() <= 1e-13  # measured 9.0e-16


def test_a_poisson_system_is_retraced_too():
    problem = problems.load("lotka_volterra")
    method = HBVM(k=8, s=2, h=0.1)
    stepper = method.compile(problem.system).start(problem.y0, problem.par)
    stepper.advance([20.0])
    stepper.advance([0.0])
    assert np.abs(stepper.y - problem.y0).max() <= 5e-13  # measured 8.9e-15
