import json
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace as with_fields

from hbvm_bench.campaign.file import load as load_campaign
from hbvm_bench.campaign.identity import resolve
from hbvm_bench.cli import main
from hbvm_bench.measure import drift
from hbvm_bench.report.page import document, gather
from hbvm_bench.report.write import write
from hbvm_bench.store.records import Timing
from hbvm_bench.store.store import Index, Store
from hbvm_bench.studies import endure
from tests.hbvm_bench.made_up_run import record, timed

OURS = "Gauss(s=8, h=1.0)"
PEER = "Taylor(tol=1e-16)"


def made(directory, years=1e6, starts=16, size=1e-17, bias=0.0):
    """Store and read a result with random walks for errors."""
    campaign = endure.campaign(years, starts, [OURS, PEER])
    store = Store(directory)
    store.prepare()
    rng = np.random.default_rng(7)
    cases = [resolve(case) for case in campaign.cases()]
    t = cases[0].case.grid.times(cases[0].problem)
    walks = {case.id: [] for case in cases}
    for _ in range(starts):
        for case in cases:
            walk = np.cumsum(rng.standard_normal(t.size - 1) * np.sqrt(np.diff(t)))
            walks[case.id].append(size * walk + bias * t[1:])
    for case, seconds in zip(cases, (0.5, 9.0), strict=True):
        store.save(*drifted(case, t, np.array(walks[case.id]), seconds))
    store.write_index(
        Index(campaign=campaign, ids=[case.id for case in cases], version="0", command="hbvm-bench endure")
    )
    return endure.measured_last(gather([store]))


def drifted(case, t, errors, seconds):
    timing = Timing(rounds=timed([seconds]), machine={"processor": "one"})
    series = {
        "t": t,
        "y": np.tile(case.problem.y0, (t.size, 1)),
        "drift.t": t[1:],
        "drift.energy": errors,
    }
    return record(case, t_stop=float(t[-1]), timing=timing, machine={"processor": "one"}), series


def test_samples_are_whole_years_with_the_powers_of_ten():
    (case, *_) = load_campaign("endure").cases()
    t = case.grid.times(resolve(case).problem)
    assert np.array_equal(t, np.rint(t))
    assert {1e4, 1e5, 1e6} <= set(t.tolist())
    assert np.all(np.diff(t) > 0)


def goals_of(result, method):
    return [goal for goal in endure.goals(result) if goal.words.startswith(method)]


def test_goals_are_reached_by_an_unbiased_walk_and_missed_by_a_biased_one(tmp_path):
    fine, drifting = made(tmp_path / "fine"), made(tmp_path / "drifting", bias=1e-17)
    assert [goal.verdict for goal in goals_of(fine, "a year's step")] == ["reached", "reached"]
    assert [goal.verdict for goal in goals_of(drifting, "a year's step")] == ["missed", "missed"]
    (faster,) = goals_of(fine, "at least 12 times")
    assert faster.verdict == "reached"
    # the other step, which these goals are about, is not among what was run
    assert {goal.reached for goal in goals_of(fine, "half a year's step")} == {False}


def test_a_small_drift_is_a_drift_all_the_same(tmp_path):
    """Sixteen ends of one sign: below the rms allowed, and no random walk."""
    result = made(tmp_path, bias=-3e-20)
    small, within = goals_of(result, "a year's step")
    assert (small.reached, within.reached) == (True, False)
    assert float(within.measured) > 2.0  # measured 3.2 times what is called a drift
    ours, _ = endure.lines(result)
    assert ours.drift is not None
    assert ours.drift.kind == "drift"
    (table, _) = endure.tables(result)
    assert "0 of 16 positive" in str(table.rows[0])
    assert "more than 3 standard errors from 0; without a drift, chance exceeds this in 0.9 %" in table.note


def test_the_stored_report_and_the_readme_say_the_same():
    stored = Path(__file__).parents[3] / "reports" / "endure"
    page = (stored / "README.md").read_text(encoding="utf-8")
    ours = next(text for text in page.splitlines() if text.replace("`", "").startswith(f"| {OURS} "))
    if drift.KINDS["drift"] in ours:
        readme = (stored.parents[1] / "README.md").read_text(encoding="utf-8")
        assert "grows like the square root of time" not in readme


def test_a_short_run_has_no_goals(tmp_path):
    assert endure.goals(made(tmp_path, years=1e4)) == []


def test_the_lines_have_rms_growth_and_speed(tmp_path):
    ours, peer = endure.lines(made(tmp_path))
    assert set(ours.rms) == {1e4, 1e5, 1e6}
    assert ours.drift is not None
    assert ours.drift.kind == "power"
    assert peer.times_ours == pytest.approx(18.0)


def test_a_failed_trajectory_is_counted_and_not_averaged(tmp_path):
    made(tmp_path, years=1e4, starts=3)
    store = Store(tmp_path)
    _, peer = store.records()
    series = store.series(peer.id)
    store.save(peer, {**series, "drift.energy": series["drift.energy"][:2]})
    assert [
        (line.starts, line.failed) for line in endure.lines(endure.measured_last(gather([Store(tmp_path)])))
    ] == [
        (3, 0),
        (2, 1),
    ]


def test_the_report_names_what_was_run_and_is_deterministic(tmp_path):
    made(tmp_path, years=1e5, starts=3)
    first = write(document(Store(tmp_path)), tmp_path / "a")[0].read_bytes()
    assert write(document(Store(tmp_path)), tmp_path / "b")[0].read_bytes() == first
    for name in ("index.html", "figures/endure.svg"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    assert b"Gauss(s=8, h=1.0)" in first


ARGUMENTS = ["endure", "--years", "200", "--starts", "2", "-m", "Gauss(s=8, h=1.0)", "-m", "IAS15()"]


def test_endure_runs_and_prints_json(tmp_path, capsys, monkeypatch):
    campaign = endure.load("endure")
    once = with_fields(campaign.timing, rounds=2, compilations=1)  # of five, each with empty caches
    monkeypatch.setattr(endure, "load", lambda name: with_fields(campaign, timing=once))
    assert main([*ARGUMENTS, "--json", "--out", str(tmp_path)]) == 0
    data = json.loads(capsys.readouterr().out)
    assert [line["method"] for line in data["lines"]] == ["Gauss(s=8, h=1.0)", "IAS15()"]
    for line in data["lines"]:
        assert line["starts"] == 2
        assert line["seconds"] > 0
        assert line["rms"]["200"] < 1e-14  # measured 2e-15
    assert main(["report", str(tmp_path), "-o", str(tmp_path / "again")]) == 0
    assert main(["report", str(tmp_path / "report"), "-o", str(tmp_path / "third")]) == 0
    pages = [(tmp_path / name / "README.md").read_bytes() for name in ("report", "again", "third")]
    assert len(set(pages)) == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--years", "1"], "--years"),
        (["--years", "nan"], "--years"),
        (["--years", "1000.5"], "--years"),
        (["--starts", "0"], "starts"),
        (["-m", "Gaus(s=8, h=1.0)"], "Gauss"),
        (["--out", "/proc/nowhere"], "cannot write"),
    ],
)
def test_what_cannot_be_used_is_one_sentence_and_exit_code_2(arguments, words, capsys):
    assert main(["endure", *arguments]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
