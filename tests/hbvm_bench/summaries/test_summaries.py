import math
from functools import partial

from msgspec.structs import replace

from hbvm_bench.campaign.file import Ensemble, Grid
from hbvm_bench.report.figures.style import looks
from hbvm_bench.store.records import Compile, ErrorGrowth, Load, Timing, TimingRound, Value
from hbvm_bench.summaries import growth, needs, outcomes, points, rows, standings
from tests.hbvm_bench import made_up_run


def record(method, problem="kepler()", seconds=1.0, position=1e-9, energy=1e-14, **more):
    metrics = {
        "warm_seconds": seconds,
        "position_end": position,
        "phase_end": position,
        "energy_max": energy,
        "distance_max": 1.0,
    }
    fields = {"metrics": metrics, "settings": "recommended", "versions": {"heyoka": "7.13"}} | more
    library = "heyoka" if method.startswith("Taylor") else "hbvm-bench"
    return made_up_run.record(method, problem=problem, library=library, **fields)


RUN = [
    record("Gauss(s=2, h=0.1)", seconds=1.0, position=1e-3),
    record("Gauss(s=8, h=0.1)", seconds=2.0, position=1e-9),
    record("Gauss(s=8, h=0.01)", seconds=20.0, position=1e-8),
    record("Taylor()", seconds=1.0, position=1e-9, energy=1e-12),
    record("Gauss(s=8, h=0.1)", problem="pendulum()", seconds=1.0),
    record("Taylor()", problem="pendulum()", seconds=8.0),
    record("Gauss(s=8, h=0.1)", problem="toda()", position=0.5),
    record("Taylor()", problem="toda()", violation="another trajectory"),
]


def test_the_front_is_what_nothing_beats_in_both():
    families = points.by_family(points.by_problem(RUN)["kepler()"])
    places = [
        tuple(points.number(one, key) for key in ("warm_seconds", "position_end"))
        for one in families["Gauss"]
    ]
    assert points.pareto_front(places, lambda place: place) == [(1.0, 1e-3), (2.0, 1e-9)]
    assert list(families) == ["Gauss", "Taylor"]
    assert points.work_of(RUN) == "warm_seconds"
    assert points.work_of([]) == "evaluations"


def test_an_ensemble_is_in_no_summary_of_single_trajectories():
    many = record("Taylor()", ensemble=Ensemble(count=3))
    assert points.by_problem([many]) == {}
    assert outcomes.matrix([many]) == ([], {})


def test_a_problem_with_two_grids_has_two_tables():
    both = [record("Gauss(s=8, h=0.1)"), record("Taylor()")]
    other = [replace(one, case=replace(one.case, grid=Grid(count=7, also=[0.5]))) for one in both]
    found = rows.tasks([*both, *other])
    assert list(found.values()) == [both, other]
    assert list(points.by_problem([*both, *other])) == [
        "kepler(), sampled with the usual grid",
        "kepler(), sampled with count=7, also=[0.5]",
    ]
    assert list(points.by_problem(both)) == ["kepler()"]


def factors(records, within, cost):
    return needs.factors(records, needs.Need("", partial(points.accurate, within=within), cost))


def test_factors_to_the_best_are_infinite_where_a_family_does_not_reach_the_accuracy():
    assert factors(RUN, {"position_end": 1e-8}, "warm_seconds") == {"Gauss": [2.0, 1.0], "Taylor": [1.0, 8.0]}
    tight = factors(RUN, {"position_end": 1e-8, "energy_max": 1e-13}, "warm_seconds")
    assert tight["Taylor"] == [math.inf, 8.0]


def test_a_problem_on_which_a_family_did_not_run_is_not_one_that_it_failed_to_solve():
    refused = record("IAS15()", outcome="refused", status="", metrics={})
    alone = record("IAS15()", problem="toda()", seconds=1.0, position=1e-9)
    found = factors([*RUN, refused, alone], {"position_end": 1e-8}, "warm_seconds")
    assert [math.isnan(one) for one in found["IAS15"]] == [True, True, False]
    assert found["Gauss"][2] == math.inf  # it ran on toda()
    rows = dict(row[:2] for row in needs.table([*RUN, refused, alone]).rows)
    assert "IAS15 (1 of 1)" in rows["position error ≤ 1e-8, least time"]


def test_a_family_without_the_count_that_is_compared_has_not_failed():
    right = {"position_end": Value(value=1e-9)}
    counted = record("DOP853()", metrics=right | {"evaluations": Value(value=7.0)})
    none = record("Taylor()", metrics=right)
    assert factors([counted, none], {"position_end": 1e-4}, "evaluations") == {"DOP853": [1.0]}


def test_needs_name_the_families_near_the_best_most_often():
    rows = {title: rest for title, *rest in needs.table(RUN).rows}
    said = "Gauss (2 of 2, 1.5× slower); Taylor (1 of 2, 4.5× slower)"
    assert rows["position error ≤ 1e-8, least time"] == [said, "2"]
    assert "smallest time-reversal error" not in rows


