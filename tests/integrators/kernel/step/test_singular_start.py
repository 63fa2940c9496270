"""Fields that are infinite at the start, or have an infinite slope there: one trajectory, and many."""

import numpy as np
import pytest

from integrators import HBVM, Gauss, integrate, integrate_many
from problems import Problem, VectorField

METHODS = [HBVM(), HBVM(k=8, s=6, tol=1e-12), Gauss(s=8, tol=1e-12)]
FIELDS = {
    "log(t)": (lambda t, m: m.log(t), lambda t: t * np.log(t) - t),
    "1/sqrt(t)": (lambda t, m: 0.5 / m.sqrt(t), np.sqrt),
    "t**(-1/3)": (lambda t, m: m.exp(-m.log(t) / 3), lambda t: 1.5 * t ** (2 / 3)),
    "t**(-3/4)": (lambda t, m: m.exp(-0.75 * m.log(t)), lambda t: 4.0 * t**0.25),
    "t log(t)": (lambda t, m: t * m.log(t), lambda t: t * t / 2 * np.log(t) - t * t / 4),
    "sqrt(t)": (lambda t, m: m.sqrt(t), lambda t: t**1.5 / 1.5),
}
END = 1.5


def problem(f, start, turns):
    """Return ``y' = f(t)`` from a start, or that and an oscillator as further components."""
    if not turns:
        return Problem(VectorField(lambda t, y, m: [f(t, m)], dim=1), y0=[start], t_end=END)
    field = VectorField(lambda t, y, m: [f(t, m), y[2], -y[1]], dim=3)
    return Problem(field, y0=[start, 1.0, 0.0], t_end=END)


@pytest.mark.parametrize("turns", [False, True], ids=["alone", "beside an oscillator"])
@pytest.mark.parametrize("method", METHODS, ids=str)
@pytest.mark.parametrize("name", FIELDS)
def test_what_is_infinite_at_the_start_is_integrated(name, method, turns):
    # Before, 1/sqrt(t) stalled, and log(t) took 1,069 steps of which the first were of length 1e-318; 48 now.
    f, integral = FIELDS[name]
    for start in (0.0, 1.0):
        given = problem(f, start, turns)
        one = integrate(given, method, [END / 3, END])
        starts = [given.y0 + shift for shift in (0.0, 0.1, 2.0)]
        many = integrate_many(given, method, starts=starts, times=[END / 3, END])
        assert one.status.name == "FINISHED"
        assert {str(status) for status in many.status} == {"finished"}
        assert one.stats.steps < 400  # 240
        found = np.concatenate([one.y[None, :, 0] - start, many.y[:, :, 0] - np.array(starts)[:, :1]])
        assert np.abs(found - integral(np.array([END / 3, END]))).max() < 1e-9  # 2e-10


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS, ids=str)
def test_what_has_no_integral_is_not_integrated(method):
    for f in (lambda t: 1.0 / t, lambda t: 1.0 / t**2, lambda t: 1.0 / (t - 1.0) ** 2):
        given = Problem(VectorField(lambda t, y, m, f=f: [f(t)], dim=1), y0=[1.0], t_end=END)
        assert integrate(given, method, [END]).status.failed
        many = integrate_many(given, method, starts=[[1.0], [2.0]], times=[END])
        assert "finished" not in {str(status) for status in many.status}
