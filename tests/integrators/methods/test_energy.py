"""What is conserved, and what is not: the line integral's threshold k >= nu s / 2 is sharp."""

import itertools
import math

import numpy as np
import pytest

import integrators
from integrators import HBVM, Gauss
from integrators.methods.automatic import exact_k
from problems import Hamiltonian, Problem


@pytest.mark.parametrize(
    ("nu", "s", "k"),
    [(5, 2, 5), (5, 3, 8), (5, 5, 13), (2, 4, 4), (1, 3, 3), (3, 2, 3), (4, 1, 2), (18, 2, 18)],
)
def test_k_is_half_the_degree_times_s_and_at_least_s(nu, s, k):
    assert exact_k(nu, s) == k


def polynomial(degree):
    """One degree of freedom, not separable, with terms of all degrees up to the last."""

    def H(q, p):
        top, mixed = q[0], p[0]
        for _ in range(degree - 1):
            top = top * q[0]
        for _ in range(degree - 2):
            mixed = mixed * q[0]
        return (p[0] * p[0] + q[0] * q[0]) / 2 + top / degree + mixed / 3

    # The cubic well is shallow: a start at rest stays inside.
    p0 = 0.0 if degree == 3 else 0.3
    return Problem(Hamiltonian(H, dof=1, name=f"degree_{degree}"), q0=[0.3], p0=[p0], t_end=100.0)


# (degree, s, h): large enough for a visible defect, O(h^{2k+1}), of one node too few, and still contracting.
SHARP = [
    (3, 1, 1.0), (4, 1, 1.0), (5, 1, 1.0), (6, 1, 1.0), (3, 2, 1.5), (4, 2, 1.5), (5, 2, 1.5), (6, 2, 1.5),
    (3, 3, 2.0), (4, 3, 2.0), (5, 3, 2.5), (6, 3, 2.5), (4, 4, 2.5),
]  # fmt: skip


@pytest.mark.parametrize(("degree", "s", "h"), SHARP)
def test_polynomial_energy_is_conserved_from_the_threshold_on_and_not_below(degree, s, h):
    problem = polynomial(degree)
    enough = math.ceil(degree * s / 2)
    assert enough > s
    times = np.arange(41) * h

    def energies(k):
        solution = integrators.integrate(problem, HBVM(k=k, s=s, h=h), times)
        assert solution.status == "finished", solution.reason
        return solution

    for k in (enough, enough + 1, 2 * enough):
        assert energies(k).errors()["energy"].max() < 5e-14  # measured 1.6e-14 at most
    steps = np.abs(np.diff(energies(enough - 1).invariants()["energy"]))
    assert steps.max() > 1e-10  # measured 1.4e-9 (degree 6, s = 3) and more


@pytest.mark.parametrize("s", [1, 2, 3, 5])
def test_gauss_keeps_quadratic_invariants_and_hbvm_does_not(s, kepler):
    problem, times = kepler(0.4), np.arange(0.0, 60.1, 0.3)
    gauss = integrators.integrate(problem, Gauss(s=s, h=0.1), times).errors()
    hbvm = integrators.integrate(problem, HBVM(k=20, s=s, h=0.1), times).errors()
    assert gauss["angular_momentum"].max() < 5e-15  # measured 4.3e-16
    assert hbvm["energy"].max() < 1e-14  # measured 1.6e-15
    if s < 5:  # at s = 5 both reach rounding
        assert gauss["energy"].max() > 1e-9  # measured 1.5e-2, 9.4e-6, 2.0e-8
        assert hbvm["angular_momentum"].max() > 1e-9  # measured 3.6e-3, 3.0e-6, 2.2e-9


def test_energy_that_is_not_polynomial_is_conserved_in_practice_once_k_is_large():
    def H(q, p, m):
        return p[0] * p[0] / 2 - m.cos(q[0])

    problem = Problem(Hamiltonian(H, dof=1, name="pendulum"), q0=[0.0], p0=[1.9], t_end=200.0)
    times = np.arange(0.0, 200.0, 0.8)
    errors = [
        integrators.integrate(problem, HBVM(k=k, s=2, h=0.8), times).errors()["energy"].max()
        for k in (2, 3, 4, 6, 8, 12, 16)
    ]
    assert all(after < before / 5 for before, after in itertools.pairwise(errors[:5]))
    # Measured 3.0e-3, 2.7e-5, 2.3e-7, 5.6e-12, then 1.8e-15, 2.4e-15, 2.5e-15.
    assert max(errors[4:]) < 1e-14


def test_partial_steps_have_the_energy_of_steps_and_the_polynomial_has_not(henon_heiles):
    method = HBVM(k=6, s=4, h=1.0)  # 6 = 3 * 4 / 2
    between = np.arange(0.5, 50.0, 1.0)
    partial = integrators.integrate(henon_heiles, method, between, "partial").errors()["energy"]
    dense = integrators.integrate(henon_heiles, method, between, "dense").errors()["energy"]
    assert partial.max() < 5e-15  # measured 2.8e-16
    assert dense.max() > 1e-6  # measured 6.7e-5


def test_energy_stays_at_round_off_over_a_hundred_thousand_steps(henon_heiles):
    solution = integrators.integrate(henon_heiles, HBVM(k=6, s=4, h=0.5), np.arange(0.0, 50001.0, 50.0))
    assert solution.stats.steps == 100_000
    # Measured 3.8e-13: 3.8e-18 a step, from the rounding of the coefficients to one double each.
    assert solution.errors()["energy"].max() < 1e-12
