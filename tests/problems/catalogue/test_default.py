"""HBVM that chooses everything itself keeps the energy of every problem to rounding."""

import numpy as np
import pytest

import integrators
import problems
from problems import registry
from problems.problem import Problem

# The largest energy error measured over the whole span of the problem with HBVM().
MEASURED = {
    "charged_particle": 7e-15,
    "cluster": 3e-16,
    "cr3bp": 9e-15,
    "diatomic": 9e-15,
    "double_pendulum": 2e-15,
    "expression": 2e-15,
    "figure_eight": 2e-15,
    "fput": 2e-16,
    "henon_heiles": 3e-14,
    "kepler": 7e-15,
    "lennard_jones": 2e-15,
    "lotka_volterra": 4e-15,
    "morse": 2e-15,
    "nonlinear_wave": 2e-16,
    "outer_solar_system": 5e-15,
    "pendulum": 4e-15,
    "penning_trap": 7e-14,
    "period_annulus": 1e-13,
    "pythagorean": 3e-13,
    "rigid_body": 3e-15,
    "sine_gordon": 2e-16,
    "sitnikov": 1e-14,
    "solar_system": 1e-15,
    "spring_pendulum": 1e-15,
    "stiff_chain": 3e-14,
    "toda": 2e-15,
}
# At t = 15.8 two bodies come within 4e-4. Coordinates of size 1 give that distance to 13 digits, and the
# energy between the two is then thousands of times the total: 9e-11 of it is what doubles leave.
BEFORE_THE_ENCOUNTER = 15.0


def default(name: str) -> Problem:
    """Return a problem as the catalogue has it; two are changed, as little as it takes."""
    if name == "expression":
        return problems.load(name, H="p^2/2 + k*q^4/4", q0=[1.0], p0=[0.0], parameters="k=2")
    if name == "pythagorean":
        return problems.load(name, t_end=BEFORE_THE_ENCOUNTER)
    return problems.load(name)


def test_every_problem_is_here():
    own = {name for name in problems.names() if registry.factory(name).__module__.startswith("problems.")}
    assert own == set(MEASURED)


@pytest.mark.parametrize("name", MEASURED)
def test_the_default_keeps_the_energy_at_rounding(name):
    problem = default(name)
    found = integrators.integrate(problem, times=np.linspace(problem.t0, problem.t_end, 201))
    assert isinstance(found.method, integrators.HBVM)
    assert found.method == integrators.HBVM()
    assert not found.status.failed, found.reason
    assert found.errors()["energy"].max() <= 4 * MEASURED[name]
