"""What a campaign asks for, and the verdict on what was measured."""

import pytest
from msgspec.structs import replace

from hbvm_bench.campaign.file import Campaign, Goal, MethodEntry, ProblemEntry, parse
from hbvm_bench.commands.run import dated
from hbvm_bench.store.records import Load, Value
from hbvm_bench.store.store import Index, Store
from hbvm_bench.summaries import goals, standings
from problems.errors import InputError, UnknownNameError
from tests.hbvm_bench import made_up_run

PROBLEM = "kepler(e=0.6)"
TIGHT = {"energy_max": 1e-13, "position_end": 1e-10}


def record(method, times, energy, position, **more):
    """Return a record timed in interleaved rounds."""
    metrics = {"energy_max": energy, "position_end": position}
    return made_up_run.record(method, times, problem=PROBLEM, metrics=metrics, **more)


RECORDS = [
    record("Gauss(s=8, h=0.2)", [0.9, 1.0, 1.2], 2e-12, 1e-9),
    record("Gauss(s=8, h=0.1)", [1.8, 2.0, 2.4], 5e-14, 5e-11),
    record("HBVM(k=16, s=8, h=0.2)", [1.4, 1.5, 1.6], 1e-14, 1e-8),
    record("Taylor(tol=1e-12)", [13.0, 15.0, 17.0], 3e-11, 2e-8),
    record("Taylor()", [27.0, 30.0, 36.0], 2e-15, 1e-12, settings="default"),
    record("IAS15()", [5.0, 5.0, 5.0], 1e-15, 1e-12, violation="another trajectory"),
    record("WHFast(h=0.1)", [None, 6.0, None], 5e-11, 3e-9),
    record("DOP853()", [50.0, 50.0, 50.0], 1e-14, Value(why="no reference")),
]


def judged(goal, records=RECORDS, **entry):
    campaign = Campaign(
        name="x",
        problems=[ProblemEntry(use=PROBLEM, within=entry.pop("within", TIGHT), **entry)],
        methods=[MethodEntry(use=one.case.method) for one in records],
        goals=[goal],
    )
    (found,) = goals.verdicts(campaign, records)
    return found


def test_a_ratio_is_reached_by_the_fastest_that_are_accurate_in_both():
    found = judged(Goal(against="Taylor", ratio=14.9))
    assert (found.verdict, found.why) == ("reached", "")
    # faster ones of ours have too large an energy or a position error
    assert found.comparison.ours.case.method == "Gauss(s=8, h=0.1)"
    assert found.comparison.theirs.case.method == "Taylor()"
    assert found.measured == "15.0× (15.0–15.0)"


def test_a_larger_ratio_is_missed():
    assert judged(Goal(against="Taylor", ratio=15.1)).verdict == "missed"


def test_energy_alone_ranks_nobody():
    found = judged(Goal(against="Taylor", ratio=1.0, within={"energy_max": 1e-10}))
    assert (found.verdict, found.why) == ("excluded", "energy is not ranked without position")
    said = judged(Goal(against="Taylor", ratio=1.0, within={"energy_max": 1e-10}, alone="chaos"))
    assert said.verdict == "reached"


def test_a_peer_on_another_trajectory_or_without_a_position_is_not_compared():
    for peer in ("IAS15", "DOP853"):
        found = judged(Goal(against=peer, ratio=1.0))
        assert (found.verdict, found.why) == ("missed", "no setting of the other library is as accurate")


def test_a_goal_may_ask_ours_to_be_no_worse_than_the_peer():
    within = {"energy_max": 1e-10}
    found = judged(Goal(against="WHFast", ratio=5.9, within=within, no_worse={"position_end": 1.0}))
    # HBVM(16, 8) has the better energy, but a position error above WHFast's 3e-9
    assert found.comparison.ours.case.method == "Gauss(s=8, h=0.2)"
    assert found.verdict == "reached"
    assert found.measured == "6.00×"  # of the one round that both took part in


def test_where_none_of_ours_is_as_accurate_there_is_no_ratio():
    found = judged(Goal(against="Taylor()", ratio=1.0, no_worse={"energy_max": 1.0, "position_end": 1.0}))
    assert (found.verdict, found.measured) == ("missed", "–")
    assert found.why == "no setting of HBVM and Gauss is as accurate"


def test_a_number_of_ours_is_at_most_what_is_asked():
    assert judged(Goal(metric="energy_max", at=1e-13, method="Gauss(s=8, h=0.1)")).verdict == "reached"
    assert judged(Goal(metric="energy_max", at=1e-14, method="Gauss")).verdict == "missed"
    absent = judged(Goal(metric="position_end", at=1.0, method="DOP853"))
    assert (absent.verdict, absent.why) == ("missed", "no reference")


def test_a_goal_is_about_the_problems_it_names():
    text = """
name = "x"
methods = [{ use = ["Gauss(s=4, h=0.1)", "Taylor()"] }]
[[problems]]
use = "kepler(e=0.6)"
name = "round"
[[problems]]
use = "pendulum()"
[[goals]]
against = "Taylor"
ratio = 2
only = ["{}"]
"""
    campaign = parse(text.replace("{}", "round"))
    (found,) = goals.verdicts(campaign, RECORDS)
    assert found.entry.name == "round"
    with pytest.raises(InputError, match="did you mean 'round'"):
        parse(text.replace("{}", "rounds"))
    with pytest.raises(UnknownNameError, match="energy_max"):
        judged(Goal(metric="energy_mx", at=1.0))


