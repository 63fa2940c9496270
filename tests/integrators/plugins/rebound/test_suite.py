"""REBOUND's own tests with HBVM(8, 8) and steps of constant length; see `suite`.

IAS15 finds its steps by itself: a test that leaves them to it gets one, `STEPS`.
"""

import importlib
from pathlib import Path

import pytest

rebound = pytest.importorskip("rebound")

from .suite import THEIRS, adapted  # noqa: E402

MODULES = (
    "additional_forces", "boundary", "collisions", "copy", "gravity", "integrator", "leapfrog", "megno",
    "pickle", "post_timestep_modifications", "simulation", "simulationarchive", "simulationarchive_matrix",
    "variational", "random", "serialize", "binary_fields",
)  # fmt: skip
STEPS = {
    "test_ias15_globaloff": 2.0, "test_ias15_compensated": 2.0, "test_ias15": 0.5,
    "test_initial_t_ias15": 0.5, "test_chaotic": 0.01, "test_var_rescale_ias15": 3.0,
}  # fmt: skip
TREE = "a tree's forces are not smooth, and are refused"
KEPLER = "4.56 periods in one step: WHFast follows Kepler's ellipse by a formula, others cannot"
OPTIONS = "asks about an option, or the name, of WHFast or leapfrog"
NAN = "puts a particle at NaN, which ours reports and leapfrog does not"
FAILS = {
    "boundary_test_open": TREE,
    "collisions_test_tree_remove_one": TREE,
    "simulationarchive_test_tree": TREE,
    "integrator_test_whfast_verylargedt": KEPLER,
    "integrator_test_whfast_verylargedt_hyperbolic": KEPLER,
    "integrator_test_ias15_small_initial_dt": "a first step of one period of Jupiter, for IAS15 to shorten",
    "integrator_test_field_doc": OPTIONS,
    "integrator_test_not_equal": OPTIONS,
    "leapfrog_test_leapfrog_wrong_order": OPTIONS,
    "simulation_test_integrator": OPTIONS,
    "collisions_test_line_find": NAN,
    "collisions_test_line_find_overlap1": NAN,
    "collisions_test_line_find_overlap2": NAN,
    "megno_test_chaotic": "a close encounter at t = 299, which takes changing steps",
    "variational_test_var_rescale_whfast_megno": "a chaotic orbit has grown by 1e43 at the end, or not yet: "
    "with steps of 3 and 4 ours has, with 5 not; IAS15 has with epsilon = 1e-10 and not with 1e-9",
}
SLOW = {
    "integrator_test_whfast_verysmalldt",  # 8e5 steps: 7 s
    "megno_test_whfast_close_regular",  # 3e5 steps: 6 s
}

pytestmark = pytest.mark.filterwarnings("ignore")  # as REBOUND runs them


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    importlib.import_module("integrators.plugins.rebound")
    monkeypatch.chdir(tmp_path)


for _module in MODULES:
    _groups = adapted(_module, {name: {} for name in THEIRS}, FAILS, steps=STEPS)
    for _group in _groups.values():
        for _name in vars(_group).keys() & {name.removeprefix(f"{_module}_") for name in SLOW}:
            setattr(_group, _name, pytest.mark.slow(getattr(_group, _name)))
    globals().update(_groups)
