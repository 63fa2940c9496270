"""Free fall into the centre: where a step cannot be solved, no state inside it comes back."""

import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, LineIntegral, Status, integrate

FALL = problems.load("kepler").system  # from rest at distance 1: collision at t = 1.1107

METHODS = [
    HBVM(k=8, s=4, h=0.1),
    HBVM(k=8, s=4, h=0.13),
    HBVM(k=8, s=4, h=0.13, solver="fixed_point"),
    HBVM(k=8, s=4, h=0.13, solver="newton"),
    LineIntegral(k=8, s=4, h=0.13, invariants=["energy"]),
]


@pytest.mark.parametrize("end", [5.0, 1.109], ids=["beyond", "inside the step"])
@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_nothing_after_the_failure_comes_back(method, end):
    fall = problems.Problem(FALL, q0=[1.0, 0.0], p0=[0.0, 0.0], t_end=5.0)
    # A stepper without a destination looks ahead; `integrate` shortens the last step to 1.109, and finishes.
    stepper = method.compile(FALL).start(fall.y0, fall.par)
    samples = stepper.advance(np.linspace(0.0, end, 1001))
    assert samples.status is Status.NONLINEAR_DIVERGENCE
    assert samples.t[-1] <= np.nextafter(stepper.t, np.inf)
    # Measured 1.3e-3 at most (h = 0.1, its last own step); states inside the failed step had 0.05 to 179.
    energy = fall.invariants(samples.y)["energy"]
    assert np.abs(energy + 1.0).max() < 1e-2


def test_nor_from_a_batch():
    times = np.linspace(0.0, 5.0, 1001)
    starts = [[1.0, 0.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 1.0]]
    batch = HBVM(k=8, s=4, h=0.13).compile(FALL).batch(starts, times=times)
    for i, stop in enumerate(batch.t_stop):
        assert np.isnan(batch.y[i, times > stop + 1e-12]).all()
    assert [s.failed for s in batch.status] == [True, True, False]


def test_the_reason_says_that_a_solution_was_found_and_is_none():
    solution = integrate(problems.load("kepler"), Gauss(s=4, h=2.0))
    assert solution.status is Status.NONLINEAR_DIVERGENCE
    # Newton's iteration converges, to a root with an energy error of 1.05 that no shorter step leads to.
    assert "no solution near the trajectory" in solution.reason
    assert "did not converge" not in solution.reason
