"""The campaign ``general``: systems of a file beside it, judged by the ends that it gives."""

from pathlib import Path

import pytest

from hbvm_bench.campaign import file as campaigns
from hbvm_bench.campaign import own
from hbvm_bench.campaign.entries import Limits
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.campaign.shorter import chosen, quick_run
from hbvm_bench.reference import solutions
from hbvm_bench.run import references
from hbvm_bench.store.store import Store
from integrators import HBVM, integrate
from problems.errors import InputError
from tests.hbvm_bench.conftest import run_case


def opened(*names: str):
    campaign = chosen(campaigns.load("general"), list(names))
    return own.opened(campaign, campaigns.file_of("general").parent, print)


def known(campaign, folder: Path, there: own.Known) -> tuple[Store, own.Known]:
    store = Store(folder)
    store.prepare()
    return store, references.make_missing(campaign, store, there, print)


def test_the_end_that_a_campaign_gives_is_the_reference(tmp_path):
    campaign, formulas = opened("robertson")
    (entry,) = campaign.entries()
    store, more = known(campaign, tmp_path, formulas)
    found = solutions.find(make_problem(entry.use, more), more.references)
    assert found is not None
    assert found.t.tolist() == [40.0]
    assert found.high[0].tolist() == entry.end
    assert references.make_missing(campaign, store, more, print) is more  # it lies there now
    assert store.known() == more


@pytest.mark.parametrize("end", [[1.0], [1.0, 2.0, 3.0], [1.0, float("nan")]])
def test_an_end_that_is_no_state_is_refused(end):
    campaign, formulas = opened("van_der_pol")
    (entry,) = campaign.entries()
    with pytest.raises(InputError, match="must be 2 finite numbers"):
        solutions.of_end(make_problem(entry.use, formulas), end)


def test_a_stiff_chain_fails_by_the_fixed_point():
    (entry,) = opened("stiff_chain")[0].entries()
    problem = make_problem(entry.use)
    made = integrate(problem, HBVM(k=8, s=4, h=8e-4, solver="fixed_point"), [problem.t_end])
    assert made.status == "nonlinear_divergence"
    assert made.reason.startswith("the fixed-point iteration did not converge in the step from t = 0.0")


def test_a_stiff_chain_runs_at_a_hundred_times_the_step_and_ends_where_the_slow_springs_are():
    (entry,) = opened("stiff_chain")[0].entries()
    problem = make_problem(entry.use)
    made = integrate(problem, HBVM(k=8, s=4, h=8e-2), [problem.t_end])
    assert (made.status, made.stats.solver, made.stats.steps) == ("finished", "Newton", 125)
    assert abs(made.errors()["energy"]).max() < 1e-14  # measured 1.4e-15
    assert abs(made.y[0, :3] - entry.end[:3]).max() < 1e-6  # measured 8.6e-8


def test_a_case_that_takes_too_long_is_given_up_and_says_so(tmp_path):
    campaign, formulas = opened("stiff_chain")
    explicit = next(case for case in campaign.cases() if case.method.startswith("DOP853"))
    record = run_case(
        explicit, str(known(campaign, tmp_path, formulas)[0].directory), Limits(wall_seconds=0.1)
    )
    assert (record.result.outcome, record.result.reason) == ("timeout", "did not end within 0.1 s")


def test_a_quick_run_takes_no_time_of_a_reference_that_is_an_end_alone():
    campaign, _ = opened("stiff_chain")
    (entry,) = quick_run(campaign).entries()
    assert make_problem(entry.use).t_end == 1.0


def test_a_quick_run_shortens_no_span_of_a_file_and_keeps_no_end_of_another_span(tmp_path):
    shorter = quick_run(campaigns.load("general"))
    ends = {campaigns.name_of(entry): entry.end for entry in shorter.entries()}
    assert len(ends["robertson"]) == 3
    assert ends["stiff_chain"] is None
