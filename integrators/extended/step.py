"""A step of Gauss collocation in double-double arithmetic, by an iteration that begins in doubles.

The kernel's stages are doubles, and the numbers that end its iteration are those of doubles. Here the
stage equations, the tables and the field are evaluated in pairs of doubles, so that they have code and
numbers of their own.
"""

from functools import cache
from typing import Any

import numpy as np
from numba import njit

from integrators.coefficients import legendre
from integrators.extended.arithmetic import Numbers, compiled, minus, plus, times
from problems import targets
from problems.double_double import DD
from problems.systems.base import System

MOST_ITERATIONS = 200
SMALLEST = 1e-33  # relative change of the field at the stages that ends the iteration ...
SOLVED = 1e-27  # ... and the largest at which it may stagnate
SMALL = 1e-17  # a change that is added to the stages as a product of doubles
DOUBLES = 1e-14  # relative change that ends the iteration in doubles, which costs next to nothing


@cache
def tables(s: int) -> tuple[Numbers, Numbers, Numbers]:
    """Return nodes and weights, (s,), and coefficients, (s, s)."""
    doubles = legendre.tables(s, s)
    integrals, projection = _dd(doubles.integrals), _dd(doubles.projection)
    matrix = DD(np.zeros((s, s)))
    for j in range(s):
        matrix = matrix + integrals[:, j, None] * projection[j]
    return _numbers(doubles.nodes), _numbers(doubles.weights), _numbers(matrix)


def ends_of_projection(s: int) -> Numbers:
    """Return b_l P_j(c_l) for the first and the last two j, (3, s)."""
    return _numbers(_dd(legendre.tables(s, s).projection)[[0, -2, -1]])


def _dd(table: Any) -> DD:
    return DD(table.hi, table.lo)


def _numbers(table: Any) -> Numbers:
    return table.hi + 1j * table.lo


def field_of(system: System) -> tuple[str, tuple[Any, Any]]:
    """Return a digest of a system's field, and the field for numbers and for doubles.

    Both are ``field(t, y, par, out)``.
    """
    source = targets.source(system, "field", "numba", limit=0)
    field = targets.compiled("double-double", source, lambda: compiled(source.text, source.name))
    return source.sha256, (field, targets.numba(system, "field", limit=0))


@njit
def weighted(weights, values):
    """Return the sum of weights times values."""
    total = complex(0.0)
    for i in range(len(weights)):
        total = plus(total, times(weights[i], values[i]))
    return total


def solver(fields: tuple[Any, Any]) -> Any:
    """Return what solves the stage equations of a step, with the fields of `field_of`.

    ``solve(t, y, par, step, nodes, matrix, slope, new)`` takes a time, a state, parameters and the length of
    the step, all of them numbers; ``slope`` and ``new``, of shape (s, dim), are room. It returns the
    iterations in double-double, and the relative change by the last of them; the field at the stages is then
    in ``slope``.
    """
    field, in_doubles = fields

    @njit
    def begin(t, y, par, step, nodes, matrix, slope):
        """Solve the stage equations in doubles, as far as that goes; ``slope`` has a first guess."""
        s, dim = slope.shape
        values, new, stage = slope.real.T.copy(), np.zeros((s, dim)), np.zeros(dim)
        before = np.inf
        for _ in range(MOST_ITERATIONS):
            for i in range(s):
                for d in range(dim):
                    total = 0.0
                    for j in range(s):
                        total += matrix[i, j] * values[d, j]
                    stage[d] = y[d] + step * total
                in_doubles(t + step * nodes[i], stage, par, new[i])
            change = np.abs(new - values.T).max() / max(1e-300, np.abs(new).max())
            if not change < before:
                return
            values[:] = new.T
            slope[:] = new
            if change < DOUBLES:
                return
            before = change

    @njit
    def solve(t, y, par, step, nodes, matrix, slope, new):
        s, dim = len(nodes), len(y)
        stages, moved = np.zeros((s, dim), np.complex128), np.zeros((dim, s))
        low_matrix, low_nodes = matrix.real.copy(), nodes.real.copy()
        field(t, y, par, new[0])
        for i in range(s):
            slope[i] = new[0]
        begin(t.real, y.real.copy(), par.real.copy(), step.real, low_nodes, low_matrix, slope)
        before, change, count = np.inf, np.inf, 0
        for _ in range(MOST_ITERATIONS):
            count += 1
            for i in range(s):
                for d in range(dim):
                    if change > SMALL:
                        stages[i, d] = plus(y[d], times(weighted(matrix[i], slope[:, d]), step))
                    else:
                        total = 0.0
                        for j in range(s):
                            total += low_matrix[i, j] * moved[d, j]
                        stages[i, d] = plus(stages[i, d], complex(step.real * total))
                field(plus(t, times(step, nodes[i])), stages[i], par, new[i])
            change, size = 0.0, 1e-300
            for d in range(dim):
                for i in range(s):
                    gap = minus(new[i, d], slope[i, d])
                    moved[d, i] = gap.real
                    change = max(change, abs(gap.real))
                    size = max(size, abs(new[i, d].real))
            slope[:] = new
            change /= size
            if not change < np.inf:
                break
            if change < SMALLEST or (change < SOLVED and change >= 0.5 * before):
                break
            before = change
        return count, change

    return solve
