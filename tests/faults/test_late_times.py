"""Times so late that doubles are too coarse for the interval are refused; no initial state is a result."""

import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, integrate, integrate_many, section, start
from integrators.dynamics import lyapunov, megno
from problems import InputError
from tests.faults.search import late_times

KEPLER = problems.load("kepler", e=0.3, t_end=5.0)
WAYS = {
    "integrate": lambda problem: integrate(problem, times=[problem.t_end]),
    "fixed": lambda problem: integrate(problem, HBVM(k=8, s=4, h=0.11)),
    "integrate_many": lambda problem: integrate_many(problem, starts=[problem.y0]),
    "times of each": lambda problem: integrate_many(
        problem, starts=[problem.y0] * 2, times=[[problem.t_end, np.nan], [problem.t0 + 2.0, problem.t_end]]
    ),
    "start": start,
    "section": lambda problem: section(problem, HBVM(), lambda q: q[1]),
    "lyapunov": lambda problem: lyapunov(problem),
    "megno": lambda problem: megno(problem),
}


@pytest.mark.parametrize("t0", [1e12, 1e14, 1e15, 1e16, -1e16])
@pytest.mark.parametrize("way", WAYS)
def test_an_interval_that_doubles_are_too_coarse_for_is_refused(way, t0):
    """Before, Kepler's orbit from 1e16 was "finished" with 0 steps; from 1e14 the error was 1.8e-2."""
    problem = KEPLER.replace(t0=t0, t_end=t0 + 4.0)
    with pytest.raises(InputError, match=r"doubles are .* apart, .*count the time from t0, with t0 = 0"):
        WAYS[way](problem)


def test_the_sentence_names_the_time_and_the_distance():
    with pytest.raises(InputError, match=r"at t = 1e\+15 doubles are 0.125 apart, too coarse .* of 4:"):
        integrate(KEPLER.replace(t0=1e15, t_end=1e15 + 4.0))


@pytest.mark.parametrize("method", [HBVM(), Gauss(s=8, h=0.11)], ids=["adaptive", "fixed"])
@pytest.mark.parametrize(("t0", "span"), [(2451545.0, 1.0), (1.7e9, 20.0), (-1e6, -4.0)])
def test_dates_and_long_intervals_are_not(method, t0, span):
    made = start(KEPLER.replace(t0=t0, t_end=t0 + span), method)
    assert made.step().value == "running"


@pytest.mark.parametrize("sample", ["partial", "stop", "dense"])
@pytest.mark.parametrize("method", [HBVM(), HBVM(k=8, s=4, h=0.11), Gauss(s=8, h=0.11)], ids=repr)
def test_the_start_of_an_autonomous_system_does_not_matter(method, sample):
    """Before, fixed steps were wrong by 5e-11 at a Julian date, in the part of a step before the end."""
    after = np.array([0.5, 1.25, 3.9375, 4.0])  # exactly so long after each of the starts
    from_zero, late, early = (
        integrate(KEPLER.replace(t0=t0, t_end=t0 + 4.0), method, t0 + after, sample=sample)
        for t0 in (0.0, 2451545.0, -(2.0**21))
    )
    assert np.array_equal(late.y, from_zero.y)
    assert np.array_equal(early.y, from_zero.y)


@pytest.mark.parametrize("i", range(20))
def test_a_late_start_is_right_or_refused(i):
    assert late_times.tried(np.random.default_rng([8, i])) == ""


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_so_is_any_of_many(seed):
    assert [what for i in range(200) if (what := late_times.tried(np.random.default_rng([seed, i])))] == []
