"""What machine code is kept by: an edit of any module that it was compiled from makes another key."""

import ast
import sys

import pytest

from integrators.kernel.ahead import ENGINES
from integrators.kernel.native import binary, field
from integrators.kernel.native.engine import KERNEL, Engine

ROOTS = {name: engine._module for name, engine in ENGINES.items()} | {"fields": field.BUILT_BY}
BESIDE = {
    "integrators.running.watchdog",
    "problems.analysis.roundoff",
    "problems.targets.called",
}  # what they have is compiled too


def reached(module):
    """Return the modules that one imports, and that those import."""
    seen, waiting = set(), [module]
    while waiting:
        name = waiting.pop()
        if name not in seen:
            seen.add(name)
            waiting += binary.imported(binary._file(name).read_text())
    return seen


@pytest.mark.parametrize("name", ROOTS)
def test_an_edit_of_any_module_that_is_imported_makes_another_key(name, monkeypatch, tmp_path):
    """Before, a constant of `problems.analysis.sides` was compiled in, and in no key."""
    root, file = ROOTS[name], binary._file
    key = binary.sources.__wrapped__(root)
    modules = reached(root)
    assert len(modules) > 5
    for module in sorted(modules)[:: max(1, len(modules) // 6)]:
        (tmp_path / "edited.py").write_text(file(module).read_text() + "# edited\n")
        other = {module: tmp_path / "edited.py"}
        with monkeypatch.context() as patch:
            patch.setattr(binary, "_file", lambda name, other=other: other.get(name, file(name)))
            assert binary.sources.__wrapped__(root) != key, module


@pytest.mark.parametrize("name", ROOTS)
def test_a_key_depends_on_the_kernel_alone(name):
    """Else each edit of a problem would compile the kernel anew."""
    beside = {module for module in reached(ROOTS[name]) if not module.startswith(KERNEL)}
    assert beside <= BESIDE | {"problems.targets.cache", "problems.locks", "problems.errors"}


def test_imports_are_those_that_python_executes():
    """But for those inside of `if TYPE_CHECKING`, of which nothing can be compiled in."""
    for name in reached("integrators.kernel.ensemble.own"):
        tree = ast.parse(binary._file(name).read_text())
        for node in ast.walk(tree):
            if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
                node.body = [ast.Pass()]
        executed = {
            f"{node.module}.{alias.name}" if f"{node.module}.{alias.name}" in sys.modules else node.module
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom)
            and (node.module or "").startswith(("integrators", "problems"))
            for alias in node.names
        }
        packages = {module for module in executed if binary._file(module).name == "__init__.py"}
        assert executed - packages <= binary.imported(binary._file(name).read_text()), name


def test_two_functions_of_a_module_have_two_keys():
    keys = {Engine("adjoint.entry", name, "a").key for name in ("record", "pull")}
    keys.add(Engine("inside.entry", "entry", "a").key)
    assert len(keys) == 3
    assert len({engine.key for engine in ENGINES.values()}) == len(ENGINES)
