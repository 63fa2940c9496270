"""The campaign ``costs``: its families stay apart, and what a busy machine measured is not judged."""

from functools import partial

import pytest
from msgspec.structs import replace

from hbvm_bench.campaign.file import load
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.cli import main
from hbvm_bench.measure.computation import packed, unpacked
from hbvm_bench.reference import solutions
from hbvm_bench.report.document import Note
from hbvm_bench.store.records import Load
from hbvm_bench.summaries.points import PROJECTION
from hbvm_bench.summaries.table import Table
from tests.hbvm_bench import made_up_run
from tests.hbvm_bench.study_folders import REPORTS, module

beside_c, experiments, report = (module("costs", name) for name in ("beside_c", "experiments", "blocks"))
Iterations, Times, Ratio = experiments.Iterations, experiments.Times, report.Ratio

DEFAULT = made_up_run.record("HBVM(tol=3e-16)", [1.0, 2.0, 4.0])
LOOSE = made_up_run.record("HBVM(tol=0.001)", [0.8, 1.7, 3.2])
PROJECTED = made_up_run.record("HBVM(tol=0.001, projection='energy')", [0.5, 1.0, 2.0])


def members(*records):
    return {"p": [Ratio.from_records(record, records[0]) for record in records]}


def test_its_five_problems_have_a_reference_at_their_ends():
    entries = load(str(REPORTS / "costs")).entries()
    assert len(entries) == 5
    for entry in entries:
        problem = make_problem(entry.use)
        known = solutions.find(problem)
        assert known is not None
        assert problem.t_end in known.t


def test_times_are_compared_within_rounds_and_the_projection_apart():
    hbvm, projected = report.summary(members(DEFAULT, LOOSE, PROJECTED))
    assert hbvm.rows == [("HBVM(tol=0.001)", "0.80×", "0.80×", "0.80×", "judged")]
    assert projected.title == f"Time relative to HBVM(): {PROJECTION}"
    assert [row[-4:] for row in projected.rows] == [("0.50×", "0.50×", "0.50×", "judged")]
    rows = report.details(members(DEFAULT, LOOSE, PROJECTED)).rows
    assert [row[-1] for row in rows] == ["", "less time", "less time"]
    assert rows[1][2] == "0.80× (0.80–0.82)"


@pytest.mark.parametrize(
    ("times", "verdict"), [([1.1, 2.2, 4.4], "more time"), ([0.9, 2.2, 4.0], "no difference")]
)
def test_more_or_less_time_is_said_where_both_quartiles_say_so(times, verdict):
    slower = made_up_run.record("HBVM(tol=1e-06)", times)
    assert Ratio.from_records(slower, DEFAULT).verdict == verdict


def test_beside_other_work_nothing_is_judged():
    assert LOOSE.timing is not None
    busy = replace(LOOSE, timing=replace(LOOSE.timing, load=Load(others=0.2, steal=0.0)))
    (table,) = report.summary(members(DEFAULT, busy))
    assert table.rows[0][-1] == "not judged"
    assert report.details(members(DEFAULT, busy)).rows[1][-1].startswith("not judged: other work took 20%")
    times = {method: [3e-5, 4e-5] for method in experiments.CALLED}
    assert {row[-1] for row in report.calls(Times(times, 0.05, 0.0)).rows} == {"judged"}
    assert {row[-1] for row in report.calls(Times(times, 0.0, 0.2)).rows} == {
        "not judged: other work took 20% of a core"
    }


def test_a_setting_without_times_is_not_judged():
    untimed = made_up_run.record("HBVM(tol=1e-09)")
    assert report.summary(members(DEFAULT, untimed))[0].rows[0][1:] == ("–", "–", "–", "not judged")


def test_iterations_are_counted_on_a_small_lattice():
    counted = experiments.iterations(10, 1.0)
    fixed = counted["HBVM(k=8, s=4, h=0.1)"]
    assert (fixed.steps, fixed.solver, fixed.reason) == (10, "fixed point", "")
    assert 80 <= fixed.iterations <= 150  # measured 110
    assert report.iterations({10: counted}, 1.0).rows[0][0] == "10"
    failed = Iterations(3, 9, "fixed point", "the step is too small")
    row = report.iterations({10: dict.fromkeys(experiments.ON_LATTICES, failed)}, 1.0).rows[0]
    assert "the step is too small" in row


def test_what_came_out_is_read_again():
    task = report.parts(quick=True)[1].tasks[0]
    times = Times({"HBVM()": [1.0]}, 0.1, 0.0)
    assert unpacked(packed(times), task.run) == times


def test_the_same_algorithm_in_c_needs_as_many_iterations_and_has_errors_of_the_same_size():
    if not beside_c.compiler():
        pytest.skip("this machine has no C compiler")
    found = beside_c.beside_c(2000, 2)
    assert found.times is not None, found.compiler
    ours, in_c = found.outcomes[beside_c.OURS], found.outcomes[beside_c.IN_C]
    assert abs(in_c.iterations - ours.iterations) <= 0.005 * ours.iterations  # measured 2e-3 and less
    for outcome in (ours, in_c):
        assert outcome.energy < 5e-15  # measured 1e-15
        assert outcome.position < 1e-12  # measured 1e-13
    table = report.in_c(found)
    assert isinstance(table, Table)
    assert [row[0] for row in table.rows] == [beside_c.OURS, beside_c.IN_C]
    assert "-O3 -march=native" in table.note
    assert unpacked(packed(found), partial(beside_c.beside_c, 2000, 2)) == found


@pytest.mark.parametrize(
    ("command", "words"), [("no-such-compiler", "no C compiler"), ("false", "no C compiler that compiles")]
)
def test_without_a_c_compiler_the_block_says_so(monkeypatch, command, words):
    monkeypatch.setenv("CC", command)
    found = beside_c.beside_c(100, 1)
    assert (found.outcomes, found.times) == ({}, None)
    note = report.in_c(found)
    assert isinstance(note, Note)
    assert words in note.text
    assert unpacked(packed(found), partial(beside_c.beside_c, 100, 1)) == found


@pytest.mark.slow
def test_a_quick_run_computes_and_draws_everything(tmp_path):
    place = ["--quick", "--jobs", "1", "--out", str(tmp_path), "--report", str(tmp_path)]
    assert main(["run", str(REPORTS / "costs"), *place]) == 0
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "Time relative to HBVM(): HBVM(projection='energy')" in text
    assert "Kepler's problem, e = 0.6" in text
    for title in (
        "Iterations on a lattice",
        "A second call of integrate",
        "Kepler's problem beside C",
        "The first result of a fresh",
    ):
        assert title in text
