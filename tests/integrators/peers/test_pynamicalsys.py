"""pynamicalsys' steps: their orders, what they refuse, and the midpoint rule beside ours.

Skipped where the library, which no extra installs, is missing; what is refused needs no library.
"""

import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, ImplicitMidpoint, Status, Yoshida4, integrate

PROBLEM = problems.load("henon_heiles", energy=0.125, q2=0.1, t_end=8.0)
DRIVEN = problems.Problem(
    problems.Hamiltonian(lambda q, p, t, m: p[0] ** 2 / 2 - m.cos(q[0]) - 0.3 * q[0] * m.sin(2 * t), dof=1),
    q0=[0.2],
    p0=[1.0],
    t_end=8.0,
)
LORENZ = problems.Problem(
    problems.VectorField(
        lambda y: [10 * (y[1] - y[0]), y[0] * (28 - y[2]) - y[1], y[0] * y[1] - 8 * y[2] / 3], dim=3
    ),
    y0=[1.0, 2.0, 20.0],
    t_end=8.0,
)


@pytest.mark.parametrize(("method", "order"), [(Yoshida4, 4), (ImplicitMidpoint, 2)])
def test_errors_fall_with_the_order(method, order):
    truth = integrate(PROBLEM, HBVM(), [8.0]).y[-1]
    long, short = (np.abs(integrate(PROBLEM, method(h=h), [8.0]).y[-1] - truth).max() for h in (0.1, 0.05))
    assert np.log2(long / short) == pytest.approx(order, abs=0.05)  # measured 3.9988 and 1.9977
    assert method(h=0.1).order == order


@pytest.mark.parametrize("name", ["henon_heiles", "double_pendulum"])
def test_the_midpoint_rule_is_gauss_of_one_stage(name):
    problem = problems.load(name, t_end=2.0)
    methods = ImplicitMidpoint(h=0.02), Gauss(s=1, h=0.02)
    ends = [integrate(problem, method, [2.0]).y[-1] for method in methods]
    assert np.abs(ends[0] - ends[1]).max() < 1e-10  # measured 2.7e-14 for Hénon–Heiles


def test_steps_that_newton_s_iteration_does_not_solve_are_a_status(capfd):
    solution = integrate(PROBLEM, ImplicitMidpoint(h=4.0, max_iter=1), [8.0])
    assert solution.status is Status.NOT_FINITE
    assert "did not converge" in capfd.readouterr().out


@pytest.mark.parametrize(
    ("method", "problem", "reason"),
    [
        (Yoshida4, problems.load("double_pendulum"), "separable"),
        (Yoshida4, DRIVEN, "take no time"),
        (ImplicitMidpoint, DRIVEN, "take no time"),
        (ImplicitMidpoint, LORENZ, "needs a Hamiltonian"),
    ],
)
def test_what_its_functions_cannot_express_is_refused(method, problem, reason):
    assert reason in method(h=0.1).accepts(problem)
