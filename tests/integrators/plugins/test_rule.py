"""The stage solvers outside the kernel have one set of numbers, which are the kernel's."""

import ast
from pathlib import Path

import integrators.plugins
from integrators.kernel import tables, tolerance
from integrators.kernel.step import control, estimate, stopping
from integrators.kernel.step import rule as kernel
from integrators.methods import automatic
from integrators.plugins import rule
from integrators.plugins.rebound import step as rebound
from integrators.plugins.scipy import python as scipy

FOLDER = Path(integrators.plugins.__path__[0])


def test_they_are_the_kernel_s():
    ours = (rule.CONVERGED, rule.STAGNATION, rule.STAGNATION_LIMIT, rule.FLOOR, rule.FARTHEST)
    theirs = (
        kernel.TOLERANCE, kernel.STAGNATION, kernel.STAGNATION_LIMIT, kernel.FLOOR, kernel.FARTHEST
    )  # fmt: skip
    assert ours == theirs
    assert {rule.is_rounding, rebound.ends_in_rounding.py_func} == {kernel.is_rounding}
    assert stopping.is_rounding.py_func is kernel.is_rounding
    assert (rule.MAX_ITERATIONS, rule.MODES) == (kernel.MOST_ITERATIONS, tables.MODES)


def test_no_plugin_has_one_of_its_own():
    files = [path for path in FOLDER.rglob("*.py") if path.name != "rule.py"]
    assert len(files) > 10
    for path in files:
        for node in ast.walk(ast.parse(path.read_text())):
            names = [target.id for target in getattr(node, "targets", ()) if isinstance(target, ast.Name)]
            assert not {*names} & {*rule.__all__}, path


def test_whoever_chooses_steps_has_the_order_of_their_errors_from_one_function():
    interpreted = (scipy.error_order, automatic.error_order)
    compiled = (control.error_order.py_func, rebound.error_order.py_func)
    assert {*interpreted, *compiled} == {tolerance.error_order}


def test_whoever_estimates_an_error_does_so_by_one_formula():
    compiled = (estimate.left_out.py_func, rebound.left_out.py_func)
    assert {scipy.left_out, *compiled} == {tolerance.left_out}
