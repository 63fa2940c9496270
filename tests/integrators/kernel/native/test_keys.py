"""What machine code is kept by: an edit of any module that it was compiled from makes another key."""

import ast
from pathlib import Path

import pytest

import integrators
from integrators.kernel.ensemble import engine as ensemble
from integrators.kernel.events import engine as events
from integrators.kernel.implicit import engine as implicit
from integrators.kernel.line import engine as line
from integrators.kernel.native.engine import Engine
from integrators.kernel.step import engine as step

ENGINES = {
    "steps": step.steps,
    "groups": ensemble.run,
    "own steps in lanes": ensemble.run_own,
    "events": events.look,
    "implicit": implicit.solver,
    "line": line.line,
}
ROOT = Path(integrators.__file__).parent
IN_PYTHON = {"integrators.protocol"}  # types and exceptions, nothing that is compiled


def reached(module, seen):
    """Add to ``seen`` the modules that one imports at its top, and that those import."""
    path = ROOT.parent / Path(*module.split(".")).with_suffix(".py")
    if module in seen or not path.exists():
        return
    seen[module] = path
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("integrators"):
            reached(node.module, seen)
            for name in node.names:
                reached(f"{node.module}.{name.name}", seen)


@pytest.mark.parametrize("name", ENGINES)
def test_every_module_that_is_compiled_is_in_the_key(name):
    # Before, the constants of the watchdog were not in that of own steps in lanes.
    engine, seen = ENGINES[name], {}
    reached(engine._make().__module__, seen)
    kernel = ROOT / "kernel"
    kept = [(kernel / source).resolve() for source in engine._sources]
    missing = {
        module
        for module, path in seen.items()
        if not any(path.parent == place or path.with_suffix("") == place for place in kept)
    }
    assert len(seen) > 5
    assert missing <= IN_PYTHON


def test_two_functions_of_a_module_have_two_keys():
    def first():
        raise AssertionError

    def second():
        raise AssertionError

    keys = {Engine(make, "a", "simd").key for make in (first, second)}
    keys.add(Engine(first, "a", "simd", "native").key)
    assert len(keys) == 3
    assert Engine(first, "a", "simd").key in keys
    assert len({engine.key for engine in ENGINES.values()}) == len(ENGINES)
