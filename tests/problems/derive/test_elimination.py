"""L D L' of formulas against NumPy, with the zeros of chains, trees and loops."""

import numpy as np
import pytest

from problems.derive.elimination import Elimination, ZeroPivotError, least_fill
from problems.derive.function import function_of
from problems.evaluate.pairs import evaluate
from problems.graph.nodes import Graph


def matrix_of(random, n, pairs):
    """Return a positive definite matrix with entries at these pairs."""
    matrix = np.zeros((n, n))
    for i, j in pairs:
        matrix[i, j] = matrix[j, i] = random.uniform(-1.0, 1.0)
    return matrix + np.diag(np.abs(matrix).sum(axis=1) + 0.5)


def solved(matrix, right):
    """Return the solution by `Elimination` on constants, and the number of entries of L."""
    graph, n = Graph(), len(right)
    rows = [{j: graph.const(matrix[i, j]) for j in range(i + 1) if matrix[i, j]} for i in range(n)]
    factors = Elimination(rows)
    x = factors.solve([graph.const(value) for value in right])
    values = evaluate(function_of(graph, x), 0.0, np.zeros((1, 1)), np.empty(0))
    return np.array([float(value.rounded().ravel()[0]) for value in values]), sum(map(len, factors.lower))


@pytest.mark.parametrize("seed", range(20))
def test_the_solution_is_numpys(seed):
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 9))
    pairs = [(i, j) for i in range(n) for j in range(i) if random.random() < 0.4]
    matrix, right = matrix_of(random, n, pairs), random.standard_normal(n)
    x, _ = solved(matrix, right)
    assert np.abs(x - np.linalg.solve(matrix, right)).max() < 1e-13  # measured 1e-15


def test_a_chain_in_any_order_has_no_fill():
    random, n = np.random.default_rng(0), 30
    names = random.permutation(n)
    pairs = [(names[i], names[i + 1]) for i in range(n - 1)]
    order = least_fill([{b for pair in pairs for b in pair if a in pair} for a in range(n)])
    matrix = matrix_of(random, n, pairs)[np.ix_(order, order)]
    assert solved(matrix, np.ones(n))[1] == n - 1
    assert sorted(order) == list(range(n))


def test_a_pivot_that_vanishes_is_named():
    graph = Graph()
    with pytest.raises(ZeroPivotError) as raised:
        Elimination([{0: graph.const(1.0)}, {}])
    assert raised.value.row == 1
