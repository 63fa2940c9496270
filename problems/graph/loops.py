"""Loops over lists of integers, and what is read and added up by them."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Node = Any
"""A `problems.graph.nodes.Node`: graphs are made of these loops, and not the other way round."""

Integers = NDArray[np.int64]


class Loop:
    """The index list of a loop; one object per graph and list.

    Attributes
    ----------
    rows : ndarray of int64, shape (n, width)
        The indices, one row per term.
    id : int
        Ordinal number in its graph.
    """

    def __init__(self, rows: Integers, number: int) -> None:
        self.rows = rows
        self.id = number

    def __len__(self) -> int:
        return len(self.rows)

    def __repr__(self) -> str:
        return f"Loop({len(self.rows)}x{self.rows.shape[1]})"

    @property
    def width(self) -> int:
        """Number of integers that a term is called with."""
        return self.rows.shape[1]

    @cached_property
    def count(self) -> "Affine | None":
        """The number of the term, from 0 on, as a function of the indices; ``None`` if it is none."""
        return affine(self.rows, np.arange(len(self.rows)))


@dataclass(frozen=True)
class Affine:
    """An index that is an affine function of a loop's integers.

    Attributes
    ----------
    coefficients : tuple of int
        One per integer of the loop.
    offset : int
        The constant part.
    """

    coefficients: tuple[int, ...]
    offset: int

    def values(self, loop: Loop) -> Integers:
        """Return the index of every term, shape (n,)."""
        return loop.rows @ np.array(self.coefficients, dtype=np.int64) + self.offset

    def shifted(self, shift: int) -> "Affine":
        """Return the index plus a constant."""
        return Affine(self.coefficients, self.offset + shift)

    def times(self, factor: int) -> "Affine":
        """Return a multiple of the index."""
        return Affine(tuple(factor * c for c in self.coefficients), factor * self.offset)

    def widened(self, width: int, at: int = 0) -> "Affine":
        """Return the same index of a loop that has the columns of this one from ``at`` on."""
        coefficients = [0] * width
        coefficients[at : at + len(self.coefficients)] = self.coefficients
        return Affine(tuple(coefficients), self.offset)


Place = int | Affine
"""Of an array: one for all terms, or another one for each term of a loop."""


def affine(rows: Integers, values: Integers) -> Affine | None:
    """Return integers as an affine function of those in the rows, ``None`` if they are none."""
    for column, listed in enumerate(rows.T):
        if np.array_equal(listed, values):
            return Affine(tuple(int(i == column) for i in range(rows.shape[1])), 0)
    matrix = np.hstack([rows, np.ones((len(rows), 1), dtype=np.int64)])
    first = matrix[: 4 * matrix.shape[1]], values[: 4 * matrix.shape[1]]
    for part, wanted in (first, (matrix, values)):
        solution = np.rint(np.linalg.lstsq(part, wanted, rcond=None)[0]).astype(np.int64)
        if not np.array_equal(part @ solution, wanted):
            continue
        if np.array_equal(matrix @ solution, values):
            return Affine(tuple(int(c) for c in solution[:-1]), int(solution[-1]))
    return None


@dataclass(frozen=True, eq=False)
class Constants:
    """Numbers that loops read by an index.

    Attributes
    ----------
    values : ndarray, shape (n,)
    id : int
        Ordinal number in its graph.
    """

    values: NDArray[np.float64]
    id: int


Summands = tuple[tuple[Loop, tuple[tuple[Affine, Node], ...]], ...]
"""What loops add up: for each of them places, and the nodes that are added there."""


@dataclass(frozen=True, eq=False)
class Stage:
    """An array of intermediate values, which loops fill before others read it.

    Attributes
    ----------
    id : int
        Ordinal number in its graph.
    size : int
        Number of values.
    loops : tuple of (Loop, tuple of (Affine, Node))
        Summands in loops: they come first.
    terms : tuple of (int, Node)
        Further summands, in order: the place of each, and the node.
    """

    id: int
    size: int
    loops: Summands
    terms: tuple[tuple[int, Node], ...]

    @property
    def roots(self) -> tuple[Node, ...]:
        """The nodes of all summands."""
        inside = tuple(node for _, entries in self.loops for _, node in entries)
        return inside + tuple(node for _, node in self.terms)

    def parts(
        self, renewed: Callable[[Node], Node], loop: Callable[[Loop], Loop]
    ) -> tuple[Summands, tuple[tuple[int, Node], ...]]:
        """Return the summands with other nodes, without those that become ``None``; and with other loops."""
        loops = tuple(
            (
                loop(each),
                tuple((place, new) for place, node in entries if (new := renewed(node)) is not None),
            )
            for each, entries in self.loops
        )
        terms = tuple((place, new) for place, node in self.terms if (new := renewed(node)) is not None)
        return tuple(part for part in loops if part[1]), terms
