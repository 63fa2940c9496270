"""General and stiff systems beside SciPy's methods."""

import math

import pytest

from hbvm_bench.cli import main
from hbvm_bench.studies.general import runs
from problems.errors import InputError


@pytest.fixture(autouse=True)
def _timed_once(monkeypatch):
    monkeypatch.setattr(runs, "REPEATS", 1)


@pytest.mark.parametrize(
    ("name", "error"),
    [
        ("robertson", 1e-11),  # measured 3.9e-14, Radau 1.2e-13
        ("driven_pendulum", 1e-11),
        ("arenstorf", 1e-9),
    ],
)
def test_the_end_is_the_known_one(name, error):
    ours, *theirs = runs.outcomes([name], limit=0.5)
    assert ours.method == "HBVM(tol=3e-16)"
    assert ours.ending == ""
    assert ours.error < error
    assert len(theirs) == 2
    for run in (ours, *theirs):
        assert run.steps > 0
        assert run.evaluations > run.steps
        assert run.seconds > 0.0
        assert run.ending or run.error < 1e-4


def test_the_stiff_chain_fails_by_the_fixed_point_and_what_takes_too_long_is_given_up():
    fixed, newton, *_, explicit = runs.outcomes(["stiff_chain"], limit=1e-6)
    assert fixed.ending.startswith("nonlinear_divergence: the fixed-point iteration did not converge")
    assert math.isnan(fixed.error)
    assert newton.ending == ""
    assert newton.solver == "Newton"
    assert newton.energy < 1e-14  # measured 1.2e-15
    assert newton.steps == 125  # a hundred times as long as those of the fixed point
    assert explicit.ending.startswith("given up after 0 s at t = 0.1 of 10")
    assert math.isnan(explicit.error)


def test_the_command_prints_them_and_refuses_others(capsys):
    assert main(["automatic", "--general", "driven_pendulum"]) == 0
    assert "HBVM(tol=3e-16)" in capsys.readouterr().out
    assert main(["automatic", "--general", "robertsen"]) == 2
    assert "did you mean 'robertson'" in capsys.readouterr().err
    with pytest.raises(InputError, match="limit must be positive"):
        runs.outcomes(limit=0.0)
