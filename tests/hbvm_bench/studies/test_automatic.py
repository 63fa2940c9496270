"""The race of HBVM without settings."""

import numpy as np
import pytest

from hbvm_bench.cli import main
from hbvm_bench.studies.automatic import runs
from problems.errors import InputError
from problems.problem import Problem


def test_both_sides_are_measured_on_the_same_trajectory():
    pytest.importorskip("heyoka")
    (duel,) = runs.duels(["henon_heiles"], rounds=2)
    for side in (duel.ours, duel.theirs):
        assert 0.0 < side.energy < 1e-12  # measured 1e-14 to 5e-14
        assert 0.0 < side.position < 1e-9  # measured 2e-12 to 7e-12
        assert len(side.seconds) == 2
        assert min(side.seconds) > 0.0
    assert duel.ours.steps < duel.theirs.steps / 3
    assert duel.ratio.low <= duel.ratio.median <= duel.ratio.high
    assert duel.reached == (duel.as_accurate and duel.ratio.median >= 1.5)


def test_other_problems_and_too_few_rounds_are_refused(capsys):
    with pytest.raises(InputError, match="'cr3bp' is not among outer_solar_system, sitnikov"):
        runs.duels(["cr3bp"])
    with pytest.raises(InputError, match="rounds must be at least 2, not 1"):
        runs.duels(["kepler"], rounds=1)
    assert main(["automatic", "keppler"]) == 2
    assert "did you mean 'kepler'" in capsys.readouterr().err


def test_a_peer_on_another_trajectory_is_not_compared(monkeypatch):
    pytest.importorskip("heyoka")
    lost = {"off_axis": np.array([0.0, 1e-3])}
    monkeypatch.setattr(Problem, "guards", lambda self, y, t: lost)
    with pytest.raises(InputError, match=r"loses what a symmetry .* keeps at 0: off_axis"):
        runs.duels(["henon_heiles"], rounds=2)
