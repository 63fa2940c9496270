"""Symmetric positive definite matrices of formulas, factored as L D L' with their zeros left out."""

from collections.abc import Sequence

from problems.graph.nodes import Node

Rows = Sequence[dict[int, Node]]
"""Of a symmetric matrix the entries on and below the diagonal that are not 0, row by row, by column."""


class ZeroPivotError(Exception):
    """A pivot that is 0 whatever the numbers are; ``row`` says of which row."""

    def __init__(self, row: int):
        super().__init__(f"pivot {row} is 0")
        self.row = row


class Elimination:
    """The factors of a matrix.

    Parameters
    ----------
    rows : sequence of dict of int to Node
        The matrix, see `Rows`.

    Raises
    ------
    ZeroPivotError
        Where a pivot vanishes identically.
    """

    def __init__(self, rows: Rows) -> None:
        n = len(rows)
        self.lower: list[dict[int, Node]] = [{} for _ in range(n)]
        self.pivots: list[Node] = []
        for j in range(n):
            pivot = rows[j].get(j)
            for k, entry in self.lower[j].items():
                term = entry * entry * self.pivots[k]
                pivot = -term if pivot is None else pivot - term
            if pivot is None:
                raise ZeroPivotError(j)
            self.pivots.append(pivot)
            for i in range(j + 1, n):
                value = rows[i].get(j)
                for k, entry in self.lower[j].items():
                    if k in self.lower[i]:
                        term = self.lower[i][k] * entry * self.pivots[k]
                        value = -term if value is None else value - term
                if value is not None:
                    self.lower[i][j] = value / pivot

    def forward(self, right: Sequence[Node]) -> list[Node]:
        """Return z with L z = right."""
        z: list[Node] = []
        for value, entries in zip(right, self.lower, strict=True):
            for k, entry in entries.items():
                value = value - entry * z[k]
            z.append(value)
        return z

    def solve(self, right: Sequence[Node]) -> list[Node]:
        """Return x with L D L' x = right."""
        x = [z / pivot for z, pivot in zip(self.forward(right), self.pivots, strict=True)]
        for i in range(len(x) - 1, -1, -1):
            for k, entry in self.lower[i].items():
                x[k] = x[k] - entry * x[i]
        return x


def least_fill(neighbours: Sequence[set[int]]) -> list[int]:
    """Return an order of elimination with little fill: each time the row with the fewest neighbours left.

    Parameters
    ----------
    neighbours : sequence of set of int
        For each row those others that share an entry with it.
    """
    graph = {i: set(others) - {i} for i, others in enumerate(neighbours)}
    order = []
    while graph:
        row = min(graph, key=lambda i: (len(graph[i]), i))
        others = graph.pop(row)
        for other in others:
            graph[other] |= others
            graph[other] -= {row, other}
        order.append(row)
    return order
