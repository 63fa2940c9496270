"""HBVM keeps the energy of every problem to rounding."""

import numpy as np
import pytest

import integrators
import problems
from integrators.methods.automatic import exact_k
from problems import registry
from problems.analysis import structure


@pytest.mark.parametrize("name", registry.built_in())
def test_energy_stays_at_rounding(name):
    expected = registry.entry(name).expected
    problem = problems.load(name)
    method = integrators.HBVM(k=16, s=8, h=expected.h)
    found = integrators.integrate(problem, method, times=np.arange(0, 401, 10) * expected.h)
    assert found.status.value == "finished", found.reason
    assert problem.errors(found.y)["energy"].max() <= 4 * expected.energy
    for name, guard in problem.guards(found.y).items():
        assert (guard == 0.0).all(), name


@pytest.mark.parametrize(
    ("name", "h"),
    [
        ("henon_heiles", 1.0),
        ("period_annulus", 0.5),
        ("nonlinear_wave", 0.05),
        ("penning_trap", 0.2),
        ("fput", 0.5),
    ],
)
def test_polynomial_energies_need_k_of_half_the_degree_times_s(name, h):
    problem = problems.load(name)
    k = exact_k(structure.degree(problem.system, problem.par), 2)
    times = np.arange(0, 101) * h
    exact = integrators.integrate(problem, integrators.HBVM(k=k, s=2, h=h), times=times)
    less = integrators.integrate(problem, integrators.HBVM(k=k - 1, s=2, h=h), times=times)
    # Measured: at most 1.2e-15 with k nodes, at least 1.3e-11 (nonlinear_wave) with one less.
    assert problem.errors(exact.y)["energy"].max() <= 5e-15
    assert problem.errors(less.y)["energy"].max() >= 3e-12
