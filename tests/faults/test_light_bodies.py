"""Bodies that are lighter than others by many orders of magnitude are as accurate as they are."""

import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, integrate, integrate_many

MASSES = [1e-6, 1e-10, 1e-12, 1e-16, 1e-20]
METHODS = [HBVM(), HBVM(tol=1e-9), Gauss(s=6, tol=1e-12)]


def with_a_light_body(mass):
    """Return a star, a planet and a body of that mass on an eccentric orbit between them."""

    def energy(q, p, par, m):
        masses = (1.0, 1e-3, par.mass)
        kinetic = sum((p[2 * i] ** 2 + p[2 * i + 1] ** 2) / (2.0 * masses[i]) for i in range(3))
        potential = sum(
            masses[i] * masses[j] / m.sqrt((q[2 * i] - q[2 * j]) ** 2 + (q[2 * i + 1] - q[2 * j + 1]) ** 2)
            for i in range(3)
            for j in range(i)
        )
        return kinetic - potential

    system = problems.Hamiltonian(energy, dof=6, parameters={"mass": mass})
    p0 = [0.0, -1e-3, 0.0, 1e-3, -0.9 * mass, 0.0]
    return problems.Problem(system, q0=[0.0, 0.0, 1.0, 0.0, 0.0, 0.6], p0=p0, t_end=30.0)


def error(state, mass, truth):
    """Return the largest error of a position or a velocity of the light body."""
    scale = np.array([1.0, 1.0, mass, mass])
    return np.abs((state - truth)[[4, 5, 10, 11]] / scale).max()


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_errors_do_not_depend_on_how_light_a_body_is(method):
    found = []
    for mass in MASSES:
        problem = with_a_light_body(mass)
        truth = integrate(problem, Gauss(s=8, h=0.005)).y[-1]
        alone = integrate(problem, method)
        together = integrate_many(problem, method, starts=np.tile(problem.y0, (2, 1)))
        found.append(max(error(alone.y[-1], mass, truth), error(together.y[0, -1], mass, truth)))
    assert max(found) < 3e-12  # 2.6e-13; before 2.8e-10, 7.7e-7, 0.11 and 0.76 from 1e-10 to 1e-20
