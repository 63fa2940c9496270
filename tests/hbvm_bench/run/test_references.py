"""References that a campaign asks for have the times of its own runs."""

import numpy as np
import pytest

from hbvm_bench.campaign.file import Campaign, MethodEntry, ProblemEntry
from hbvm_bench.campaign.grid import Grid
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.campaign.own import NOTHING
from hbvm_bench.reference import solutions, trusted
from hbvm_bench.run import references
from hbvm_bench.store.store import Store
from problems.errors import InputError


@pytest.mark.parametrize("grid", [Grid(step=0.5), Grid(count=30)])
def test_a_reference_is_computed_at_samples_of_the_run_where_the_stored_one_has_the_start_alone(
    grid, tmp_path, monkeypatch
):
    text = "kepler(t_end=90.5)"
    problem = make_problem(text)
    samples = grid.times(problem)
    stored = solutions.find(problem)
    assert stored is not None
    assert np.intersect1d(stored.t, samples).tolist() == [0.0]  # by it everything would be ranked at t = 0
    asked = []

    def make(problem, *, at):
        asked.append(at)
        raise InputError("not computed here")

    monkeypatch.setattr(trusted, "make", make)
    campaign = Campaign(
        name="own",
        problems=[ProblemEntry(use=text, reference=True)],
        methods=[MethodEntry(use="Gauss(s=4, h=0.5)")],
        grid=grid,
    )
    store = Store(tmp_path)
    store.prepare()
    assert references.make_missing(campaign, store, NOTHING, lambda sentence: None) is NOTHING
    (at,) = asked
    assert np.isin(at, samples).all()
    assert at[0] == samples[0]
    assert at[-1] == samples[-1]
    assert at.size > 20  # measured 31 and 182


@pytest.mark.parametrize("spacing", ["irregular", "log"])
def test_samples_that_are_not_equally_spaced_are_also_at_the_times_of_the_stored_reference(spacing):
    problem = make_problem("kepler(t_end=90.5)")
    stored = solutions.find(problem)
    assert stored is not None
    within = stored.t[stored.t <= problem.t_end]
    assert within.size > 5  # measured 8
    assert np.isin(within, Grid(count=30, spacing=spacing).times(problem)).all()
