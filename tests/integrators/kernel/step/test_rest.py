"""Starts at rest: what happens later is seen, and errors have a size to be relative to."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import erf

from integrators import HBVM, Gauss, LineIntegral, integrate, integrate_many
from problems import Problem, VectorField
from problems.errors import InputError

METHODS = [HBVM(), HBVM(k=8, s=7, tol=1e-12), Gauss(s=8, tol=1e-12)]
PULSE = np.sqrt(np.pi)
GROWN = [3.5789247666305486, 2248.668818421065, 3255045678022011.0]  # by quadrature with 40 digits
CASES = {
    "oscillator": (lambda t, y, m: [y[1], -y[0] + m.exp(-((t - 5) ** 2))], [0.0, 0.0], 15.0,
                   [-0.7509604564200418, -1.1582446449788493]),
    "pulse": (lambda t, y, m: [m.exp(-((t - 5) ** 2))], [0.0], 15.0, [PULSE / 2 * (erf(10) + erf(5))]),
    "late pulse": (lambda t, y, m: [m.exp(-((t - 50) ** 2))], [0.0], 100.0, [PULSE]),
    "growth": (lambda t, y, m: [y[0] / m.cosh(t - 15) ** 2], [1.0], 30.0, [np.exp(2 * np.tanh(15.0))]),
    "power": (lambda t, y, m: [21 * t**20], [0.0], 1.0, [1.0]),
    "ramp": (lambda t, y, m: [(t / 3) ** 15], [0.0], 3.0, [3 / 16]),
    "switch": (lambda t, y, m: [-y[0] + m.tanh(4 * (t - 5)) + 1], [0.0], 10.0, [1.986171412]),
}  # fmt: skip


@pytest.mark.parametrize("method", METHODS, ids=str)
@pytest.mark.parametrize("name", CASES)
def test_what_begins_after_a_start_at_rest_is_seen(name, method):
    f, start, end, exact = CASES[name]
    problem = Problem(VectorField(f, dim=len(start)), y0=start, t_end=end)
    for times in ([end], np.linspace(0.0, end, 101)):
        solution = integrate(problem, method, times)
        assert solution.status.name == "FINISHED"
        assert np.abs(solution.y[-1] - exact).max() < 2e-9  # 6e-10, of the numbers written here
    many = integrate_many(problem, method, starts=[start] * 2, times=[end])
    assert np.abs(many.y[:, -1] - exact).max() < 2e-9


def test_an_equilibrium_takes_few_steps():
    system = VectorField(lambda t, y, m: [y[1], -m.sin(y[0])], dim=2)
    solution = integrate(Problem(system, y0=[0.0, 0.0], t_end=1e6), HBVM(), [1e6])
    assert not solution.y.any()
    assert solution.stats.steps < 40  # 21


def test_an_absolute_tolerance_bounds_the_steps_and_is_checked():
    problem = Problem(VectorField(lambda y: [y[1], -y[0]], dim=2), y0=[1e-9, 0.0], t_end=20.0)
    steps = [
        integrate(problem, HBVM(k=8, s=6, tol=1e-12, atol=a), [20.0]).stats.steps
        for a in (0.0, 1e-13, [1e-13] * 2)
    ]
    assert steps[0] > steps[1] == steps[2]
    for wrong in (-1.0, "x", [], [1.0, -1.0], float("nan")):
        with pytest.raises(InputError, match="atol"):
            HBVM(tol=1e-8, atol=wrong)
    with pytest.raises(InputError, match="atol has 3 numbers"):
        integrate(problem, HBVM(tol=1e-8, atol=[1.0] * 3), [1.0])
    with pytest.raises(InputError, match="atol with a tolerance only"):
        LineIntegral(k=4, s=2, h=0.1, atol=1e-8, invariants=["energy"])


def test_what_is_reached_later_does_not_spoil_what_comes_first_where_errors_grow():
    # Rounding of tanh + 1 is all there is at first; e^35 is reached. By that size 13 % were wrong.
    f = VectorField(lambda t, y, m: [y[0] + m.tanh(4 * (t - 5)) + 1], dim=1)
    solution = integrate(Problem(f, y0=[0.0], t_end=40.0), HBVM(), [6.0, 12.0, 40.0])
    assert solution.status.name == "FINISHED"
    assert np.abs(solution.y[:, 0] / GROWN - 1.0).max() < 1e-12  # 8e-16


def test_no_later_growth_spoils_a_smooth_start_at_rest():
    # exp(t) - 1 to e^60; nothing has to be known of that.
    f = VectorField(lambda y: [y[0] + 1.0], dim=1)
    times = np.array([1e-3, 1.0, 20.0, 60.0])
    for method in METHODS:
        solution = integrate(Problem(f, y0=[0.0], t_end=60.0), method, times)
        assert np.abs(solution.y[:, 0] / np.expm1(times) - 1.0).max() < 1e-9


@pytest.mark.parametrize("method", [HBVM(max_steps=8000), Gauss(s=6, tol=1e-12, max_steps=8000)], ids=str)
@pytest.mark.parametrize("s", [0.8956592459797973, 1.9])
def test_steps_do_not_follow_the_rounding_of_a_field_that_begins_with_it(s, method):
    # y' = -k y + tanh(s (t - c)) + 1: HBVM() came to t = 1.6e-4 in 8,000 steps, Gauss(6) to 4.1.
    k, c, end = 0.4362726285784803, 12.88236514463009, 36.2272084126424
    system = VectorField(lambda t, y, m: [-k * y[0] + m.tanh(s * (t - c)) + 1], dim=1)
    exact, _ = quad(
        lambda t: np.exp(k * (t - end)) * (np.tanh(s * (t - c)) + 1), 0.0, end, points=[c], epsabs=1e-13
    )
    solution = integrate(Problem(system, y0=[0.0], t_end=end), method, [end])
    assert solution.status.name == "FINISHED"
    assert abs(solution.y[-1, 0] - exact) < 1e-9
