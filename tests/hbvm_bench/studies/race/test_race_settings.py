from collections import Counter

import numpy as np
import pytest

from hbvm_bench.campaign.identity import make_method, make_problem
from hbvm_bench.reference import solutions
from hbvm_bench.studies.race import truth
from hbvm_bench.studies.race.accuracy import SAMPLES, sample_times
from hbvm_bench.studies.race.contests import CONTESTS, QUICK_SHARE, chosen
from hbvm_bench.studies.race.probe import METHODS
from hbvm_bench.studies.race.settings import FAMILIES, QUICK_SETTINGS, SETTINGS, settings
from problems.errors import UnknownNameError

KEYS = list(CONTESTS)


@pytest.mark.parametrize("key", KEYS)
def test_every_family_has_the_same_number_of_settings_and_none_twice(key):
    declared = settings(key)
    assert set(Counter(s.family for s in declared).values()) == {SETTINGS}
    assert len({s.method for s in declared}) == len(declared)
    assert {s.family for s in declared} <= set(FAMILIES)


@pytest.mark.parametrize("key", KEYS)
def test_the_quick_settings_are_some_of_the_declared_ones(key):
    quick = settings(key, quick=True)
    assert set(Counter(s.family for s in quick).values()) == {QUICK_SETTINGS}
    assert {s.method for s in quick} <= {s.method for s in settings(key)}


@pytest.mark.parametrize("key", KEYS)
def test_the_settings_print_as_they_are_read(key):
    for setting in settings(key):
        assert repr(make_method(setting.method)) == setting.method


@pytest.mark.parametrize("key", KEYS)
def test_the_problem_has_a_stored_true_solution_at_both_ends(key):
    problem = make_problem(CONTESTS[key].problem)
    stored = solutions.find(problem)
    assert stored is not None
    assert stored.t[-1] == problem.t_end
    short = problem.t0 + QUICK_SHARE * (problem.t_end - problem.t0)
    assert stored.t[truth.nearest(stored, short)] == pytest.approx(short)
    assert "check" in stored.provenance


@pytest.mark.parametrize("key", KEYS)
def test_the_true_solution_starts_where_the_problem_starts(key):
    problem = make_problem(CONTESTS[key].problem)
    stored = solutions.find(problem)
    assert stored is not None
    assert np.array_equal(stored.high[0], problem.y0)
    assert np.max(np.abs(stored.low[0])) < 1e-30  # the 128-bit number was written in decimal


@pytest.mark.parametrize("key", ["outer_solar_system", "sitnikov", "kepler", "henon_heiles", "fput32"])
def test_a_fixed_step_divides_the_span(key):
    problem = make_problem(CONTESTS[key].problem)
    for setting in settings(key):
        if FAMILIES[setting.family].fixed:
            steps = problem.t_end / make_method(setting.method).h  # pyright: ignore[reportAttributeAccessIssue]
            assert abs(steps - round(steps)) < 1e-6


def test_defaults_are_marked():
    marked = {s.method for s in settings("outer_solar_system") if s.default}
    assert marked == {"Taylor()", "IAS15()"}


def test_goals_are_about_families_that_run():
    for key, contest in CONTESTS.items():
        assert {goal.family for goal in contest.goals} <= {s.family for s in settings(key)}


def test_an_unknown_contest_is_named_with_the_nearest():
    with pytest.raises(UnknownNameError, match="kepler"):
        chosen(["keppler"])


def test_contests_are_chosen_in_the_order_of_declaration():
    assert [c.key for c in chosen(["kepler", "sitnikov"])] == ["sitnikov", "kepler"]
    assert chosen(None) == list(CONTESTS.values())


def test_compile_times_are_measured_for_methods_that_exist():
    for methods in METHODS.values():
        for template in methods:
            make_method(template.format(h=0.5))


def test_samples_lie_one_in_each_part_of_the_span_and_end_at_its_end():
    t = sample_times(0.0, 40.0, None)
    assert t.size == SAMPLES
    assert t[-1] == 40.0
    assert np.array_equal(np.floor(t[:-1] * SAMPLES / 40.0), np.arange(SAMPLES - 1))


def test_samples_of_a_fixed_step_are_own_steps():
    t = sample_times(1.0, 11.0, 0.375)
    steps = (t - 1.0) / 0.375
    assert np.array_equal(steps, np.rint(steps))
    assert t[0] > 1.0
    assert t[-1] <= 11.0
    assert np.all(np.diff(t) > 0)
