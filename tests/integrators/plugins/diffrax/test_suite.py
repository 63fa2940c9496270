"""diffrax's own tests, which its wheel does not ship, with our methods in the place of its implicit solvers.

They are run, by `host`, where ``HBVM_BENCH_DIFFRAX`` names a clone of diffrax's repository at the installed
version; `docs/plugins/hosts.md` says how, and which of them fail for which reason.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("diffrax")
pytest.importorskip("optax", reason="diffrax's tests need optax")

CLONE = os.environ.get("HBVM_BENCH_DIFFRAX")
MODULES = (
    "integrate", "solver", "adaptive_stepsize_controller", "adjoint", "event", "interpolation",
    "global_interpolation", "detest",
)  # fmt: skip
POLYNOMIAL = "the derivative of a polynomial of degree 1, to 1e-6 at a step of 1e-3"
FAILS = {
    "test_dense_interpolation": POLYNOMIAL,
    "test_dense_interpolation_vmap": POLYNOMIAL,
    "test_implicit_tol_error": "wants tolerances of the root finder; ours iterates to round-off without",
}


@pytest.mark.slow
@pytest.mark.skipif(CLONE is None, reason="HBVM_BENCH_DIFFRAX names no clone of diffrax's repository")
@pytest.mark.parametrize("module", MODULES)
def test_of_diffraxs_tests_those_fail_that_are_listed(module: str) -> None:
    assert CLONE is not None
    command = [sys.executable, "-m", "pytest", "-o", "addopts=", "-p", "host", "-q", f"test/test_{module}.py"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    ran = subprocess.run(command, cwd=CLONE, env=environment, capture_output=True, text=True, check=False)
    assert re.search(r"\d+ passed", ran.stdout), ran.stdout[-3000:] + ran.stderr
    failed = set(re.findall(r"^FAILED \S+::(\w+)", ran.stdout, re.MULTILINE))
    assert failed <= FAILS.keys(), ran.stdout[-3000:]
