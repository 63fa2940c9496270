"""REBOUND's own tests, as its wheel ships them, with our integrator in the place of its own.

The modules' sources are read from the installed package and changed in memory: wherever a test chooses one of
REBOUND's general integrators it gets ours, and what it sets of that integrator's own options goes. Tests that
choose no integrator, or a special one, are left out.
"""

import ast
import unittest
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

NAME = "hbvm"  # registered when the plugin is imported, which compiles: not while tests are collected
THEIRS = {"ias15", "leapfrog", "whfast"}
Setting = Mapping[str, float]
"""Attributes of a simulation, as ``dt``, or of its integrator, as ``integrator.tol``, and their values."""


class _WithOurs(ast.NodeTransformer):
    """Puts our integrator in the place of REBOUND's; ``changed`` says whether it did so."""

    def __init__(self, settings: Mapping[str, Setting]) -> None:
        self.settings, self.changed = settings, False

    def visit_Assign(self, node: ast.Assign) -> Any:
        self.generic_visit(node)
        target = node.targets[0]
        if not isinstance(target, ast.Attribute):
            return node
        chosen = node.value.value if isinstance(node.value, ast.Constant) else None
        if target.attr == "integrator" and isinstance(chosen, str) and chosen.lower() in self.settings:
            self.changed = True
            new: list[ast.stmt] = [ast.copy_location(ast.Assign(node.targets, ast.Constant(NAME)), node)]
            for path, value in self.settings[chosen.lower()].items():
                place: Any = target.value
                for attribute in path.split("."):
                    place = ast.Attribute(place, attribute, ast.Load())
                place.ctx = ast.Store()
                new.append(ast.copy_location(ast.Assign([place], ast.Constant(value)), node))
            return new
        if self.changed and isinstance(target.value, ast.Attribute) and target.value.attr == "integrator":
            return ast.copy_location(ast.Pass(), node)
        return node

    def visit_List(self, node: ast.List) -> ast.AST:
        values = {item.value for item in node.elts if isinstance(item, ast.Constant)}
        plain = {name for name, setting in self.settings.items() if not setting}
        if plain & values:
            self.changed = True
            return ast.copy_location(ast.List([ast.Constant(NAME)], ast.Load()), node)
        return self.generic_visit(node)


def _adapt(tree: ast.Module, settings: Mapping[str, Setting], steps: Mapping[str, float]) -> None:
    """Put our integrator into a module's tests; drop the tests that have no place for it."""
    helpers = False
    for statement in tree.body:
        if not isinstance(statement, ast.ClassDef):
            with_ours = _WithOurs(settings)
            with_ours.visit(statement)
            helpers |= with_ours.changed
    for group in (statement for statement in tree.body if isinstance(statement, ast.ClassDef)):
        kept, prepared = [], helpers
        for method in group.body:
            name = getattr(method, "name", "")
            of_test = {"dt": steps[name]} if name in steps else {}
            with_ours = _WithOurs({theirs: {**setting, **of_test} for theirs, setting in settings.items()})
            kept.append(with_ours.visit(method))
            if name == "setUp":
                prepared |= with_ours.changed
            elif name.startswith("test_") and not (prepared or with_ours.changed):
                kept[-1] = ast.copy_location(ast.Pass(), method)
        group.body = kept


def adapted(
    module: str,
    settings: Mapping[str, Setting],
    fails: Mapping[str, str],
    skips: Mapping[str, str] = {},
    steps: Mapping[str, float] = {},
) -> dict[str, Any]:
    """Return the test classes of a module of REBOUND's, by names of their own.

    Parameters
    ----------
    module : str
        Its name without ``test_``.
    settings : mapping
        The integrators whose place ours takes, each with what is set there.
    fails : mapping of str to str
        Reasons why tests fail, by ``module_test``.
    skips : mapping of str to str
        Reasons why tests are not run.
    steps : mapping of str to float
        Timesteps of single tests.
    """
    spec = find_spec(f"rebound.tests.test_{module}")
    if spec is None or spec.origin is None:
        pytest.skip("this REBOUND comes without its tests", allow_module_level=True)
    tree = ast.parse(Path(spec.origin).read_text())
    _adapt(tree, settings, steps)
    namespace: dict[str, Any] = {"__name__": spec.name}
    code = compile(ast.fix_missing_locations(tree), spec.origin, "exec")
    exec(code, namespace)  # noqa: S102 -- the installed REBOUND's own tests
    groups = [
        item for item in namespace.values() if isinstance(item, type) and issubclass(item, unittest.TestCase)
    ]
    for group in groups:
        for name in [name for name in vars(group) if name.startswith("test_")]:
            if (reason := fails.get(f"{module}_{name}")) is not None:
                setattr(group, name, pytest.mark.xfail(reason=reason, strict=True)(getattr(group, name)))
            if (reason := skips.get(f"{module}_{name}")) is not None:
                setattr(group, name, pytest.mark.skip(reason=reason)(getattr(group, name)))
    return {f"{module}_{group.__name__}": group for group in groups}
