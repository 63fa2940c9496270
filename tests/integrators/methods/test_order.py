"""The order 2s, measured on a nonlinear problem with a known solution."""

import numpy as np
import pytest

import integrators
from integrators import HBVM, Gauss, testing
from integrators.testing.convergence import PLATEAU

E = 0.3
SPAN = 4.0

ASYMPTOTIC = 1e-3  # above, the next term of the error still counts
COUNTS = np.unique(np.rint(4 * 1.3 ** np.arange(25)).astype(int))  # steps: 4 .. 2169


def measured_order(method_of, problem, exact):
    return testing.measured_order(
        method_of, problem, [SPAN / n for n in COUNTS], exact, end=SPAN, asymptotic=ASYMPTOTIC
    )


PAIRS = [(2, 1), (6, 1), (3, 2), (18, 2), (4, 3), (9, 3), (6, 4), (16, 4), (8, 5), (15, 5)]


@pytest.mark.parametrize(("k", "s"), PAIRS)
def test_hbvm_has_order_2s(k, s, kepler, kepler_exact):
    order = measured_order(lambda h: HBVM(k=k, s=s, h=h), kepler(E), kepler_exact(E, SPAN))
    assert abs(order - 2 * s) < 0.3  # measured 0.0003 (s <= 3), 0.02 (4), 0.13 (5)
    assert HBVM(k=k, s=s, h=0.1).order == 2 * s


@pytest.mark.parametrize("s", [1, 2, 3, 4, 5])
def test_gauss_has_order_2s(s, kepler, kepler_exact):
    order = measured_order(lambda h: Gauss(s=s, h=h), kepler(E), kepler_exact(E, SPAN))
    assert abs(order - 2 * s) < 0.3  # measured 0.003 (s <= 3), 0.03 (4), 0.17 (5)
    assert Gauss(s=s, h=0.1).order == 2 * s


@pytest.mark.parametrize(("sample", "expected"), [("partial", 6), ("stop", 6), ("dense", 4)])
def test_states_between_steps_have_order_2s_but_the_polynomial_only_s_plus_one(
    sample, expected, kepler, kepler_exact
):
    # A time that is 0.4 steps behind a step's end at every count, so that the error has one constant.
    problem = kepler(E)
    points = []
    for n in COUNTS[COUNTS > 12]:
        h = SPAN / n
        time = SPAN - 0.6 * h
        solution = integrators.integrate(problem, HBVM(k=6, s=3, h=h), [time, SPAN], sample)
        error = np.abs(solution.y[0] - kepler_exact(E, time)).max()
        if error < PLATEAU:
            break
        points.append((np.log(h), np.log(error)))
    assert len(points) >= 3
    h, error = np.array(points[-6:]).T
    assert abs(np.polyfit(h, error, 1)[0] - expected) < 0.1  # measured 6.008, 6.008, 4.009
