import msgspec
import pytest

from hbvm_bench.studies.race import standings
from hbvm_bench.studies.race.results import Goal


def test_the_best_is_the_fastest_that_is_accurate_in_both(race):
    best = standings.best(race, "hbvm", 1e-13, 1e-10)
    assert best is not None
    # faster ones have too large an energy or a position error
    assert best.setting.method == "Gauss(s=8, h=1.5)"


def test_energy_alone_does_not_win(race):
    assert standings.best(race, "hbvm", 1e-13, 1e-10) is not standings.best(race, "hbvm", 1e-13, 1.0)


def test_void_stalled_and_untimed_settings_are_never_best(race):
    assert standings.best(race, "ias15", 1.0, 1.0) is None
    assert standings.best(race, "leapfrog", 1.0, 1.0) is None


def test_a_ratio_is_the_median_of_the_rounds(race):
    ratio = standings.at(race, "heyoka", 1e-13, 1e-10).ratio
    assert ratio.median == pytest.approx(15.0)
    assert ratio.low == pytest.approx(15.0)
    assert ratio.high == pytest.approx(15.0)


def test_a_ratio_lies_within_its_quartiles(race):
    """Where a machine changes its speed during the rounds, the ratio of the medians does not."""
    ours = msgspec.structs.replace(race.outcomes[0], seconds=[1.0, 1.0, 2.0, 2.0, 2.0])
    theirs = msgspec.structs.replace(race.outcomes[4], seconds=[3.0, 3.0, 3.0, 6.0, 6.0])
    ratio = standings.compare(ours, theirs).ratio
    # of the medians 1.5; of the rounds 3, 3, 1.5, 3, 3
    assert ratio.low <= ratio.median <= ratio.high
    assert ratio.median == 3.0


def test_where_nobody_is_accurate_enough_there_is_no_ratio(race):
    found = standings.at(race, "heyoka", 1e-16, 1e-10)
    assert found.ratio is None
    assert found.ours is None


def test_a_goal_without_a_position_asks_ours_to_be_no_worse_than_the_peer(race):
    verdict = standings.verdict(race, Goal(family="whfast", ratio=2.9, energy=1e-10, position=None))
    # HBVM(16, 8) has the better energy and time, but a position error above WHFast's 3e-9
    assert verdict.comparison.ours.setting.method == "Gauss(s=8, h=2.0)"
    assert verdict.comparison.ratio.median == pytest.approx(6.0)
    assert verdict.reached


def test_a_goal_that_nobody_reaches_is_missed(race):
    verdict = standings.verdict(race, Goal(family="ias15", ratio=1.0))
    assert not verdict.reached
    assert verdict.comparison.ratio is None


def test_a_missed_goal_is_missed(race):
    assert not standings.verdict(race, Goal(family="heyoka", ratio=15.1)).reached
    assert standings.verdict(race, Goal(family="heyoka", ratio=14.9)).reached


def test_a_default_is_compared_with_ours_at_no_larger_errors(race):
    ratio = standings.untuned(race, "heyoka")
    assert ratio.theirs is not None
    assert ratio.theirs.setting.method == "Taylor()"
    assert ratio.ours is None  # none of ours has both errors below 2e-15 and 1e-12
    looser = msgspec.structs.replace(ratio.theirs, energy=1e-13, position=1e-10)
    changed = msgspec.structs.replace(race, outcomes=[looser, *race.outcomes[:4]])
    assert standings.untuned(changed, "heyoka").ratio.median == pytest.approx(15.0)


def test_families_keep_the_order_of_declaration(race):
    assert standings.present(race) == ["hbvm", "heyoka", "ias15", "whfast", "leapfrog"]


def test_a_sample_left_out_of_a_round_is_left_out_of_the_pairs(race):
    outcome = next(o for o in race.outcomes if o.setting.family == "whfast")
    assert outcome.taken == [0.006]
    assert outcome.time.low is None
    ratio = standings.compare(race.outcomes[0], outcome).ratio
    assert ratio.median == pytest.approx(6.0)
    assert ratio.low is None
