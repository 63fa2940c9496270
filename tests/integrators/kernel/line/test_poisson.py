"""Poisson systems: the energy by HBVM's own equations, Casimirs too by a line integral method."""

import numpy as np
import pytest

import integrators
import problems
from integrators import HBVM, Gauss, LineIntegral

STEPS = 1000


def errors_of(problem, method):
    times = np.linspace(0.0, STEPS * method.h, STEPS + 1)
    solution = integrators.integrate(problem, method, times)
    assert solution.status == "finished", solution.reason
    return {name: error.max() for name, error in solution.errors().items()}


@pytest.fixture
def lotka_volterra():
    return problems.load("lotka_volterra")


@pytest.fixture
def rigid_body():
    """With a quartic energy, which no Gauss method keeps."""
    return problems.load("rigid_body", quartic=1.0)


def test_lotka_volterra(lotka_volterra):
    gauss = errors_of(lotka_volterra, Gauss(s=2, h=0.1))
    assert gauss["energy"] > 1e-4  # measured 3.8e-4
    assert gauss["casimir"] > 1e-4  # measured 1.3e-3
    plain = errors_of(lotka_volterra, HBVM(k=16, s=2, h=0.1))
    assert plain["energy"] <= 1e-14  # measured 5.0e-16
    assert plain["casimir"] > 1e-4  # measured 1.5e-3
    both = errors_of(lotka_volterra, LineIntegral(k=16, s=2, h=0.1, invariants=["energy", "casimir"]))
    assert both["energy"] <= 1e-14  # measured 7.3e-17
    assert both["casimir"] <= 1e-15  # measured 5.5e-17


def test_rigid_body_with_a_quartic_energy(rigid_body):
    gauss = errors_of(rigid_body, Gauss(s=2, h=0.2))
    assert gauss["energy"] > 1e-7  # measured 9.6e-7
    assert gauss["casimir"] <= 1e-14  # measured 4.9e-16: it is quadratic
    plain = errors_of(rigid_body, HBVM(k=4, s=2, h=0.2))
    assert plain["energy"] <= 1e-14  # measured 3.8e-16
    assert plain["casimir"] > 1e-8  # measured 4.5e-7
    both = errors_of(rigid_body, LineIntegral(k=4, s=2, h=0.2, invariants=["energy", "casimir"]))
    assert both["energy"] <= 1e-14  # measured 2.0e-16
    assert both["casimir"] <= 1e-14  # measured 1.9e-16


def test_with_k_equal_to_s_hbvm_is_gauss(lotka_volterra):
    times = np.linspace(0.0, 10.0, 101)
    states = [
        integrators.integrate(lotka_volterra, method, times).y
        for method in (HBVM(k=3, s=3, h=0.1), Gauss(s=3, h=0.1))
    ]
    assert np.abs(states[0] - states[1]).max() <= 1e-13  # measured 1.8e-15


def test_a_canonical_system_written_as_a_poisson_system_is_the_same():
    canonical = problems.load("henon_heiles")

    def H(y):
        kinetic = (y[2] * y[2] + y[3] * y[3]) / 2
        return kinetic + (y[0] * y[0] + y[1] * y[1]) / 2 + y[0] * y[0] * y[1] - y[1] * y[1] * y[1] / 3

    def B(y):
        return [[0, 0, 1, 0], [0, 0, 0, 1], [-1, 0, 0, 0], [0, -1, 0, 0]]

    poisson = problems.Problem(problems.Poisson(H, B, dim=4), y0=canonical.y0, t_end=20.0)
    times = np.linspace(0.0, 20.0, 81)
    states = [integrators.integrate(p, HBVM(k=4, s=2, h=0.25), times).y for p in (canonical, poisson)]
    assert np.abs(states[0] - states[1]).max() <= 1e-13  # measured 5e-15


def test_the_threshold_of_k_is_that_of_the_degree(rigid_body):
    # grad H of degree 3 along a polynomial of degree 2: B and the line integral are exact from k = 4 on.
    errors = [errors_of(rigid_body, HBVM(k=k, s=2, h=0.2))["energy"] for k in (3, 4)]
    assert errors[0] > 1e-11  # measured 7.1e-10
    assert errors[1] <= 1e-14
