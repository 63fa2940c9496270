"""The race of HBVM without settings."""

import msgspec
import pytest

from hbvm_bench.campaign.identity import is_ours, resolve
from hbvm_bench.cli import main
from hbvm_bench.report.page import gather
from hbvm_bench.store.records import Timing
from hbvm_bench.store.store import Index, Store
from hbvm_bench.store.stored_run import StoredRun
from hbvm_bench.studies import automatic
from problems.errors import InputError, UnknownNameError
from tests.hbvm_bench.made_up_run import record, timed


def made(machine, ratio=2.0, problem="kepler", worse=1.0):
    """Return a run of two rounds on one problem."""
    campaign = automatic.campaign([problem], 2)
    records = []
    cases = [resolve(case) for case in campaign.cases()]
    for case in cases:
        ours = is_ours(case.method)
        times = [1.0, 1.1] if ours else [ratio, 1.1 * ratio]
        metrics = {
            "energy_max": 1e-15 * (worse if ours else 2.0),
            "position_mean": 1e-12 * (1.0 if ours else 2.0),
            "steps": 10.0,
        }
        records.append(
            record(case, times, metrics=metrics, timing=Timing(rounds=timed(times), machine=machine))
        )
    index = Index(
        campaign=campaign, ids=[one.id for one in records], version="0", command="hbvm-bench automatic"
    )
    return StoredRun(index=index, records=records)


def test_both_sides_are_measured_on_the_same_trajectory_and_a_rerun_does_nothing(
    tmp_path, monkeypatch, capsys
):
    pytest.importorskip("heyoka")
    monkeypatch.chdir(tmp_path)
    assert main(["automatic", "henon_heiles", "--rounds", "2", "--out", "kept"]) == 0
    store = Store(tmp_path / "runs" / "automatic")
    (run,) = gather([store]).runs
    (pair,) = automatic.head_to_heads(run)
    for side in (pair.ours, pair.theirs):
        metrics = side.result.metrics
        assert 0.0 < metrics["energy_max"].value < 1e-12  # measured 1e-14 to 5e-14
        assert 0.0 < metrics["position_mean"].value < 1e-9  # measured 2e-12 to 7e-12
        assert [len(one.samples) for one in side.timing.rounds] == [1, 1]
        (repeats,) = {one.repeats for one in side.timing.rounds}
        assert repeats * side.timing.summary["min"] > 0.01  # 0.02 asked for; a busy first run gives fewer
    assert pair.ours.result.counters.steps < pair.theirs.result.counters.steps / 3
    assert pair.ratio.low <= pair.ratio.median <= pair.ratio.high
    assert (pair.words == "reached") == (pair.ratio.median >= pair.verdict.goal.ratio)
    capsys.readouterr()
    assert main(["automatic", "henon_heiles", "--rounds", "2", "--out", "kept"]) == 0
    said = capsys.readouterr().err
    assert "2, 2 already there" in said
    assert "timing" not in said


def test_other_problems_and_too_few_rounds_are_refused(capsys):
    with pytest.raises(UnknownNameError, match="'toda'"):
        automatic.campaign(["toda"])
    with pytest.raises(InputError, match="rounds must be at least 2, not 1"):
        automatic.campaign(["kepler"], 1)
    assert main(["automatic", "keppler"]) == 2
    assert "did you mean 'kepler'" in capsys.readouterr().err


def test_a_side_that_is_less_accurate_is_told():
    ahead, behind = (automatic.head_to_heads(made({}, 3.0, worse=worse))[0] for worse in (1.0, 3.0))
    assert (ahead.words, behind.words) == ("reached", "less accurate")
    assert behind.ratio.median == 3.0


def test_a_problem_without_a_goal_is_shown_with_its_ratio():
    run = made({"llvm_processor": "x"}, 3.0, problem="pendulum")
    (pair,) = automatic.head_to_heads(run)
    assert (pair.goal, pair.words) == ("–", "")
    assert automatic.ratios({"x": [run]}).rows[0][2:] == ("–", "3.00×")


def test_a_side_on_another_trajectory_has_no_ratio():
    run = made({}, 3.0)
    theirs, ours = run.records
    result = msgspec.structs.replace(theirs.result, violation="another trajectory")
    lost = msgspec.structs.replace(theirs, result=result, timing=Timing(machine={}, why="lost"))
    (pair,) = automatic.head_to_heads(msgspec.structs.replace(run, records=[lost, ours]))
    assert pair.ratio is None
    assert pair.words == "not compared"
