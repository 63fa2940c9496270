"""The three general blocks: functions of the results table."""

from collections import Counter

import msgspec
import pytest

from hbvm_bench.campaign.file import load
from hbvm_bench.campaign.shorter import quick_run
from hbvm_bench.campaign.spec import parse_spec
from hbvm_bench.report.page import gather
from hbvm_bench.summaries import cost_ratio, fastest, frame, growth
from hbvm_bench.summaries.frame import OURS
from hbvm_bench.summaries.goals import verdicts
from tests.hbvm_bench.studies import made_up_studies
from tests.hbvm_bench.studies.made_up_studies import setting

NO_WORSE = ("energy_max", "position_mean")


@pytest.fixture(scope="module")
def race():
    return frame.cases([made_up_studies.race()])


def texts(found):
    return dict(zip(found.family, found.text, strict=True))


def test_a_ratio_is_that_of_the_fastest_settings_that_are_accurate_enough(race):
    found = cost_ratio.ratios(race).set_index("family")
    assert found.loc["Taylor"][["setting", "ours", "level"]].tolist() == [
        "Taylor()",
        "Gauss(s=8, h=1.5)",
        "1e-13, 1e-10",
    ]
    assert found.ratio["Taylor"] == pytest.approx(15.0)
    assert found.text["Taylor"] == "15.0× (15.0–15.0)"
    assert found.why.drop("Taylor").to_dict() == {
        "IAS15": "no valid run",
        "WHFast": "not reached",
        "Leapfrog": "does not apply",
    }
    table = cost_ratio.table(found.reset_index(), "title", "errors ≤")
    assert table is not None
    assert table.head == ("problem", "errors ≤", "fastest of HBVM and Gauss", "time", "Taylor")
    assert table.rows[0][2:] == ("Gauss(s=8, h=1.5)", "2 ms", "15.0× (15.0–15.0)")


def test_a_setting_outside_of_its_method_s_domain_takes_no_part(race):
    there = race.copy()
    there["record"] = [
        msgspec.structs.replace(
            record, case=msgspec.structs.replace(record.case, settings=cost_ratio.OUTSIDE)
        )
        if record.case.method.startswith("WHFast")
        else record
        for record in race.record
    ]
    assert set(texts(cost_ratio.ratios(there, "position error"))) == set(
        texts(cost_ratio.ratios(race, "position error"))
    ) - {"WHFast"}


def test_levels_go_from_loose_to_tight_and_a_family_alone_is_told(race):
    found = cost_ratio.ratios(race, "position error")
    taylor = found[found.family == "Taylor"]
    assert taylor.level.tolist() == ["0.001", "1e-06", "1e-09", "1e-12"]
    assert [text.partition(" (")[0] for text in taylor.text] == ["15.0×", "15.0×", "30.0×", "30 ms, alone"]
    strongest = cost_ratio.strongest(found)
    assert strongest.family.tolist() == ["WHFast", "WHFast", "Taylor"]
    both = cost_ratio.ratios(race, "energy and position error")
    assert both.level.unique()[0] == "1e-08, 1e-05"
    assert len(both.level.unique()) == 7


def test_without_any_time_there_is_no_table(race):
    void = race[race.family == "IAS15"]
    assert cost_ratio.table(cost_ratio.ratios(void, "position error"), "title") is None
    assert fastest.fastest(void) is None


def test_as_many_settings_of_every_family_take_part():
    declared = load("race")
    for campaign, count in ((declared, 16), (quick_run(declared), 6)):
        cases = [(case.problem, parse_spec(case.method).name) for case in campaign.cases()]
        taken = Counter((problem, OURS if name in ("HBVM", "Gauss") else name) for problem, name in cases)
        assert {*taken.values()} == {count}


def test_fixed_and_adaptive_steps_are_rows_of_their_own():
    own = setting("HBVM(tol=1e-14)", 0.0005, 5e-14, 5e-11)
    table = fastest.fastest(frame.cases([made_up_studies.race(own)]))
    assert table is not None
    rows = {row[2]: row[3:] for row in table.rows}
    assert rows[f"{OURS}, fixed step size"][0] == "Gauss(s=8, h=1.5)"
    assert rows[f"{OURS}, adaptive step size"][:2] == ("HBVM(tol=1e-14)", "500 µs (475 µs – 550 µs)")
    assert rows["Taylor, adaptive step size"][-1].startswith("60.0×")
    assert rows["WHFast, fixed step size"][0] == "not reached"


def test_defaults_are_compared_where_ours_is_no_less_accurate():
    ahead, behind = (
        cost_ratio.ratios(frame.cases([made_up_studies.defaults({}, 3.0, worse=worse)]), no_worse=NO_WORSE)
        for worse in (1.0, 3.0)
    )
    assert texts(ahead) == {"Taylor": "3.00× (3.00–3.00)"}
    assert texts(behind) == {"Taylor": "3.00× less accurate"}
    assert cost_ratio.strongest(behind).empty


def test_processors_stand_side_by_side():
    zen4 = {"llvm_processor": "znver4", "vector_bits": 256, "ours_built_for": "AVX2"}
    runs = [made_up_studies.race(machine=zen4), made_up_studies.race(machine={"llvm_processor": "znver5"})]
    table = cost_ratio.table(cost_ratio.ratios(frame.cases(runs)), "title")
    assert table is not None
    assert [row[1] for row in table.rows] == ["Zen 4, 256-bit, restricted to AVX2", "Zen 5"]
    assert "without AVX-512" in table.note


@pytest.fixture(scope="module")
def walks(tmp_path_factory):
    return gather([made_up_studies.endurance(tmp_path_factory.mktemp("walks"), failed=1)])


def test_the_growth_of_an_error_has_rms_power_drift_and_time(walks):
    table = growth.by_case(walks.frame, walks.series)
    assert table is not None
    assert table.flat_head[2:5] == ["rms after: 10000", "rms after: 100000", "rms after: 1e+06"]
    ours, peer = table.rows
    assert (ours[1], peer[1]) == ("16", "15, 1 failed")
    assert ours[5] == "grows"
    assert 0.3 < float(ours[6].partition(" ")[0]) < 0.7  # measured 0.52
    assert (ours[-1], peer[-1]) == ("1", "18")
    assert growth.energy_rms(walks.series[walks.records[0].id]) == pytest.approx(float(ours[4]), rel=0.05)
    assert growth.by_case(walks.frame, {}) is not None  # the fits are in the rows


def test_goals_are_reached_by_an_unbiased_walk_and_missed_by_a_biased_one(walks, tmp_path):
    drifting = gather([made_up_studies.endurance(tmp_path, bias=1e-17)])

    def judged(results, words):
        found = verdicts(results.runs[0].index.campaign, results.records)
        return [goal.verdict for goal in found if goal.words.startswith(words)]

    assert judged(walks, "a year's step") == ["reached", "reached"]
    assert judged(drifting, "a year's step") == ["missed", "missed"]
    assert set(judged(walks, "half a year's step")) == {"missed"}  # that step was not run


def test_a_small_drift_is_a_drift_all_the_same(tmp_path):
    """Sixteen ends of one sign: below the rms allowed, and no random walk."""
    results = gather([made_up_studies.endurance(tmp_path, bias=-3e-20)])
    table = growth.by_case(results.frame, results.series)
    assert table is not None
    assert table.rows[0][5].startswith("drifts")
    assert "0 of 16 positive" in table.rows[0][7]
    assert "more than 3 standard errors from 0; without a drift, chance exceeds this in 0.9 %" in table.note
