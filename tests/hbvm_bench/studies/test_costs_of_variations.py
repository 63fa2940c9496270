"""The costs of tangent vectors: both libraries have the same derivatives, and ratios are of one round."""

import numpy as np
import pytest

from hbvm_bench.measure.computation import packed, unpacked
from integrators import HBVM, integrate
from tests.hbvm_bench.study_folders import module

report, variations = module("costs", "blocks"), module("costs", "variations")
Times = module("costs", "experiments").Times
pytest.importorskip("heyoka")


@pytest.mark.parametrize("count", [1, 4])
def test_both_libraries_have_the_same_derivatives(count, monkeypatch):
    monkeypatch.setattr(variations, "END", 30.0)  # the orbit is chaotic
    problem = variations.problem()
    dim = problem.system.dim
    solution = integrate(problem, HBVM(), [problem.t_end], variations=np.eye(dim)[:, :count])
    assert solution.variations is not None
    ours = solution.variations[0]
    state = variations.Variational(problem, count).run()
    theirs = state[dim:].reshape(dim, count)
    assert np.abs(ours - theirs).max() / np.abs(ours).max() < 1e-12  # measured: 5.2e-14


def test_another_run_begins_at_the_start():
    member = variations.Variational(variations.problem(), 1)
    assert np.array_equal(member.run().copy(), member.run())


def test_ratios_are_of_one_round():
    seconds = {
        f"{library} {n}": [factor * t for t in (1.0, 2.0, 4.0)]
        for library, factors in (("hbvm", (1.0, 1.5, 2.5)), ("heyoka", (1.0, 3.0, 12.0)))
        for n, factor in zip(variations.COUNTS, factors, strict=True)
    }
    table = variations.table(Times(seconds, 0.0, 0.0))
    assert [row[2:4] for row in table.rows] == [
        ("1.50× (1.50–1.50)", "2.50× (2.50–2.50)"),
        ("3.00× (3.00–3.00)", "12.00× (12.00–12.00)"),
    ]
    assert {row[-1] for row in table.rows} == {"judged"}
    assert {row[-1] for row in variations.table(Times(seconds, 0.2, 0.0)).rows} == {
        "not judged: other work took 20% of a core"
    }


def test_times_of_a_short_run_are_taken_and_read_again():
    (part,) = (part for part in report.parts(quick=True) if part.key == variations.KEY)
    (task,) = part.runs
    assert task.timed
    taken = variations.times(2)
    assert {len(samples) for samples in taken.seconds.values()} == {2}
    assert unpacked(packed(taken), task.run) == taken
