from collections import Counter

import numpy as np
import pytest

from hbvm_bench.campaign.file import Case, name_of
from hbvm_bench.campaign.identity import fixed_step, make_method, make_problem, resolve
from hbvm_bench.campaign.shorter import QUICK_SHARE, chosen, quick_run
from hbvm_bench.reference import solutions
from hbvm_bench.studies.race.families import FAMILIES, FIXED, OURS, OWN, row_of
from hbvm_bench.studies.race.probe import METHODS
from hbvm_bench.studies.race.results import declared
from hbvm_bench.summaries.points import PROJECTION
from problems.errors import UnknownNameError

KEYS = [name_of(entry) for entry in declared().entries()]
SETTINGS, QUICK_SETTINGS = 16, 6


def cases(key, *, quick=False):
    campaign = chosen(declared(), [key])
    return (quick_run(campaign) if quick else campaign).cases()


@pytest.mark.parametrize("key", KEYS)
def test_every_row_has_the_same_number_of_settings_and_none_twice(key):
    here = cases(key)
    rows = Counter(map(row_of, here))
    assert set(rows.values()) == {SETTINGS}
    assert len({resolve(case).id for case in here}) == len(here)
    assert {row.family for row in rows} <= set(FAMILIES)
    both = {row.family for row in rows if row.steps == FIXED} & {
        row.family for row in rows if row.steps == OWN
    }
    assert both == {OURS, "IAS15"}


@pytest.mark.parametrize("key", KEYS)
def test_the_quick_settings_are_some_of_the_declared_ones(key):
    quick = cases(key, quick=True)
    counts = Counter(row_of(case).family for case in quick)
    assert set(counts.values()) == {QUICK_SETTINGS}
    assert {case.method for case in quick} <= {case.method for case in cases(key)}


def test_a_projection_is_in_no_row_of_hbvm():
    case = Case(problem="kepler()", method="HBVM(tol=1e-06, projection='energy')")
    assert row_of(case).family == PROJECTION in FAMILIES
    assert row_of(Case(problem="kepler()", method="HBVM(tol=1e-06)")).family == OURS


@pytest.mark.parametrize("key", KEYS)
def test_the_problem_has_a_stored_true_solution_at_both_ends(key):
    (problem,) = {case.problem for case in cases(key)}
    (short,) = {case.problem for case in cases(key, quick=True)}
    whole, part = make_problem(problem), make_problem(short)
    for made in (whole, part):
        stored = solutions.find(made)
        assert stored is not None
        assert made.t_end in stored.t
        assert "check" in stored.provenance
    assert part.t_end == pytest.approx(whole.t0 + QUICK_SHARE * (whole.t_end - whole.t0))


@pytest.mark.parametrize("key", KEYS)
def test_the_true_solution_starts_where_the_problem_starts(key):
    problem = make_problem(cases(key)[0].problem)
    stored = solutions.find(problem)
    assert stored is not None
    assert np.array_equal(stored.high[0], problem.y0)
    assert np.max(np.abs(stored.low[0])) < 1e-30  # the 128-bit number was written in decimal


@pytest.mark.parametrize("key", ["outer_solar_system", "sitnikov", "kepler", "henon_heiles", "fput32"])
def test_a_fixed_step_divides_the_span(key):
    for case in cases(key):
        h = fixed_step(make_method(case.method))
        if h:
            steps = make_problem(case.problem).t_end / h
            assert abs(steps - round(steps)) < 1e-6


def test_samples_of_a_fixed_step_are_at_its_steps_and_end_at_the_end():
    case = cases("henon_heiles")[1]
    resolved = resolve(case)
    h = getattr(resolved.method, "h", 0.0)
    t = case.grid.times(resolved.problem, h)
    assert np.array_equal(t / h, np.rint(t / h))
    assert t[-1] == resolved.problem.t_end
    assert np.all(np.diff(t) > 0)
    assert t.size > 395  # of 400 cells: in few do two samples meet the same step


def test_goals_are_about_families_that_run():
    for goal in declared().goals:
        assert goal.only
        for key in goal.only:
            assert goal.against in {row_of(case).family for case in cases(key)}


def test_an_unknown_problem_is_named_with_the_nearest():
    with pytest.raises(UnknownNameError, match="kepler"):
        chosen(declared(), ["keppler"])


def test_problems_are_chosen_in_the_order_of_declaration():
    found = chosen(declared(), ["kepler", "sitnikov"])
    assert [name_of(entry) for entry in found.entries()] == ["sitnikov", "kepler"]
    assert chosen(declared(), []).cases() == declared().cases()


def test_compile_times_are_measured_for_methods_that_exist():
    assert OURS in METHODS
    for family, methods in METHODS.items():
        assert family in FAMILIES
        for template in methods:
            make_method(template.format(h=0.5))
