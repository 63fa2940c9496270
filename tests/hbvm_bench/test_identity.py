"""A stored case is stale when what its numbers depend on changed, and only then."""

import subprocess
import sys
from pathlib import Path

import pytest

from hbvm_bench import identity
from hbvm_bench.campaign import Case
from hbvm_bench.identity import WORKER, resolve, sources

OURS, PEER = "Gauss(s=2, h=0.5)", "IAS15()"
LOADED = """
import sys
import hbvm_bench.worker
import problems, integrators
problem = problems.load("kepler")
integrators.{method}.compile(problem.system).start(problem.y0, problem.par).step()
packages = ("problems", "integrators", "hbvm_bench")
print(*(name for name in sys.modules if name.partition(".")[0] in packages))
"""


@pytest.mark.parametrize(
    ("method", "module"), [(OURS, "integrators.gauss"), (PEER, "integrators.peers.rebound")]
)
def test_nothing_that_a_worker_loads_is_left_out(method, module):
    command = [sys.executable, "-c", LOADED.format(method=method)]
    loaded = set(subprocess.run(command, capture_output=True, text=True, check=True).stdout.split())
    kept = set(sources([WORKER, module, "problems.kepler"]))
    made_by = {"problems", "integrators", "hbvm_bench.worker", module, "problems.kepler", "problems.dd"}
    assert made_by <= loaded
    empty = {
        name for name in loaded - kept if not identity._file_of(name).read_text().strip('\n"').count("\n")
    }
    assert loaded - kept <= empty  # packages with a line of text only


# What is edited, and whether a case of ours and one of a peer are stale then.
EDITED = {
    "integrators/kernel/step.py": [True, False],
    "integrators/peers/rebound_ias15.py": [False, True],
    "integrators/integrate.py": [True, True],
    "problems/tracing.py": [True, True],
    "problems/dd.py": [True, True],
    "problems/kepler.py": [True, True],
    "problems/pendulum.py": [False, False],
    "integrators/plugins/scipy.py": [False, False],
    "integrators/testing.py": [False, False],
    "hbvm_bench/metric.py": [True, True],
    "hbvm_bench/records.py": [True, True],
    "hbvm_bench/measure.py": [True, True],
    "hbvm_bench/cli.py": [False, False],
    "hbvm_bench/table.py": [False, False],
    "hbvm_bench/report/sections.py": [False, False],
}


def test_a_peers_case_outlives_a_change_of_the_kernel_and_ours_a_change_of_a_peer(monkeypatch):
    def ids():
        identity._digest.cache_clear()
        return [resolve(Case(problem="kepler", method=method)).id for method in (OURS, PEER)]

    def stale(part):
        read = Path.read_bytes
        monkeypatch.setattr(
            Path, "read_bytes", lambda path: read(path) + (b"#" if path.as_posix().endswith(part) else b"")
        )
        found = [now != before for now, before in zip(ids(), untouched, strict=True)]
        monkeypatch.undo()
        return found

    untouched = ids()
    found = {part: stale(f"/{part}") for part in EDITED}
    identity._digest.cache_clear()
    assert found == EDITED


def test_another_reference_makes_a_case_stale(monkeypatch):
    before = resolve(Case(problem="kepler", method=PEER)).id
    monkeypatch.setattr("hbvm_bench.reference.find_file", lambda problem: None)
    assert resolve(Case(problem="kepler", method=PEER)).id != before
