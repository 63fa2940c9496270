"""Random Hamiltonians: that everybody draws the same, and what is counted as wrong."""

import numpy as np
import pytest
from msgspec.structs import replace as with_fields

from hbvm_bench.campaign.file import load
from hbvm_bench.cli import main
from hbvm_bench.report.page import Results
from hbvm_bench.report.parts import PartResults
from problems import Hamiltonian, Problem
from tests.hbvm_bench import made_up_run
from tests.hbvm_bench.study_folders import REPORTS, module

report, systems, trials = (module("random", name) for name in ("blocks", "systems", "trials"))
Outcome, Trial = trials.Outcome, trials.Trial


def test_two_hundred_problems_of_forty_formulas_are_the_same_for_everybody():
    made = [systems.problem(number) for number in range(systems.COUNT)]
    assert len({repr(one.y0.tolist()) for one in made}) == systems.COUNT == 200
    assert len({one.system.name for one in made}) == 40
    energies = [one.invariants(one.y0[None]).get("energy", np.zeros(1))[0] for one in made]
    assert np.isfinite(energies).all()
    systems._formula.cache_clear()
    again = systems.problem(77)
    assert (again.y0.tolist(), again.par.tolist()) == (made[77].y0.tolist(), made[77].par.tolist())
    assert made[77].y0.tolist() == [-0.610217, 0.686356, 0.390176, 0.6531]


def test_the_polynomial_wells_let_nothing_escape():
    """Far away the energy grows in every direction."""
    rng = np.random.default_rng(5)
    for number in range(25):
        one = systems.problem(number)
        away = rng.normal(size=(50, one.y0.size // 2))
        away *= 1e3 / np.linalg.norm(away, axis=1)[:, None]
        far = one.invariants(np.hstack([away, np.zeros_like(away)]))["energy"]
        assert (far > 1e9).all()  # measured at least 1.3e11


def test_a_constant_in_the_energy_does_not_change_what_its_error_is_relative_to():
    def shifted(by):
        system = Hamiltonian(lambda q, p: p[0] ** 2 / 2 + q[0] ** 4 + by, dof=1)
        return Problem(system, q0=[1.0], p0=[0.0], t_end=1.0)

    end = np.array([1.0, 1e-4])
    assert trials.energy_change(shifted(0.0), end) == pytest.approx(5e-9 / 4, rel=1e-6)
    assert trials.energy_change(shifted(8.0), end) == pytest.approx(5e-9 / 4, rel=1e-6)


def outcome(number, condition, *made):
    truth = trials.Reference(condition, end=[1.0, 0.0])
    return Outcome(number, truth, [Trial("HBVM()", *rest) for rest in made])


MADE = [
    outcome(0, 10.0, ("finished", "", 2e-8, 3e-8, 10, 1.0)),  # 20 times 1e-10 times 10
    outcome(1, 10.0, ("finished", "", 2e-9, 3e-12, 10, 1.0)),
    outcome(2, 1e9, ("finished", "", 0.5, 1e-9, 10, 1.0)),  # too ill conditioned for a verdict
    outcome(3, 1.0, ("refused",)),
    Outcome(4, trials.Reference(why="none"), [Trial("HBVM()", "finished")]),
]


def test_wrong_is_what_neither_the_tolerance_nor_the_condition_explains():
    total, factors = report.counted(MADE, "HBVM()", report.position)
    assert total == 2
    assert factors == pytest.approx([20.0, 2.0])
    total, factors = report.counted(MADE, "HBVM()", report.energy)
    assert total == 3
    assert factors == pytest.approx([300.0, 0.03, 10.0])
    row = report.wrong(MADE, report.position, "position", "").rows[0]
    assert row[:3] == ("HBVM()", "1 of 2: 50.0% [9.5, 90.5]", "0 of 2: 0.0% [0.0, 65.8]")
    said = report.left_out(MADE).items
    assert [
        "condition number 1.0e+09" in said[0],
        "): no reference: none. Success reported by all." in said[1],
    ] == [True, True]


def test_a_failure_that_is_reported_is_judged_and_not_wrong():
    both = outcome(0, 1.0, ("stalled", "why"))
    both.trials.append(Trial("Taylor()", "finished", "", 1e-12, 1e-12, 5, 1.0))
    assert report.counted([both], "HBVM()", report.position) == (1, [])
    assert report.counted([both], "Taylor()", report.position)[0] == 1
    assert report.endings([both]).rows[0][3] == "1 of 1: 100.0% [20.7, 100.0]"


def test_intervals_of_shares_are_those_of_wilson():
    # (k + z^2/2 ± z sqrt(k (n - k)/n + z^2/4)) / (n + z^2), z = 1.96
    assert report.share(3, 200) == "3 of 200: 1.5% [0.5, 4.3]"
    assert report.share(0, 200) == "0 of 200: 0.0% [0.0, 1.9]"
    assert report.share(0, 0) == "–"


def test_a_process_without_an_answer_is_a_trial_that_says_so():
    def row(outcome):
        return made_up_run.record("HBVM()", outcome=outcome), {}

    names = [task.key for task in report.tasks(quick=True)]
    ended = {name: row("timeout" if name.endswith("HBVM()") else "crashed") for name in names}
    (part,) = report.parts(report.QUICK, report.QUICK_METHODS)
    results = PartResults(part, Results([], [], {}, computed=ended))
    outcome = report.outcome_of(results, 52, report.QUICK_METHODS)
    assert [made.status for made in outcome.trials] == [trials.NO_ANSWER, trials.CRASHED, trials.CRASHED]
    assert outcome.reference.why == "the reference: crashed"


def test_the_error_of_a_position_is_relative_to_the_distance_from_the_origin():
    known = outcome(0, 1.0)
    assert known.position_error(Trial("HBVM()", "finished", end=[1.5, 7.0])) == 0.5
    assert known.position_error(Trial("HBVM()", "finished", position=0.25)) == 0.25


@pytest.mark.slow
def test_a_quick_run_computes_and_draws_everything(tmp_path, monkeypatch):
    campaign = load(str(REPORTS / "random"))
    one = with_fields(campaign.methods[0], use=["HBVM()"], quick=[])
    monkeypatch.setattr("hbvm_bench.commands.run.load", lambda name: with_fields(campaign, methods=[one]))
    place = ["--quick", "--jobs", "1", "--out", str(tmp_path), "--report", str(tmp_path)]
    assert main(["run", str(REPORTS / "random"), *place]) == 0
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    # two problems; SciPy's default atol is wrong on both, the others on none
    assert "| `HBVM()` | 0 of 2: 0.0%" in text
    assert "| `DOP853(rtol=1e-10, atol=1e-06)` | 2 of 2: 100.0%" in text
    assert 'id="random-factors' in (tmp_path / "index.html").read_text(encoding="utf-8")
