"""HBVM keeps the energy of every problem to rounding."""

import numpy as np
import pytest

import integrators
import problems
from problems import registry
from problems.analysis import structure

# A step at which HBVM(16, 8) resolves the problem, and the largest energy error measured in 400 steps.
STEPS = {
    "charged_particle": (0.2, 1e-15),
    "cluster": (0.05, 1e-15),
    "cr3bp": (0.0005, 4e-15),
    "diatomic": (0.2, 5e-15),
    "double_pendulum": (0.1, 6e-16),
    "figure_eight": (0.05, 5e-16),
    "fput": (0.5, 2e-16),
    "henon_heiles": (0.5, 1e-15),
    "kepler": (0.1, 2e-15),
    "lennard_jones": (2e-4, 2e-15),
    "lotka_volterra": (0.1, 1e-15),
    "morse": (0.2, 1e-15),
    "nonlinear_wave": (0.02, 1e-15),
    "outer_solar_system": (1.0, 5e-15),
    "pendulum": (0.2, 2e-15),
    "penning_trap": (0.2, 4e-15),
    "period_annulus": (0.2, 2e-15),
    "pythagorean": (0.0005, 2e-16),
    "rigid_body": (0.2, 2e-16),
    "sine_gordon": (0.2, 5e-16),
    "sitnikov": (0.1, 2e-15),
    "solar_system": (0.02, 5e-16),
    "spring_pendulum": (0.05, 2e-16),
    "stiff_chain": (0.02, 5e-15),
    "toda": (0.1, 3e-16),
}


def test_every_problem_has_a_step():
    own = {name for name in problems.names() if registry.factory(name).__module__.startswith("problems.")}
    assert own - {"expression"} == set(STEPS)


@pytest.mark.parametrize("name", STEPS)
def test_energy_stays_at_rounding(name):
    h, measured = STEPS[name]
    problem = problems.load(name)
    method = integrators.HBVM(k=16, s=8, h=h)
    found = integrators.integrate(problem, method, times=np.arange(0, 401, 10) * h)
    assert found.status.value == "finished", found.reason
    assert problem.errors(found.y)["energy"].max() <= 4 * measured
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
    k = structure.exact_k(structure.degree(problem.system, problem.par), 2)
    times = np.arange(0, 101) * h
    exact = integrators.integrate(problem, integrators.HBVM(k=k, s=2, h=h), times=times)
    less = integrators.integrate(problem, integrators.HBVM(k=k - 1, s=2, h=h), times=times)
    # Measured: at most 1.2e-15 with k nodes, at least 1.3e-11 (nonlinear_wave) with one less.
    assert problem.errors(exact.y)["energy"].max() <= 5e-15
    assert problem.errors(less.y)["energy"].max() >= 3e-12
