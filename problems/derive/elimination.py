"""Symmetric positive definite matrices of formulas, factored as L D L' with their zeros left out."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from problems.graph.each import Each, scatter
from problems.graph.nodes import Graph, Node

Places = Mapping[tuple[int, int], int]
"""Of a symmetric matrix the entries (i, j), j <= i, that are not 0, and where in an array each is."""
Values = Any
"""An array: a list of nodes, or an `Each`, which loops read as well."""
Part = tuple[Callable[..., dict[Any, Node]], Any]
"""What adds to an array: a term, called with each of some rows of integers, gives sums by their places."""
Filled = Callable[[int, Sequence[Part]], Values]
"""Returns an array of so many values, each the sum of what the parts add to it, in their order."""


class ZeroPivotError(Exception):
    """A pivot that is 0 whatever the numbers are; ``row`` says of which row."""

    def __init__(self, row: int):
        super().__init__(f"pivot {row} is 0")
        self.row = row


class _Level(NamedTuple):
    """The equations that are left, and the rows that leave them: no two of these share an entry."""

    matrix: Values
    right: Values
    rows: dict[int, int]  # places in ``right``
    pivots: dict[int, int]  # of the rows that leave, places in ``matrix``
    lower: Values
    below: list[tuple[int, int, int]]  # of L the rows i, the columns k and the places of its entries


class Elimination:
    """The equations ``A x = b`` as sums of products, level by level.

    Rows of one level are eliminated side by side, so that each level is a few loops; the Schur complement
    is what is left for the next one.

    Parameters
    ----------
    places : mapping of (int, int) to int
        Of A, see `Places`.
    matrix, right : sequence of Node
        The entries of A in their places, and b.
    levels : sequence of sequence of int
        The rows in the order of elimination; those of one level share no entry when their turn comes.
    filled : callable
        Makes arrays, see `Filled`: `with_nodes` or `with_loops`.

    Raises
    ------
    ZeroPivotError
        Where a pivot vanishes identically.
    """

    def __init__(
        self, places: Places, matrix: Values, right: Values, levels: Sequence[Sequence[int]], filled: Filled
    ) -> None:
        self._filled = filled
        self._levels: list[_Level] = []
        rows = {row: i for i, row in enumerate(sorted(row for level in levels for row in level))}
        for level in levels:
            for k in level:
                if (k, k) not in places:
                    raise ZeroPivotError(k)
            leave = set(level)
            columns: dict[int, list[int]] = {k: [] for k in level}
            for i, j in sorted(places):
                if (i in leave) != (j in leave):
                    columns[j if j in leave else i].append(i if j in leave else j)
            below = [(i, k) for k in level for i in sorted(columns[k])]
            entry = {pair: number for number, pair in enumerate(below)}
            lower = filled(
                len(below),
                [(
                    lambda to, at, pivot, S=matrix: {to: S[at] / S[pivot]},
                    [(to, places[max(i, k), min(i, k)], places[k, k]) for to, (i, k) in enumerate(below)],
                )],
            )  # fmt: skip
            self._levels.append(
                _Level(
                    matrix, right, rows, {k: places[k, k] for k in level}, lower,
                    [(i, k, entry[i, k]) for i, k in below],
                )
            )  # fmt: skip
            new_rows = {row: i for i, row in enumerate(row for row in rows if row not in leave)}
            new = {pair: i for i, pair in enumerate(p for p in places if not leave & set(p))}
            kept = [(to, places[pair]) for pair, to in new.items()]
            updates = [
                (new.setdefault((i, j), len(new)), entry[i, k], entry[j, k], places[k, k])
                for k in level
                for i in sorted(columns[k])
                for j in sorted(columns[k])
                if j <= i
            ]
            matrix, right = (
                filled(
                    len(new),
                    [
                        (lambda to, at, S=matrix: {to: S[at]}, kept),
                        (lambda to, a, b, d, S=matrix, L=lower: {to: -(L[a] * L[b] * S[d])}, updates),
                    ],
                ),
                filled(
                    len(new_rows),
                    [
                        (
                            lambda to, at, r=right: {to: r[at]},
                            [(to, rows[row]) for row, to in new_rows.items()],
                        ),
                        (
                            lambda to, a, k, r=right, L=lower: {to: -(L[a] * r[k])},
                            [(new_rows[i], a, rows[k]) for (i, k), a in entry.items()],
                        ),
                    ],
                ),
            )
            places, rows = new, new_rows

    def forward(self) -> dict[int, tuple[Node, Node]]:
        """Return of each row z with L z = b, and the pivot."""
        return {
            k: (level.right[level.rows[k]], level.matrix[pivot])
            for level in self._levels
            for k, pivot in level.pivots.items()
        }

    def solve(self) -> Values:
        """Return x."""
        x: Values = ()
        after: dict[int, int] = {}
        for level in reversed(self._levels):
            x = self._filled(
                len(level.rows),
                [
                    (lambda to, at, x=x: {to: x[at]}, [(level.rows[row], at) for row, at in after.items()]),
                    (
                        lambda to, d, r=level.right, S=level.matrix: {to: r[to] / S[d]},
                        [(level.rows[k], pivot) for k, pivot in level.pivots.items()],
                    ),
                    (
                        lambda to, a, i, x=x, L=level.lower: {to: -(L[a] * x[i])},
                        [(level.rows[k], a, after[i]) for i, k, a in level.below],
                    ),
                ],
            )
            after = level.rows
        return x


def with_nodes(size: int, parts: Sequence[Part]) -> Values:
    """Return an array whose sums are written out; see `Filled`."""
    sums: dict[int, Node] = {}
    for term, rows in parts:
        for row in rows:
            for place, node in term(*row).items():
                sums[place] = sums[place] + node if place in sums else node
    return [sums[i] for i in range(size)]


def with_loops(graph: Graph) -> Filled:
    """Return what fills arrays by loops; see `Filled`."""

    def filled(size: int, parts: Sequence[Part]) -> Each:
        arrays = [scatter(graph, term, rows, size) for term, rows in parts if len(rows)]
        return Each(graph, size, tuple(loop for array in arrays for loop in array.loops))

    return filled


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
        _take(graph, row)
        order.append(row)
    return order


def independent_levels(neighbours: Sequence[set[int]]) -> list[list[int]]:
    """Return an order of elimination with little fill and few levels: of a chain, every other row each time.

    A level has rows that share no entry, none with more than twice the fewest neighbours that a row has
    (and with two, so that a chain is not eaten from its ends).

    Parameters
    ----------
    neighbours : sequence of set of int
        As for `least_fill`.
    """
    graph = {i: set(others) - {i} for i, others in enumerate(neighbours)}
    levels = []
    while graph:
        most = 2 * max(1, min(map(len, graph.values())))
        level: list[int] = []
        beside: set[int] = set()
        for row in sorted(graph, key=lambda i: (len(graph[i]), i)):
            if len(graph[row]) <= most and row not in beside:
                level.append(row)
                beside |= graph[row]
        for row in level:
            _take(graph, row)
        levels.append(sorted(level))
    return levels


def _take(graph: dict[int, set[int]], row: int) -> None:
    """Eliminate a row: its neighbours become neighbours of each other."""
    others = graph.pop(row)
    for other in others:
        graph[other] |= others
        graph[other] -= {row, other}