@pytest.mark.parametrize(
    "given", [{}, {"at": 1.0, "ratio": 2.0}, {"ratio": 2.0}, {"at": 1.0, "against": "Taylor"}]
)
def test_a_goal_has_a_number_of_its_own_or_a_ratio_to_a_peer(given):
    with pytest.raises(InputError, match="either at=, or against= and ratio="):
        Goal(**given)


def test_a_ratio_lies_within_its_quartiles():
    """Where a machine changes its speed during the rounds, the ratio of the medians does not."""
    ours = record("Gauss(s=8, h=0.1)", [1.0, 1.0, 2.0, 2.0, 2.0], 1e-14, 1e-12)
    theirs = record("Taylor()", [3.0, 3.0, 3.0, 6.0, 6.0], 1e-14, 1e-12)
    ratio = standings.compare(ours, theirs).ratio
    # of the medians 1.5; of the rounds 3, 3, 1.5, 3, 3
    assert ratio.low <= ratio.median <= ratio.high
    assert ratio.median == 3.0


def test_the_rounds_that_choose_a_setting_do_not_compare_it():
    """A setting that was lucky in the rounds that choose is chosen, and its luck is not in the ratio."""
    lucky = record("Gauss(s=8, h=0.1)", [1.0, 4.0, 4.0, 1.0], 1e-14, 1e-12)
    steady = record("Gauss(s=8, h=0.2)", [2.0, 2.0, 2.0, 2.0], 1e-14, 1e-12)
    theirs = record("Taylor()", [8.0, 8.0, 8.0, 8.0], 1e-14, 1e-12)
    found = judged(Goal(against="Taylor", ratio=3.0), [lucky, steady, theirs])
    assert found.comparison.ours.case.method == "Gauss(s=8, h=0.1)"
    assert (found.measured, found.verdict) == ("2.00× (2.00–2.00)", "missed")
    assert not found.comparison.chosen_by_them


def test_a_single_round_says_that_it_chose_what_it_compares():
    ours = [record(f"Gauss(s=8, h={h})", [1.0], 1e-14, 1e-12) for h in (0.1, 0.2)]
    found = judged(Goal(against="Taylor", ratio=3.0), [*ours, record("Taylor()", [8.0], 1e-14, 1e-12)])
    assert found.verdict == "reached"
    assert found.why == "from the rounds that chose the settings: there are no others"


@pytest.mark.parametrize("load", [Load(others=0.4, steal=0.0), Load(others=0.0, steal=0.2)])
def test_a_speed_measured_beside_other_work_is_not_judged(load):
    def loaded(one):
        return replace(one, timing=replace(one.timing, load=load))

    records = [*map(loaded, RECORDS)]
    for ratio in (1.0, 100.0):  # neither reached nor missed
        found = judged(Goal(against="Taylor", ratio=ratio), records)
        assert found.verdict == "not judged"
        assert found.why == f"other work took {max(load.others, load.steal):.0%} of a core during the timing"
    assert judged(Goal(at=100.0, method="Gauss(s=8, h=0.1)"), records).verdict == "not judged"
    energy = Goal(metric="energy_max", at=1e-13, method="Gauss(s=8, h=0.1)")
    assert judged(energy, records).verdict == "reached"


@pytest.mark.parametrize(
    ("declared", "measured", "said"),
    [
        ("", "", "not recorded"),
        ("2026-11-20", "", "2026-11-20"),
        ("2026-11-20", "2026-11-20T10:00:00+00:00", "2026-11-20"),
        ("2026-11-20T09:00", "2026-11-20T10:00:00+00:00", "2026-11-20"),
        ("2026-11-21", "2026-11-20T10:00:00+00:00", "2026-11-21, after the first measurement"),
        ("2026-11-20T11:00", "2026-11-20T10:00", "2026-11-20, after the first measurement"),
    ],
)
def test_a_goal_says_when_it_was_declared(declared, measured, said):
    found = judged(Goal(against="Taylor", ratio=1.0, declared=declared, measured=measured))
    assert found.declared == said
    assert goals.table([found]).rows[0][2] == said


def test_a_date_that_is_none_is_refused():
    with pytest.raises(InputError, match="declared='soon' of a goal must be a date such as"):
        Goal(at=1.0, declared="soon")


def test_a_run_keeps_the_dates_of_its_goals_and_says_which_came_after_a_measurement(tmp_path):
    store = Store(tmp_path)
    store.prepare()
    first, later = Goal(at=1.0), Goal(at=2.0, words="later")
    campaign = Campaign(
        name="x", problems=[PROBLEM], methods=[MethodEntry(use="Gauss(s=8, h=0.1)")], goals=[first]
    )

    def ran(campaign):
        asked = dated(campaign, store)
        store.write_index(Index(campaign=asked, ids=["0" * 64], version="0", command=""))
        return asked.goals

    (before,) = ran(campaign)
    assert before.declared
    assert not before.measured
    measured = record("Gauss(s=8, h=0.1)", [1.0], 1e-14, 1e-12)
    store.save(replace(measured, id="0" * 64, finished="2026-01-01T00:00:00+00:00"))
    again, new = ran(replace(campaign, goals=[first, later]))
    assert again == before
    assert (new.measured, goals.is_after(new.declared, new.measured)) == ("2026-01-01T00:00:00+00:00", True)
