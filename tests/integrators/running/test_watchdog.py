"""Steps that have collapsed, and those that are short because they must be."""

import pytest

import problems
from integrators import HBVM, Status, integrate, integrate_many
from integrators.running.watchdog import STALL_STEPS, makes_no_progress


def slow_then_fast(t_end=1e5):
    """Return a forced problem whose field oscillates 1e9 times as fast after t = 1,000."""

    def f(t, y, par, m):
        return [0.1 * m.cos(t) + par.fast * m.sin(1e9 * t) * (1.0 + m.tanh(40.0 * (t - 1e3))), 0.0 * y[0]]

    system = problems.VectorField(f, dim=2, parameters={"fast": 0.25})
    return problems.Problem(system, y0=[0.0, 0.0], t_end=t_end)


def test_the_way_is_compared_with_the_end_and_with_the_mean_until_then():
    assert makes_no_progress(way=9e-8, left=1.0, before=0.0, steps=0)
    assert not makes_no_progress(way=1.1e-7, left=1.0, before=0.0, steps=0)
    # A million steps of 1e-6 came to 1; 200,000 steps of the same length cover 0.2.
    assert makes_no_progress(way=1.9e-5, left=1.0, before=1.0, steps=10**6)
    assert not makes_no_progress(way=2.1e-5, left=1.0, before=1.0, steps=10**6)
    assert not makes_no_progress(way=1.9e-5, left=1.0, before=1.8e-1, steps=STALL_STEPS)


def test_steps_that_collapse_on_the_way_are_a_status(monkeypatch):
    monkeypatch.setattr("integrators.running.watchdog.STALL_STEPS", 8000)
    solution = integrate(slow_then_fast(), HBVM())  # before: for ever, 1e-7 of the way in 200,000 steps
    assert solution.status is Status.STALLED
    assert "the steps have collapsed" in solution.reason
    assert solution.t_stop == pytest.approx(999.8, abs=0.1)


@pytest.mark.slow
def test_so_they_are_beside_others_in_lanes():
    made = integrate_many(slow_then_fast(2e3), HBVM(), parameters={"fast": [0.0, 0.25]})
    assert made.status == [Status.FINISHED, Status.STALLED]
    assert "the steps have collapsed" in made.reason[1]
