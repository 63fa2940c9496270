"""SciPy's own tests of ``solve_ivp``, as its wheel ships them, with our methods in every list of methods.

The module's source is read from the installed package, changed in memory:

* a list of SciPy's methods, by name or by class, becomes the list of ours;
* ``method="Radau"`` and calls of ``solve_ivp`` without a method get ours;
* tests that call no method (of tables, differences, interpolants) are left out;
* assertions on nfev, njev and nlu go: they are budgets of one method each. Ours solve
  the stages of a step to round-off, at 10 to 50 evaluations of a stage.
"""

import ast
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from scipy.integrate._ivp import ivp

THEIRS = set(ivp.METHODS)
MARKS = {"thread_unsafe", "fail_slow", "slow"}  # of SciPy's own test runner
COUNTERS = {"nfev", "njev", "nlu"}


class _WithOurMethods(ast.NodeTransformer):
    """Puts our methods in the place of SciPy's."""

    def __init__(self, ours: list[str]) -> None:
        self.ours = ours

    def _names_methods(self, node: ast.expr) -> bool:
        return (isinstance(node, ast.Constant) and node.value in THEIRS) or (
            isinstance(node, ast.Name) and node.id in THEIRS
        )

    def visit_List(self, node: ast.List) -> ast.AST:
        self.generic_visit(node)
        if not node.elts or not all(map(self._names_methods, node.elts)):
            return node
        text = isinstance(node.elts[0], ast.Constant)
        ours = [ast.Constant(name) if text else ast.Name(name, ast.Load()) for name in self.ours]
        return ast.copy_location(ast.List(ours, ast.Load()), node)

    def visit_keyword(self, node: ast.keyword) -> ast.AST:
        self.generic_visit(node)
        if node.arg == "method" and isinstance(node.value, ast.Constant) and node.value.value in THEIRS:
            node.value = ast.copy_location(ast.Constant(self.ours[0]), node.value)
        return node

    def visit_Assert(self, node: ast.Assert) -> ast.AST:
        return self._without_budgets(node)

    def visit_Expr(self, node: ast.Expr) -> ast.AST:
        return self._without_budgets(node)

    def _without_budgets(self, node: ast.Assert | ast.Expr) -> ast.AST:
        self.generic_visit(node)
        counted = any(isinstance(part, ast.Attribute) and part.attr in COUNTERS for part in ast.walk(node))
        return ast.copy_location(ast.Pass(), node) if counted else node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        self.generic_visit(node)
        node.decorator_list = [d for d in node.decorator_list if not MARKS & set(_attributes(d))]
        return node


def _attributes(node: ast.AST) -> list[str]:
    return [part.attr for part in ast.walk(node) if isinstance(part, ast.Attribute)]


def adapted(ours: Mapping[str, Any]) -> dict[str, Any]:
    """Return SciPy's tests by name, with methods of ours (names and classes) in the place of SciPy's."""
    spec = find_spec("scipy.integrate._ivp.tests.test_ivp")
    if spec is None or spec.origin is None:
        pytest.skip("this SciPy comes without its tests", allow_module_level=True)
    tree = _WithOurMethods(list(ours)).visit(ast.parse(Path(spec.origin).read_text()))
    named = "solve_ivp", *ours
    tests = [
        node.name
        for node in tree.body
        if isinstance(node, ast.FunctionDef)
        and node.name.startswith("test_")
        and any(isinstance(part, ast.Name) and part.id in named for part in ast.walk(node))
    ]
    namespace: dict[str, Any] = {"__name__": "adapted", **ours}  # numba would import the original
    code = compile(ast.fix_missing_locations(tree), spec.origin, "exec")
    exec(code, namespace)  # noqa: S102 -- the installed SciPy's own tests
    original = namespace["solve_ivp"]

    def solve_ivp(*args: Any, **kwargs: Any) -> Any:
        kwargs.setdefault("method", next(iter(ours)))
        return original(*args, **kwargs)

    namespace["solve_ivp"] = solve_ivp
    return {name: namespace[name] for name in tests}
