import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import problems
from hbvm_bench.campaign.grid import Grid
from hbvm_bench.reference import solutions
from problems.errors import InputError


def test_an_uneven_grid_holds_its_ends_and_the_times_of_the_reference():
    problem = problems.load("kepler")
    known = solutions.find(problem)
    for spacing in ("irregular", "log"):
        times = Grid(count=100, spacing=spacing).times(problem)
        assert times[0] == problem.t0
        assert times[-1] == problem.t_end
        assert np.all(np.diff(times) > 0)
        assert set(known.t) <= set(times)


def test_a_logarithmic_grid_is_even_in_the_logarithm():
    problem = problems.load("kepler", e=0.123, t_end=1e4)  # has no reference
    times = Grid(count=300, spacing="log", first=1.0).times(problem)[1:]
    counted, _ = np.histogram(np.log10(times), bins=[0, 1, 2, 3, 4])
    assert np.all(np.abs(counted - 75) <= 1)


@given(st.floats(0.003, 0.3))
def test_no_period_is_met_at_one_phase(share):
    # the longest gap between phases of 1000 samples, for any period of the motion; an even grid
    # leaves 1/10 of the circle unseen where ten samples make a period. 0.101 measured at most.
    problem = problems.load("kepler", e=0.123, t_end=1000.0)
    phases = np.sort((Grid(count=1000, spacing="irregular").times(problem) / (1000.0 * share)) % 1.0)
    assert np.max(np.diff(np.append(phases, phases[0] + 1.0))) < 0.15


def test_an_uneven_grid_runs_backwards_with_its_problem():
    problem = problems.load("kepler", e=0.123, t_end=-50.0)
    times = Grid(count=20, spacing="log").times(problem)
    assert times[0] == 0.0
    assert times[-1] == -50.0
    assert np.all(np.diff(times) < 0)


@pytest.mark.parametrize(
    "options",
    [
        {"step": 0.1, "spacing": "log"},
        {"first": 1.0},
        {"spacing": "log", "first": 1e9},
        {"spacing": "irregular", "count": 10**8},
    ],
)
def test_a_grid_that_makes_no_sense_is_refused(options):
    with pytest.raises(InputError):
        Grid(**options).times(problems.load("kepler"))


def test_further_times_lie_within_the_span_and_all_may_be_whole_ones():
    problem = problems.load("outer_solar_system", t_end=2000.0)
    grid = Grid(spacing="log", count=20, first=10.0, also=[100.0, 5000.0], multiple_of=1.0)
    t = grid.times(problem)
    assert np.array_equal(t, np.rint(t))
    assert 100.0 in t
    assert (t[0], t[-1]) == (0.0, 2000.0)
    assert np.all(np.diff(t) > 0)


def test_samples_of_a_fixed_step_are_at_its_steps_backwards_too():
    for t_end in (10.0, -10.0):
        problem = problems.load("pendulum", t_end=t_end)
        t = Grid(count=40, at_steps=True).times(problem, 0.3)
        assert t[-1] == t_end
        assert np.array_equal(np.abs(t[:-1]), np.rint(np.abs(t[:-1]) / 0.3) * 0.3)
        assert np.all(np.diff(np.abs(t)) > 0)
    assert np.array_equal(Grid(count=40, at_steps=True).times(problem), Grid(count=40).times(problem))
