"""A stored case is stale when what is installed changed; what only keeps or shows results does not count."""

from pathlib import Path

import pytest

from hbvm_bench.campaign import identity
from hbvm_bench.campaign.file import Case
from hbvm_bench.campaign.identity import resolve

ROOT = Path(identity.__file__).parents[2]
OURS, PEER = "Gauss(s=2, h=0.5)", "IAS15()"

EDITED = {
    "integrators/kernel/step/begin.py": True,
    "integrators/peers/rebound/ias15.py": True,
    "problems/graph/nodes.py": True,
    "problems/catalogue/kepler.py": True,
    "hbvm_bench/measure/raw.py": True,
    "hbvm_bench/measure/metrics.py": False,
    "hbvm_bench/reference/solutions.py": False,
    "hbvm_bench/store/store.py": False,
    "hbvm_bench/campaign/file.py": False,
    "hbvm_bench/run/worker.py": False,
    "hbvm_bench/report/problem.py": False,
}
"""Files, and whether an edit makes every case stale."""


def ids():
    for kept in (identity.installed, identity.kernel_digest):
        kept.cache_clear()
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
    ids()


def test_a_case_is_stale_where_what_it_may_come_from_was_edited(stale):
    assert all((ROOT / part).is_file() for part in EDITED)
    found = {part: stale(f"/{part}", lambda source: source + b"EDITED = 1\n") for part in EDITED}
    assert found == {part: [expected] * 2 for part, expected in EDITED.items()}


def test_the_file_of_another_distributions_method_belongs_to_its_cases(tmp_path, monkeypatch):
    method = resolve(Case(problem="kepler", method=PEER)).method
    file = tmp_path / "methods.py"
    file.write_text("first = 1")
    theirs = type("Theirs", (type(method),), {"__module__": "somebody"})()
    monkeypatch.setitem(identity.sys.modules, "somebody", type("Module", (), {"__file__": str(file)}))
    before = identity.source_digest(theirs, Case(problem="kepler", method=PEER))
    file.write_text("first = 2")
    assert identity.source_digest(theirs, Case(problem="kepler", method=PEER)) != before


def test_another_reference_makes_no_case_stale(monkeypatch):
    before = resolve(Case(problem="kepler", method=PEER)).id
    monkeypatch.setattr("hbvm_bench.reference.solutions.find_file", lambda problem: None)
    assert resolve(Case(problem="kepler", method=PEER)).id == before


def test_the_digest_of_the_kernel_is_that_of_its_code():
    digest = identity.kernel_digest()
    assert len(digest) == 64
    assert digest == identity.kernel_digest.__wrapped__()
