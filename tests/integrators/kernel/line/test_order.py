"""The order 2s, measured on nonlinear problems, with one invariant and with all there are."""

import numpy as np
import pytest

import integrators
import problems
from integrators import HBVM, LineIntegral

PLATEAU = 5e-14  # below, the error is rounding
ASYMPTOTIC = 1e-3  # above, the next term of the error still counts
COUNTS = np.unique(np.rint(4 * 1.3 ** np.arange(25)).astype(int))  # steps: 4 .. 2169
SPAN = 4.0


def measured_order(problem, method_of, exact, sample=None, offset=0.0):
    """Slope of log(error) over log(h), from the last points before the plateau."""
    points = []
    for n in COUNTS:
        h = SPAN / n
        time = SPAN - offset * h
        # With an offset the time lies inside the last step, which goes on to the end.
        times = [time, SPAN] if offset else [time]
        solution = integrators.integrate(problem, method_of(h), times, sample)
        if solution.status.failed:  # a step too large for the iteration
            continue
        error = np.abs(solution.y[0] - exact(time)).max()
        if error < PLATEAU:
            break
        if error < ASYMPTOTIC:
            points.append((np.log(h), np.log(error)))
    assert len(points) >= 3, f"only {len(points)} points outside the plateau"
    h, error = np.array(points[-4:]).T
    return np.polyfit(h, error, 1)[0]


INVARIANTS = [["energy"], ["energy", "angular_momentum"], ["energy", "angular_momentum", "lenz"]]


@pytest.mark.parametrize("names", INVARIANTS, ids=len)
@pytest.mark.parametrize(("k", "s"), [(4, 1), (8, 2), (9, 3), (12, 4)])
def test_order_2s(k, s, names):
    problem = problems.load("kepler", e=0.3)
    order = measured_order(
        problem,
        lambda h: LineIntegral(k=k, s=s, h=h, invariants=names),
        lambda t: problems.catalogue.kepler.solution(problem, [t])[0],
    )
    assert abs(order - 2 * s) < 0.2  # measured 6e-6 to 0.005, and 0.17 for all at s = 4
    assert LineIntegral(k=k, s=s, h=0.1, invariants=names).order == 2 * s


@pytest.mark.parametrize(("sample", "expected"), [("partial", 6), ("stop", 6), ("dense", 4)])
def test_states_between_steps_have_order_2s_but_the_polynomial_only_s_plus_one(sample, expected):
    problem = problems.load("kepler", e=0.3)
    order = measured_order(
        problem,
        lambda h: LineIntegral(k=9, s=3, h=h, invariants=["energy", "angular_momentum"]),
        lambda t: problems.catalogue.kepler.solution(problem, [t])[0],
        sample,
        offset=0.6,
    )
    assert abs(order - expected) < 0.1  # measured 0.009, 0.009, 0.0002


@pytest.mark.parametrize("s", [1, 2, 3])
@pytest.mark.parametrize("several", [False, True], ids=["HBVM", "LineIntegral"])
def test_order_2s_on_a_poisson_system(s, several):
    problem = problems.load("lotka_volterra")
    fine = integrators.integrate(problem, HBVM(k=16, s=8, h=0.02), [SPAN])

    def method_of(h):
        if several:
            return LineIntegral(k=10, s=s, h=h, invariants=["energy", "casimir"])
        return HBVM(k=10, s=s, h=h)

    order = measured_order(problem, method_of, lambda t: fine.y[-1])
    assert abs(order - 2 * s) < 0.1  # measured 0.0001 to 0.018
