"""A stored case is stale when what its numbers depend on changed, and only then."""

import ast
from pathlib import Path

import pytest

import integrators.registry
from hbvm_bench import identity
from hbvm_bench.campaign import Case
from hbvm_bench.identity import UNUSED_BY_OURS, UNUSED_BY_PEERS, resolve, sources

OURS, PEER = "Gauss(s=2, h=0.5)", "IAS15()"


def imported(path, name):
    """Return the modules that a file names in its imports, at its head or anywhere below."""
    package = name.removesuffix(".py").removesuffix("/__init__").replace("/", ".").rpartition(".")[0]
    found, left = set(), [ast.parse(path.read_text(encoding="utf-8"))]
    while left:
        node = left.pop()
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue  # nothing is imported there
        left += ast.iter_child_nodes(node)
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            module = package if node.level else node.module or ""
            found |= {module} | {f"{module}.{alias.name}" for alias in node.names}
    return found


def closure(start):
    """Return the names of all our files that modules reach by their imports."""
    every = {
        name.removesuffix(".py").removesuffix("/__init__").replace("/", "."): (name, path)
        for name, path in sources(())
    }
    reached, left = set(), set(start)
    while left:
        module = left.pop()
        if module in every and module not in reached:
            reached.add(module)
            left |= imported(every[module][1], every[module][0])
    return {every[module][0] for module in reached}


@pytest.mark.parametrize(("ours", "unused"), [(True, UNUSED_BY_OURS), (False, UNUSED_BY_PEERS)])
def test_nothing_that_a_method_imports_is_left_out(ours, unused):
    entries = integrators.registry._entries().values()
    modules = [e.module for e in entries if e.module.startswith("integrators.")]
    mine = [module for module in modules if module.startswith("integrators.peers") is not ours]
    kept = {name for name, _ in sources(unused)}
    assert len(mine) >= 3
    assert closure([*mine, "integrators", "integrators.integrate"]) <= kept


def test_a_peers_case_outlives_a_change_of_the_kernel_and_ours_a_change_of_a_peer(monkeypatch):
    def ids():
        identity._digest_without.cache_clear()
        return [resolve(Case(problem="kepler", method=method)).id for method in (OURS, PEER)]

    def edited(part):
        read = Path.read_bytes
        monkeypatch.setattr(
            Path, "read_bytes", lambda path: read(path) + (b"#" if part in path.as_posix() else b"")
        )
        found = ids()
        monkeypatch.undo()
        return found

    ours, peer = ids()
    kernel, rebound = edited("integrators/kernel/step.py"), edited("integrators/peers/rebound_ias15.py")
    common, unused = edited("problems/tracing.py"), edited("integrators/plugins/scipy.py")
    identity._digest_without.cache_clear()
    assert kernel[0] != ours
    assert kernel[1] == peer
    assert rebound[0] == ours
    assert rebound[1] != peer
    assert common[0] != ours
    assert common[1] != peer
    assert unused == [ours, peer]


def test_another_reference_makes_a_case_stale(monkeypatch):
    before = resolve(Case(problem="kepler", method=PEER)).id
    monkeypatch.setattr("hbvm_bench.reference.find_file", lambda problem: None)
    assert resolve(Case(problem="kepler", method=PEER)).id != before
