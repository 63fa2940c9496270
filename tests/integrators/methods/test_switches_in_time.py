"""Fields that only switch in time are integrated like those that do not: they are autonomous in between."""

import numpy as np
import pytest

from integrators import HBVM, integrate
from integrators.methods.automatic import choose
from problems import Problem, VectorField
from problems.analysis.switches import depends_on_time_between_switches


def vector_field(f):
    return VectorField(f, dim=1, parameters={"c": 1.0})


@pytest.mark.parametrize(
    "f",
    [
        lambda t, y, par, m: [m.where(t > 5, 0.0, 2.0) - y[0]],
        lambda t, y, par, m: [m.where(m.abs(t - 3) < par.c, y[0], -y[0])],
        lambda t, y, par, m: [m.where(2 * t / par.c > 5, 0.0, m.where(t > 1, 2.0, y[0]))],
        lambda t, y, par, m: [m.sign(t - par.c) - y[0]],
        lambda t, y, par, m: [m.where(y[0] > 0, -1.0, 1.0)],
    ],
)
def test_a_field_whose_switching_times_are_known_is_autonomous_in_between(f):
    assert not depends_on_time_between_switches(vector_field(f))


@pytest.mark.parametrize(
    "f",
    [
        lambda t, y, par, m: [m.sin(t) - y[0]],
        lambda t, y, par, m: [m.abs(t - 3) - y[0]],
        lambda t, y, par, m: [m.where(m.sin(t) > 0.5, 0.0, 2.0) - y[0]],
        lambda t, y, par, m: [m.where(t > 5, t, 2.0) - y[0]],
        lambda t, y, par, m: [m.where(t > y[0], 0.0, 2.0)],
        lambda t, y, par, m: [m.where(m.floor(t) > 5, 0.0, 2.0) - y[0]],
        lambda t, y, par, m: [m.where(t > 5, 0.0, 2.0) - t],
        lambda t, y, par, m: [m.table(t, [0.0, 1.0, 2.0], [0.0, 1.0, 3.0]) - y[0]],
    ],
)
def test_a_field_that_contains_the_time_itself_is_not(f):
    assert depends_on_time_between_switches(vector_field(f))


def medical_akzo_nobel(n, inflow, t_end):
    """Return the Medical Akzo Nobel problem (parabolic, stiff), with ``inflow(t, m)`` at its boundary."""
    k, c, d = 100.0, 4.0, 1.0 / n

    def field(t, y, m):
        out = []
        for j in range(1, n + 1):
            z = j * d
            drift, diffusion = 2 * (z - 1) ** 3 / c**2, (z - 1) ** 4 / c**2
            u, v = y[2 * j - 2], y[2 * j - 1]
            rate = -k * u * v
            if j < n:
                left, right = inflow(t, m) if j == 1 else y[2 * j - 4], y[2 * j]
                moved = drift * (right - left) / (2 * d) + diffusion * (left - 2 * u + right) / d**2
                out += [moved + rate, rate]
            else:
                out += [rate, rate]
        return out

    y0 = np.zeros(2 * n)
    y0[1::2] = 1.0
    return Problem(VectorField(field, dim=2 * n), y0=y0, t_end=t_end)


def test_the_implicit_solver_takes_over_where_a_stiff_field_switches_in_time():
    switched = medical_akzo_nobel(40, lambda t, m: m.where(t > 5, 0.0, 2.0), 10.0)
    smooth = medical_akzo_nobel(40, lambda t, m: 2.0, 5.0)
    method = HBVM(tol=1e-6)
    assert choose(switched.system, 1e-6) == choose(smooth.system, 1e-6)
    before, until_five = (integrate(problem, method, [5.0]) for problem in (switched, smooth))
    assert before.stats.steps <= 1.2 * until_five.stats.steps
    after = integrate(switched, method, [10.0])
    assert after.stats.extra["implicit"]["steps"] > until_five.stats.extra["implicit"]["steps"] > 0
    assert after.stats.steps < 2 * until_five.stats.steps  # 286 and 264 steps
    exact = integrate(switched, HBVM(tol=1e-10, solver="newton"), [10.0])
    assert np.abs(after.y[-1] - exact.y[-1]).max() < 1e-12  # measured 3.9e-14


PULSES = {
    "floor": lambda t, m: t - m.floor(t) < WIDTH,
    "sign": lambda t, m: m.sign(t - m.round(t - 0.5) - WIDTH) < 0.0,
    "cosine": lambda t, m: m.cos(2.0 * np.pi * (t - WIDTH / 2)) > np.cos(np.pi * WIDTH),
}
WIDTH = 1e-3


@pytest.mark.parametrize("condition", PULSES.values(), ids=PULSES)
def test_periodic_pulses_are_known_and_no_discontinuity_is_told(condition):
    # Before, "floor" and "sign" were errors of numba beside a branch, and of the cosine's pulse at t = 0,
    # whose edges rounding moves by 5e-15, one was told.
    system = VectorField(lambda t, y, m: [m.where(condition(t, m), 1.0 / WIDTH, 0.0) - y[0]], dim=1)
    made = integrate(Problem(system, y0=[0.0], t0=-0.5, t_end=9.5), HBVM(), [9.5])
    each = (1.0 - np.exp(-WIDTH)) / WIDTH * np.exp(WIDTH - 9.5 + np.arange(10))
    assert made.y[-1, 0] == pytest.approx(each.sum(), rel=1e-11)  # measured 3e-13
    assert made.warnings == ()