def test_the_matrix_says_what_the_best_setting_did_and_why_others_did_not():
    families, rows = outcomes.matrix(
        [
            *RUN,
            record("IAS15()", outcome="stalled", status="stalled", reason="dt shrinks", metrics={}),
            record("WHFast(h=1)", outcome="refused", status="", reason="no bodies", metrics={}),
        ]
    )
    assert families == ["Gauss", "Taylor", "IAS15", "WHFast"]
    assert rows["kepler()"]["Gauss"] == outcomes.Outcome("on", 3, 3, [])
    assert rows["kepler()"]["IAS15"].state == "ended"
    assert rows["kepler()"]["WHFast"] == outcomes.Outcome("refused", 0, 1, ["refused: no bodies"])
    assert rows["toda()"]["Taylor"].state == "off"
    assert rows["toda()"]["IAS15"].state == "absent"


def test_growths_are_counted_by_family_on_the_trajectory_only():
    kept = {
        "energy": ErrorGrowth(kind="bounded", floor=1e-9, starts=16),
        "angular_momentum": ErrorGrowth(kind="power", starts=16),
    }
    run = [record("Gauss(s=2, h=0.1)", growth=kept), record("Taylor()", growth=kept, violation="lost")]
    assert growth.by_method(run) == {"Gauss": [kept["energy"]]}


def test_powers_of_t_are_told_by_their_exponents_and_not_by_names():
    found = [
        ErrorGrowth(kind="power", slope=0.54, starts=16),
        ErrorGrowth(kind="power", slope=0.53, starts=16),
    ]
    made = growth.by_family(
        [record(f"Gauss(s={s}, h=0.1)", growth={"energy": one}) for s, one in enumerate(found, 1)]
    )
    assert made is not None
    assert made.head == ("method", "bounded", "t^a", "exp t", "drift", "not clear", "a")
    assert made.rows == [("Gauss", "–", "2", "–", "–", "–", "0.54 (0.53 to 0.54)")]
    assert made.note.endswith("A root mean square over 16 initial conditions has an uncertainty of ±18 %.")


def test_a_growth_from_fewer_than_sixteen_starts_is_not_clear():
    few = ErrorGrowth(kind="power", slope=0.5, slope_low=0.4, slope_high=0.6, starts=15)
    enough = replace(few, starts=16)
    assert growth.clear(enough) is enough
    assert growth.clear(few).why == "not clear from 15 initial conditions"
    assert growth.clear(ErrorGrowth(kind="bounded", starts=1)).why == "not clear from 1 initial condition"
    made = growth.by_family([record("Taylor()", growth={"energy": few})])
    assert made is not None
    assert made.rows == [("Taylor", "–", "–", "–", "–", "1", "–")]


def test_no_drift_is_a_growth_whose_interval_has_that_of_unbiased_rounding():
    def found(low, starts=16):
        fitted = ErrorGrowth(kind="power", slope=0.55, slope_low=low, slope_high=0.6, starts=starts)
        return needs._without_drift(record("Taylor()", growth={"energy": fitted}))

    assert [found(0.45), found(0.51), found(0.45, starts=15)] == [True, False, False]


def test_fairness_counts_settings():
    run = [record("Gauss(s=2, h=0.1)"), record("Taylor()", settings="default")]
    assert "every method has 1 setting" in outcomes.sentences(run)[0]
    unequal = [*run, record("Gauss(s=4, h=0.1)")]
    assert "Gauss 2, Taylor 1" in outcomes.sentences(unequal)[0]


def test_times_of_a_busy_machine_are_doubtful():
    def timed(calibration, load=None):
        compiled = Compile(seconds=0.0, cached=None)
        one = TimingRound(samples=[1.0], repeats=1, compile=compiled, calibration=calibration)
        return record("Taylor()", timing=Timing(rounds=[one], load=load))

    assert outcomes.doubts([timed([0.01, 0.01, 0.01, 0.01])]) == []
    (loaded,) = outcomes.doubts([timed([], load=Load(others=0.57, steal=0.0))])
    assert "used 57% of a core, and the steal time was 0% of one; the times are doubtful" in loaded
    (quiet,) = outcomes.doubts([timed([], load=Load(others=0.1, steal=0.0))])
    assert "doubtful" not in quiet
    assert "not steady" in outcomes.doubts([timed([0.01, 0.01, 0.03, 0.03])])[0]
    assert "Nothing was timed" in outcomes.doubts([record("Taylor()")])[0]
    slow = record("Radau(rtol=1, atol=1)", outcome="timeout", status="", metrics={})
    assert "time limit ended 1 cases (Radau 1)" in " ".join(outcomes.doubts([slow]))


def test_a_projection_onto_the_energy_is_a_family_of_its_own():
    """It is none of HBVM's settings: not in a comparison of HBVM and Gauss, and not in HBVM's column."""
    projected = made_up_run.record("HBVM(tol=1e-06, projection='energy')")
    ours = made_up_run.record("HBVM(tol=1e-06)")
    assert [points.family_of(each) for each in (ours, projected)] == ["HBVM", points.PROJECTION]
    assert standings.among([projected, ours], "") == standings.among([projected, ours], "HBVM") == [ours]
    assert standings.among([projected, ours], points.PROJECTION) == [projected]
    assert looks([points.PROJECTION])[points.PROJECTION].light != looks(["HBVM"])["HBVM"].light
