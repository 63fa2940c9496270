"""L D L' of formulas against NumPy, with the zeros of chains, trees and loops."""

import numpy as np
import pytest

from problems.derive.elimination import (
    Elimination,
    ZeroPivotError,
    independent_levels,
    least_fill,
    with_loops,
    with_nodes,
)
from problems.derive.function import function_of
from problems.evaluate.pairs import evaluate
from problems.graph.each import readable
from problems.graph.nodes import Graph


def matrix_of(random, n, pairs):
    """Return a positive definite matrix with entries at these pairs."""
    matrix = np.zeros((n, n))
    for i, j in pairs:
        matrix[i, j] = matrix[j, i] = random.uniform(-1.0, 1.0)
    return matrix + np.diag(np.abs(matrix).sum(axis=1) + 0.5)


def neighbours_of(n, pairs):
    return [{b for pair in pairs for b in pair if a in pair} - {a} for a in range(n)]


@pytest.mark.parametrize("filled", ["nodes", "loops"])
@pytest.mark.parametrize("seed", range(10))
def test_the_solution_is_numpys(seed, filled):
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 9))
    pairs = [(i, j) for i in range(n) for j in range(i) if random.random() < 0.4]
    matrix, right = matrix_of(random, n, pairs), random.standard_normal(n)
    graph = Graph()
    entries = [(i, j) for i in range(n) for j in range(i + 1) if matrix[i, j]]
    arrays = [[graph.const(float(x)) for x in values] for values in ([matrix[e] for e in entries], right)]
    if filled == "loops":
        arrays = [readable(graph, values) for values in arrays]
    x = Elimination(
        {entry: place for place, entry in enumerate(entries)}, *arrays,
        independent_levels(neighbours_of(n, pairs)), with_nodes if filled == "nodes" else with_loops(graph),
    ).solve()  # fmt: skip
    values = evaluate(function_of(graph, x), 0.0, np.zeros((1, 1)), np.empty(0))
    found = np.array([float(value.rounded().ravel()[0]) for value in values])
    assert np.abs(found - np.linalg.solve(matrix, right)).max() < 1e-13  # measured 1e-15


def test_a_chain_in_any_order_has_few_levels_and_little_fill():
    random, n = np.random.default_rng(0), 100
    names = random.permutation(n)
    pairs = [(names[i], names[i + 1]) for i in range(n - 1)]
    neighbours = neighbours_of(n, pairs)
    assert sorted(least_fill(neighbours)) == list(range(n))
    levels = independent_levels(neighbours)
    assert sorted(row for level in levels for row in level) == list(range(n))
    assert all(not neighbours[a] & set(level) for level in levels[:1] for a in level)  # later ones have fill
    assert len(levels) < 10  # measured 8; one row at a time: 100


def test_a_pivot_that_vanishes_is_named():
    graph = Graph()
    with pytest.raises(ZeroPivotError) as raised:
        Elimination({(0, 0): 0}, [graph.const(1.0)], [graph.const(1.0)] * 2, [[0, 1]], with_nodes)
    assert raised.value.row == 1
