"""What a second `integrate` of the same problem costs beside its steps, counted in Python's calls."""

import sys

import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, integrate, registry


def calls(work):
    """Return how many functions written in Python ``work`` calls.

    Of three counts the least: the collection of garbage calls functions too.
    """
    count = 0

    def see(frame, event, argument):
        nonlocal count
        count += event == "call"

    def once():
        nonlocal count
        count = 0
        sys.setprofile(see)
        try:
            work()
        finally:
            sys.setprofile(None)
        return count

    return min(once() for _ in range(3))


@pytest.mark.parametrize(
    ("method", "most"),
    [
        (HBVM(), 108),  # 107, of which the course of the samples takes 6; 409 where all was made anew
        (HBVM(k=8, s=4, h=0.1), 106),  # 105, of which the count from a sum of two doubles takes 5; 328
        (Gauss(s=4, h=0.1), 106),  # 105; 327
        (("Taylor", {}), 95),  # 93; 250
    ],
    ids=["HBVM", "fixed steps", "Gauss", "Taylor"],
)
def test_a_second_integration_calls_few_functions(method, most):
    if isinstance(method, tuple):
        pytest.importorskip("heyoka")
        method = registry.create(method[0], **method[1])
    problem = problems.load("kepler")
    integrate(problem, method, [0.1])
    assert calls(lambda: integrate(problem, method, [0.1])) <= most


def test_many_samples_cost_no_more_calls():
    problem = problems.load("kepler")
    few, many = np.array([1.0]), np.linspace(0.0, 1.0, 1000)
    integrate(problem, HBVM(), few)
    assert calls(lambda: integrate(problem, HBVM(), many)) == calls(lambda: integrate(problem, HBVM(), few))


def test_what_changes_between_two_integrations_is_seen():
    first, second = problems.load("kepler", e=0.1), problems.load("kepler", e=0.7)
    alone = integrate(problems.load("kepler", e=0.7), HBVM(), [3.0])
    same = problems.Problem(first.system, y0=second.y0, t_end=3.0)
    integrate(first, HBVM(), [3.0])
    again = integrate(same, HBVM(), [3.0])
    assert np.array_equal(again.y, alone.y)
    again.t[:], again.y[:] = 0.0, 0.0  # a solution is the caller's own
    assert np.array_equal(integrate(same, HBVM(), [3.0]).y, alone.y)
    default = integrate(first, HBVM())
    kept = default.t.copy()
    default.t[:] = 0.0
    assert np.array_equal(integrate(first, HBVM()).t, kept)
