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
