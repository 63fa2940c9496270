import json
import signal
import subprocess
import sys
import time

import pytest

from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.cli import main
from hbvm_bench.measure import timing
from hbvm_bench.studies.race import truth
from hbvm_bench.studies.race.accuracy import prepare
from hbvm_bench.studies.race.contests import CONTESTS
from hbvm_bench.studies.race.results import Setting
from hbvm_bench.studies.race.rounds import time_rounds

KEPLER = make_problem(CONTESTS["kepler"].problem)
END = 315.0


def prepared(method, family="hbvm", problem=KEPLER, end=END):
    return prepare(problem, Setting(family=family, method=method), truth.known(problem), end)


@pytest.fixture(scope="module")
def entries():
    pytest.importorskip("heyoka")
    return [
        prepared("Gauss(s=8, h=0.125)"),
        prepared("Taylor(tol=1e-14, compact_mode=True)", "heyoka"),
        prepared("WHFast(h=0.1)", "whfast"),
        prepared("IAS15()", "ias15", make_problem(CONTESTS["pendulum"].problem), 1200.0),
    ]


def test_a_setting_has_both_errors_and_counters(entries):
    ours, taylor = entries[0].outcome, entries[1].outcome
    assert ours.status == taylor.status == "finished"
    assert ours.energy < 1e-13  # measured 7e-15
    assert ours.position < 1e-10  # measured 6e-13
    assert taylor.energy < 1e-13  # measured 3e-15
    assert taylor.position < 1e-11  # measured 5e-14
    assert ours.steps == 2520
    assert ours.evaluations > 0
    assert taylor.evaluations is None
    assert ours.samples > 300
    assert ours.call_seconds > 0


def test_what_does_not_apply_is_a_row_with_its_reason(entries):
    refused = entries[2]
    assert refused.run is None
    assert refused.outcome.status == "refused"
    assert "bodies" in refused.outcome.reason


def test_a_failing_setting_is_a_row_with_its_status(entries):
    assert entries[3].run is None
    # at the bottom of the swing the acceleration is 0, and IAS15's default criterion stalls
    assert entries[3].outcome.status == "stalled"
    assert entries[3].outcome.reason


def test_rounds_give_every_setting_its_samples_and_leave_out_the_rest(entries):
    told = []
    outcomes, calibration, load = time_rounds(entries, 2, told.append)
    assert told == [0, 1]
    assert len(calibration) == 2
    assert min(calibration) > 0
    for outcome in outcomes[:2]:
        assert len(outcome.taken) == 2
        assert min(outcome.taken) > 0
        assert outcome.repeats >= 1
        assert outcome.untimed == ""
    assert outcomes[2].taken == []
    assert outcomes[2].untimed == "did not finish"
    assert load is None or load.others >= 0


def test_a_run_that_left_the_axis_is_void_and_not_timed():
    problem = make_problem("sitnikov(e=0.75, t_end=6000.0)")
    outcome = prepare(
        problem, Setting(family="hbvm", method="Gauss(s=2, h=0.5)"), truth.known(problem), 600.0
    ).outcome
    # Gauss(2) at this step keeps the symmetry, so that its guard is 0, and loses the planetoid
    assert outcome.guard == 0.0
    assert outcome.void == ""
    assert outcome.position is None or outcome.position > 0.1


def test_timing_takes_the_integration_alone_and_restores_garbage_collection():
    import gc

    from integrators import Gauss

    problem = make_problem("kepler(e=0.6, t_end=3.0)")
    run = timing.Run.of(problem, Gauss(s=4, h=0.1))
    seconds, samples = run.seconds(3)
    assert seconds > 0
    assert samples.t.tolist() == [3.0]
    assert gc.isenabled()
    assert run.until(0.1).t_end == pytest.approx(0.3)


@pytest.mark.parametrize(("seconds", "repeats"), [(1.0, 1), (0.02, 1), (0.01, 3), (1e-3, 24)])
def test_short_runs_are_repeated_until_a_sample_is_long_enough(seconds, repeats):
    assert timing.repeats_for(seconds, 0.02) == repeats


def test_the_quick_race_runs_and_prints_json(tmp_path, capsys):
    pytest.importorskip("heyoka")
    arguments = ["race", "--quick", "--problem", "kepler", "--rounds", "2", "--json", "--out", str(tmp_path)]
    assert main(arguments) == 0
    data = json.loads(capsys.readouterr().out)
    assert [race["contest"]["key"] for race in data["races"]] == ["kepler"]
    assert {ratio["peer"] for ratio in data["ratios"]} == {"heyoka", "ias15", "leapfrog", "dop853"}
    assert {path.name for path in tmp_path.iterdir()} == {
        *("kepler.json", "README.md", "index.html", "figures", "data")
    }
    assert str(tmp_path) not in (tmp_path / "README.md").read_text()
    assert main(["race", "--redraw", "--out", str(tmp_path)]) == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--problem", "keppler"], "kepler"),
        (["--rounds", "1"], "rounds"),
        (["--redraw", "--out", "/nowhere/at/all"], "no result"),
        (["--out", "/proc/nowhere"], "cannot write"),
        (["--speed"], "speed"),
    ],
)
def test_what_cannot_be_used_is_one_sentence_and_exit_code_2(arguments, words, capsys):
    assert main(["race", *arguments]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


def test_the_settings_are_printed_without_running(capsys):
    assert main(["race", "--settings", "--problem", "kepler"]) == 0
    said = capsys.readouterr().out
    assert "Gauss(s=16, h=0.5)" in said
    assert "heyoka, Taylor, 16" in said


def test_ctrl_c_ends_the_race_at_once_with_130(tmp_path):
    command = [
        sys.executable,
        "-m",
        "hbvm_bench.cli",
        "race",
        "--problem",
        "sitnikov",
        "--out",
        str(tmp_path),
    ]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as race:
        assert race.stderr is not None
        for line in race.stderr:
            if line.startswith("sitnikov: ") and line.endswith("settings\n"):
                break  # the child has begun
        race.send_signal(signal.SIGINT)
        begun = time.monotonic()
        said = race.stderr.read()
        assert race.wait(timeout=20) == 130
    assert time.monotonic() - begun < 10
    assert "interrupted" in said
    assert "Traceback" not in said
