"""Large systems are loops: the code grows with the declared term, not with the number of bodies.

Seconds are on a page of their own, `python -m docs.problem_pages --compile-times`.
"""

import re
import time
from itertools import pairwise

import numpy as np
import pytest

import problems
from integrators.kernel.native import stages
from problems import targets


@pytest.mark.parametrize(
    ("name", "arguments", "lines"),
    [
        ("cluster", {"n": 10}, 150),  # measured 115
        ("cluster", {"n": 200}, 60),  # measured 44
        ("sine_gordon", {"n": 1000}, 40),  # measured 22
        ("nonlinear_wave", {"n": 1000}, 40),  # measured 24
        ("fput", {"n": 1000}, 40),  # measured 26
        ("toda", {"n": 1000}, 40),  # measured 19
    ],
)
def test_large_fields_are_loops_that_compile_and_agree_with_numpy(name, arguments, lines):
    import numba

    problem = problems.load(name, **arguments)
    made = targets.source(problem.system, "field", "numba")
    assert made.text.count("\n") <= lines, "loops, not a line for each term"
    namespace = {"np": np, **{f: getattr(np, f) for f in ("sqrt", "sin", "cos", "exp", "log")}}
    exec(made.text, namespace)  # noqa: S102 -- emitted from a graph
    vector = numba.types.Array(numba.types.float64, 1, "C")
    kinds = (numba.types.float64, vector, vector, vector)
    field = numba.njit(kinds, error_model="numpy")(namespace[made.name])
    out = np.empty(problem.system.dim)
    field(0.0, problem.y0.copy(), problem.par.copy(), out)
    expected = targets.numpy(problem.system, "field")(0.0, problem.y0, problem.par)
    size = np.abs(expected).max()
    assert np.abs(out - expected).max() <= 4e-16 * size  # measured 0 but for the exponentials of toda


def test_a_long_sum_that_is_written_out_is_told():
    def energy(q, p):
        return sum(x**2 / 2 for x in p) + sum((a - b) ** 4 for a, b in pairwise(q))

    system = problems.Hamiltonian(energy, dof=700)
    with pytest.warns(UserWarning, match=r"4,896 operations written out.*m\.sum") as told:
        # Told before anything is compiled.
        targets.numba(system, "field")
    assert len(told) == 1


def conditions(y, m):
    n = len(y)
    return [m.where(y[i] > y[(i + 1) % n], -y[i] * y[i - 1], m.min(y[i], y[i - 2])) for i in range(n)]


def tables(t, y, m):
    return [m.table(t, KNOTS, np.sin(KNOTS * (i + 1))) - y[i] for i in range(len(y))]


def functions(y, m):
    return [m.tanh(y[i] + y[i - 1]) * m.exp(-(y[i - 2] ** 2)) * y[i] ** 2.5 for i in range(len(y))]


def products(y):
    return [sum((k + 0.5) * y[i] * y[i - k] * y[k] for k in range(8)) for i in range(len(y))]


KNOTS = np.linspace(0.0, 10.0, 21)


@pytest.mark.parametrize("field", [conditions, tables])
def test_conditions_and_tables_are_calls_and_no_branches(field):
    made = targets.source(problems.VectorField(field, dim=6), "field", "numba")
    assert not re.search(r"\b(if|while|for)\b", made.text)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("field", "dim"), [(conditions, 220), (tables, 160), (functions, 130), (products, 62)]
)
def test_what_is_less_than_2000_operations_is_compiled_in_seconds(field, dim):
    system = problems.VectorField(field, dim=dim)
    made, function = targets.source(system, "field", "numba"), targets.numba(system, "field").py_func
    assert 1500 < made.cost < 2000
    started = time.process_time()
    stages.build(function, 8)
    assert time.process_time() - started < 10.0  # measured: 2.2 to 2.6 beside ten other processes


def test_the_code_of_a_large_system_does_not_grow_with_it():
    small, large = (
        targets.source(problems.load("cluster", n=n).system, "field", "numba").text for n in (100, 300)
    )
    assert small.count("\n") == large.count("\n")
