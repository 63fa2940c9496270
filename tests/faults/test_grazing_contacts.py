"""Contacts that begin and end between two nodes of a step, which no node shows."""

import numpy as np
import pytest

from integrators import HBVM, Gauss, integrate
from problems import Hamiltonian, Problem, VectorField

from .search.references import piecewise_oscillator

SPRING = VectorField(
    lambda y, par, m: [y[1], -y[0] - m.where(y[0] > par.gap, par.k * (y[0] - par.gap), 0)],
    dim=2, parameters={"gap": 0.0, "k": 1.0}, name="contact",
)  # fmt: skip
MANY = 40


def energy(q, p, par, m):
    """Return that of oscillators beside springs, each the same: a loop that is kept."""
    overlap = m.sum(lambda i: m.where(q[i] > par.gap, q[i] - par.gap, 0) ** 2, range(MANY))
    return m.sum(lambda i: (p[i] ** 2 + q[i] ** 2) / 2, range(MANY)) + par.k / 2 * overlap


BESIDE_EACH_OTHER = Hamiltonian(energy, dof=MANY, parameters={"gap": 0.0, "k": 1.0})


def reference(end, gap, k):
    return np.ravel(
        piecewise_oscillator(np.array([end]), 0.0, [-1.0, 0.0], [gap], [1.0, 1.0 + k], [0.0, k * gap])
    )


def drawn(n, seed):
    """Return overlaps of amplitude 1 with a spring, its stiffness, and ends."""
    rng = np.random.default_rng(seed)
    return zip(
        10.0 ** rng.uniform(-4.0, -1.0, n),
        10.0 ** rng.uniform(0.0, 4.0, n),
        rng.uniform(5.0, 30.0, n),
        strict=True,
    )


@pytest.mark.parametrize(
    "method", [HBVM(), HBVM(k=8, s=7, tol=1e-12), HBVM(tol=1e-6), Gauss(s=6, tol=1e-12)], ids=repr
)
def test_a_contact_between_two_nodes_is_seen(method):
    # Silently wrong before: 2, 4, 5 and 0 of these 40, by up to 6.2e-4, 4.6e-3 and 8.1e-3.
    for depth, k, end in drawn(40, 7):
        problem = Problem(SPRING, y0=[-1.0, 0.0], parameters={"gap": 1.0 - depth, "k": k}, t_end=end)
        solution = integrate(problem, method, [end])
        error = np.abs(solution.y[-1] - reference(end, 1.0 - depth, k)).max()
        assert solution.warnings or error < 1e-6, (depth, k, end, error)


def test_a_contact_of_one_term_of_a_sum_is_seen():
    depth, k, end = 3e-5, 1e3, 6.5  # before: silently wrong by 3e-4 in both
    q = np.linspace(-0.7, 0.7, MANY)
    q[17] = -1.0
    problem = Problem(
        BESIDE_EACH_OTHER, q0=q, p0=np.zeros(MANY), parameters={"gap": 1.0 - depth, "k": k}, t_end=end
    )
    for method in (HBVM(), HBVM(k=8, s=7, tol=1e-12)):
        solution = integrate(problem, method, [end])
        assert solution.stats.extra["kinks"], method
        found = solution.y[-1][[17, MANY + 17]]
        assert np.abs(found - reference(end, 1.0 - depth, k)).max() < 1e-9, method


def test_what_comes_near_a_surface_and_does_not_touch_it_costs_nothing():
    # Distances of 1e-9 to 1e-2 of the amplitude; the same steps as without the spring.
    for gap in 1.0 + 10.0 ** np.linspace(-9.0, -2.0, 8):
        problem = Problem(SPRING, y0=[-1.0, 0.0], parameters={"gap": gap, "k": 1e3}, t_end=20.0)
        solution = integrate(problem, HBVM(), [20.0])
        assert solution.warnings == ()
        assert solution.stats.rejections <= 1, gap
