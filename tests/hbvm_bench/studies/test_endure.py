import json
from pathlib import Path

import msgspec
import numpy as np
import pytest

from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.cli import main
from hbvm_bench.measure import drift
from hbvm_bench.report.markdown import plain
from hbvm_bench.report.write import write
from hbvm_bench.studies.endure import law, report, runs
from hbvm_bench.studies.endure.runs import Endurance, Trajectory
from problems.errors import InputError

PROBLEM = make_problem("outer_solar_system(t_end=1000.0)")
PEER = "Taylor(tol=1e-16)"


def made(years=1e6, starts=8, size=1e-17, bias=0.0):
    """Return a result with random walks for errors."""
    t = runs.sample_times(years)
    rng = np.random.default_rng(7)
    trajectories = []
    for start in range(starts):
        for method, seconds in ((runs.OURS, 0.5), (PEER, 9.0)):
            walk = np.cumsum(rng.standard_normal(t.size) * np.sqrt(np.diff(t, prepend=0.0)))
            errors = (size * walk + bias * t).tolist()
            trajectories.append(
                Trajectory(
                    method=method, start=start, status="finished", seconds=seconds, errors=errors, steps=9
                )
            )
    return Endurance(
        problem="outer_solar_system(t_end=1000000.0)",
        years=years,
        starts=starts,
        methods=[runs.OURS, PEER],
        perturbation=runs.PERTURBATION,
        t=t.tolist(),
        trajectories=trajectories,
        machine={"processor": "one"},
        versions={"numpy": "2"},
        command="hbvm-bench endure",
        started="2026-01-02T03:04:05+00:00",
    )


def test_samples_are_whole_years_with_the_powers_of_ten():
    t = runs.sample_times(1e6)
    assert np.array_equal(t, np.rint(t))
    assert {1e4, 1e5, 1e6} <= set(t.tolist())
    assert np.all(np.diff(t) > 0)


def test_the_first_start_is_the_problems_own_and_the_others_are_near_it():
    assert np.array_equal(runs.perturbed(PROBLEM, 0), PROBLEM.y0)
    others = np.array([runs.perturbed(PROBLEM, n) for n in range(1, 9)])
    change = others / PROBLEM.y0 - 1.0
    assert np.max(np.abs(change)) <= 1.0001e-6
    assert len({row.tobytes() for row in others}) == 8
    assert np.mean(np.abs(change)) > 3e-7


def test_errors_have_signs_and_the_size_that_the_problem_says():
    y = PROBLEM.y0 * (1.0 + np.array([[1e-9], [-1e-9]]))
    signed = runs.signed_errors(PROBLEM, PROBLEM.y0, y)
    assert np.allclose(np.abs(signed), PROBLEM.errors(y)["energy"], rtol=1e-12)
    assert signed[0] * signed[1] < 0


def test_goals_are_reached_by_an_unbiased_walk_and_missed_by_a_biased_one():
    fine = law.goals(made())
    assert [goal.reached for goal in fine] == [True, True, True, True]
    drifting = law.goals(made(bias=1e-17))
    assert [goal.reached for goal in drifting] == [False, False, False, True]


def test_a_drift_below_the_allowed_rate_is_a_drift_all_the_same():
    """Eight ends of one sign, five standard errors from 0: within the rate, and no random walk."""
    result = made(bias=-3e-20)
    small, allowed, within, _ = law.goals(result)
    assert (small.reached, allowed.reached, within.reached) == (True, True, False)
    assert "mean within 3 of its standard errors" in within.words
    ours, _ = law.lines(result)
    assert ours.drift is not None
    assert ours.drift.law == "drift"
    (table, _) = report.tables(result)
    assert "0 of 8 positive" in str(table.rows[0])
    assert (
        "more than 3 of its standard errors from 0; of errors that do not drift, chance puts 2 %"
        in table.note
    )


def test_the_stored_report_says_what_its_own_numbers_say():
    stored = Path(__file__).parents[3] / "reports" / "endure"
    result = runs.load(stored)
    page = (stored / "README.md").read_text(encoding="utf-8")
    for line in law.lines(result):
        assert line.drift is not None
        assert line.drift.law is not None
        row = next(
            text
            for text in page.splitlines()
            if text.replace("`", "").startswith((f"| {line.method} ", f"| {plain(line.method)} "))
        )
        assert drift.LAWS[line.drift.law] in row
    ours = law.lines(result)[0].drift
    assert ours is not None
    if ours.law == "drift":
        readme = (stored.parents[1] / "README.md").read_text(encoding="utf-8")
        assert "grows like the square root of time" not in readme


def test_a_short_run_has_no_goals():
    assert law.goals(made(years=1e4)) == []


def test_the_lines_have_rms_law_and_speed():
    ours, peer = law.lines(made())
    assert set(ours.rms) == {1e4, 1e5, 1e6}
    assert ours.drift is not None
    assert ours.drift.law == "square root"
    assert peer.times_ours == pytest.approx(18.0)


def test_a_stored_result_is_read_back_equal(tmp_path):
    result = made(years=1e4, starts=3)
    runs.save(result, tmp_path)
    assert runs.load(tmp_path) == result


@pytest.mark.parametrize("content", [b"", b"{}", b"[1]"])
def test_a_file_that_is_no_result_is_refused(content, tmp_path):
    (tmp_path / runs.FILE).write_bytes(content)
    with pytest.raises(InputError, match="not the result of endure"):
        runs.load(tmp_path)


def test_a_failed_trajectory_is_counted_and_not_averaged():
    result = made(years=1e4, starts=3)
    failed = Trajectory(method=PEER, start=3, status="stalled", reason="stood still")
    peer = law.lines(msgspec.structs.replace(result, trajectories=[*result.trajectories, failed]))[1]
    assert (peer.starts, peer.failed) == (3, 1)


def test_the_report_names_what_was_run_and_is_deterministic(tmp_path):
    result = made(years=1e5, starts=3)
    first = write(report.document(result), tmp_path / "a")[0].read_bytes()
    assert write(report.document(result), tmp_path / "b")[0].read_bytes() == first
    for name in ("index.html", "figures/endure.svg", "figures/endure.png", "data/endure.csv"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    assert b"Gauss(s=8, h=1.0)" in first


def test_endure_runs_prints_json_and_redraws(tmp_path, capsys):
    arguments = ["endure", "--years", "200", "--starts", "2", "-m", "Gauss(s=8, h=1.0)", "-m", "IAS15()"]
    assert main([*arguments, "--json", "--out", str(tmp_path)]) == 0
    data = json.loads(capsys.readouterr().out)
    assert [line["method"] for line in data["lines"]] == ["Gauss(s=8, h=1.0)", "IAS15()"]
    for line in data["lines"]:
        assert line["starts"] == 2
        assert line["rms"]["200"] < 1e-14  # measured 2e-15
    assert main(["endure", "--redraw", "--out", str(tmp_path)]) == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--years", "1"], "--years"),
        (["--years", "nan"], "--years"),
        (["--years", "1000.5"], "--years"),
        (["--starts", "0"], "starts"),
        (["-m", "Gaus(s=8, h=1.0)"], "Gauss"),
        (["--redraw", "--out", "/nowhere/at/all"], "no result"),
        (["--out", "/proc/nowhere"], "cannot write"),
    ],
)
def test_what_cannot_be_used_is_one_sentence_and_exit_code_2(arguments, words, capsys):
    assert main(["endure", *arguments]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
