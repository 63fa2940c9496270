"""A stored case is stale when what its numbers depend on changed, and only then."""

import ast
import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

from hbvm_bench.campaign import identity
from hbvm_bench.campaign.file import Case
from hbvm_bench.campaign.identity import BOOKKEEPING, INTEGRATES, resolve, sources
from problems.catalogue import kepler

ROOT = Path(identity.__file__).parents[2]
OURS, PEER = "Gauss(s=2, h=0.5)", "IAS15()"
LOADED = """
import sys
import hbvm_bench.run.worker
import problems, integrators
problem = problems.load("kepler")
integrators.{method}.compile(problem.system).start(problem.y0, problem.par).step()
packages = ("problems", "integrators", "hbvm_bench")
ours = [name for name in sys.modules if name.partition(".")[0] in packages]
print(*ours)
"""
# A worker loads them and no number comes from them: what keeps the digests, and what
# `import integrators` brings, since the bench takes its steps by `hbvm_bench.measure.raw`.
NOT_ASKED = {
    *("hbvm_bench.run.worker", "integrators.kernel.native.store"),
    *(
        "integrators",
        "integrators.running.integrate",
        "integrators.running.many",
        "integrators.running.pieces",
        "integrators.ensemble",
        "integrators.reduce",
        "integrators.registry",
        "integrators.running.watch",
        "integrators.running.run",
        "integrators.running.variations",
        "integrators.running.digits",
    ),
    # what takes times, and no case is integrated by
    *("hbvm_bench.measure.ensemble", "hbvm_bench.measure.timing", "hbvm_bench.measure.machine"),
    # how a worker ends, and what memory it took
    *("hbvm_bench.run.ending", "hbvm_bench.measure.memory"),
    # which many trajectories may be asked for, and a case is not
    *("integrators.events", *(f"integrators.events.{name}" for name in ("event", "finder", "members"))),
}


@pytest.mark.parametrize(
    ("method", "module"), [(OURS, "integrators.methods.gauss"), (PEER, "integrators.peers.rebound")]
)
def test_nothing_that_a_worker_loads_is_left_out(method, module):
    command = [sys.executable, "-c", LOADED.format(method=method)]
    loaded = set(subprocess.run(command, capture_output=True, text=True, check=True).stdout.split())
    kept = set(sources([INTEGRATES, module, "problems.catalogue.kepler"]))
    said = {name for name in loaded if name.startswith(BOOKKEEPING)}
    assert {"hbvm_bench.campaign.identity", "hbvm_bench.store.arrays", "problems.picture"} <= said
    assert not kept & said
    made_by = {
        "problems",
        "integrators",
        "hbvm_bench.run.worker",
        module,
        "problems.catalogue.kepler",
        "problems.double_double",
    }
    assert made_by <= loaded
    left_out = loaded - kept - said - NOT_ASKED
    bodies = {name: ast.parse(identity._file_of(name).read_text()).body for name in left_out}
    assert not [name for name, body in bodies.items() if len(body) > 1]  # packages with a docstring only


# What is edited, and whether a case of ours and one of a peer are stale then.
EDITED = {
    "integrators/kernel/step/begin.py": [True, False],
    "integrators/peers/rebound/ias15.py": [False, True],
    "integrators/running/integrate.py": [False, False],
    "integrators/solution.py": [True, True],
    "problems/graph/nodes.py": [True, True],
    "problems/double_double.py": [True, True],
    "problems/catalogue/kepler.py": [True, True],
    "problems/catalogue/pendulum.py": [False, False],
    "problems/picture.py": [False, False],
    "integrators/plugins/scipy/__init__.py": [False, False],
    "integrators/testing/rules.py": [False, False],
    "hbvm_bench/measure/metrics.py": [False, False],
    "hbvm_bench/measure/raw.py": [True, True],
    "hbvm_bench/measure/starts.py": [True, True],
    "hbvm_bench/measure/measured.py": [False, False],
    "hbvm_bench/measure/chaos.py": [False, False],
    "integrators/dynamics/lyapunov.py": [False, False],
    "hbvm_bench/measure/drift.py": [False, False],
    "hbvm_bench/measure/timing.py": [False, False],
    "hbvm_bench/reference/solutions.py": [False, False],
    "hbvm_bench/store/records.py": [False, False],
    "hbvm_bench/store/store.py": [False, False],
    "hbvm_bench/campaign/file.py": [False, False],
    "hbvm_bench/run/worker.py": [False, False],
    "hbvm_bench/cli.py": [False, False],
    "hbvm_bench/summaries/rows.py": [False, False],
    "hbvm_bench/report/problem.py": [False, False],
}


def ids():
    identity.digest_of.cache_clear()
    return [resolve(Case(problem="kepler", method=method)).id for method in (OURS, PEER)]


@pytest.fixture
def stale(monkeypatch):
    """Return whether a case of ours and one of a peer are stale once files have been edited."""
    untouched = ids()

    def edited(end, edit):
        read = Path.read_bytes
        monkeypatch.setattr(
            Path, "read_bytes", lambda path: edit(read(path)) if path.as_posix().endswith(end) else read(path)
        )
        found = [now != before for now, before in zip(ids(), untouched, strict=True)]
        monkeypatch.undo()
        return found

    yield edited
    identity.digest_of.cache_clear()


def test_a_peers_case_outlives_a_change_of_the_kernel_and_ours_a_change_of_a_peer(stale):
    assert all((ROOT / part).is_file() for part in EDITED)
    found = {part: stale(f"/{part}", lambda source: source + b"EDITED = 1\n") for part in EDITED}
    assert found == EDITED


def test_another_comment_docstring_or_layout_makes_no_case_stale(stale):
    def reworded(source):
        source = re.sub(rb'^( *)"""[^"]*"""$', rb'\1"""Said otherwise."""', source, flags=re.MULTILINE)
        return b"# another comment\n\n" + source + b"\n\n# and one\n"

    assert b"Said otherwise" in reworded(Path(identity.__file__).read_bytes())
    assert stale(".py", reworded) == [False, False]


def test_what_a_problem_says_of_itself_makes_no_case_stale(stale):
    words = b'notes="Exact solution known'
    assert words in Path(kepler.__file__).read_bytes()
    assert stale("/kepler.py", lambda source: source.replace(words, b'notes="Otherwise')) == [False, False]
    assert stale("/kepler.py", lambda source: source.replace(b"span=6.5", b"span=7.5")) == [False, False]
    assert stale("/kepler.py", lambda source: source.replace(b"= 0.6", b"= 0.5")) == [True, True]


def test_what_a_plugins_module_imports_of_its_own_package_belongs_to_it(tmp_path, monkeypatch):
    package = tmp_path / "somebody"
    (package / "deep").mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "deep" / "__init__.py").write_text("")
    (package / "methods.py").write_text("def compile():\n    from .deep import helper\n    import json\n")
    (package / "deep" / "helper.py").write_text("import problems.errors\n")
    monkeypatch.syspath_prepend(tmp_path)
    importlib.import_module("somebody.methods")
    theirs = {"somebody.methods", "somebody.deep", "somebody.deep.helper", "problems.errors"}
    assert set(sources(["somebody.methods"])) == theirs
    monkeypatch.delitem(sys.modules, "somebody.methods")
    monkeypatch.delitem(sys.modules, "somebody")


def test_another_reference_makes_no_case_stale(monkeypatch):
    before = resolve(Case(problem="kepler", method=PEER)).id
    monkeypatch.setattr("hbvm_bench.reference.solutions.find_file", lambda problem: None)
    assert resolve(Case(problem="kepler", method=PEER)).id == before


def test_the_digest_of_the_kernel_is_that_of_its_code():
    digest = identity.kernel_digest()
    assert len(digest) == 64
    assert digest == identity.kernel_digest.__wrapped__()
