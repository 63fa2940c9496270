"""How the index list of a declared sum becomes ``for`` statements over plain ranges."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from problems.graph.nodes import Affine, Loop
from problems.targets.printer import variable

_SEGMENTS = 4  # at most as many ranges for one list; longer patchworks read a table


@dataclass(frozen=True, eq=False)
class Range:
    """A run of rows that are an arithmetic progression: one ``for`` over ``k``, or one row.

    Attributes
    ----------
    first, step : ndarray, shape (width,)
        Row k is ``first + k*step``.
    n : int
        Number of rows.
    """

    first: NDArray[np.int64]
    step: NDArray[np.int64]
    n: int

    def along(self, affine: Affine) -> Affine:
        """Return an index as a function of k."""
        coefficients = np.array(affine.coefficients)
        return Affine((int(coefficients @ self.step),), int(coefficients @ self.first) + affine.offset)

    def index(self, affine: Affine) -> str:
        """Return the text of an index."""
        along = self.along(affine)
        return index_text(along, ["k"]) if self.n > 1 else str(along.offset)

    def opening(self) -> list[str]:
        """Return the lines that open the loop."""
        return [f"for k in range({self.n}):"] if self.n > 1 else []


@dataclass(frozen=True)
class Nest:
    """All pairs in an order that two nested ranges give.

    Attributes
    ----------
    outer, inner : str
        The ranges of i and j.
    """

    outer: str
    inner: str

    def index(self, affine: Affine) -> str:
        """Return the text of an index."""
        return index_text(affine, ["i", "j"])


@dataclass(frozen=True)
class Table:
    """Any list: its rows are read from an array.

    Attributes
    ----------
    name : str
        Of the array, shape (n, width).
    n, width : int
        Its shape.
    """

    name: str
    n: int
    width: int

    def index(self, affine: Affine) -> str:
        """Return the text of an index."""
        return index_text(affine, [variable("column", column) for column in range(self.width)])

    def opening(self) -> list[str]:
        """Return the lines that open the loop."""
        reads = [
            f"    {variable('column', column)} = {self.name}[k, {column}]" for column in range(self.width)
        ]
        return [f"for k in range({self.n}):", *reads]


def index_text(affine: Affine, variables: Sequence[str]) -> str:
    """Return an affine index as Python text."""
    parts = [
        variable if coefficient == 1 else f"{coefficient}*{variable}"
        for coefficient, variable in zip(affine.coefficients, variables, strict=True)
        if coefficient
    ]
    if affine.offset or not parts:
        parts.append(str(affine.offset))
    return " + ".join(parts).replace("+ -", "- ")


def ranges(loop: Loop) -> list[Range] | None:
    """Cut a list into arithmetic progressions; ``None`` if that takes too many."""
    rows = loop.rows
    result: list[Range] = []
    at = 0
    while at < len(rows):
        if len(result) == _SEGMENTS:
            return None
        step = rows[at + 1] - rows[at] if at + 1 < len(rows) else np.zeros_like(rows[at])
        expected = rows[at] + np.arange(len(rows) - at)[:, np.newaxis] * step
        same = (rows[at:] == expected).all(axis=1)
        n = int(np.argmin(same)) if not same.all() else len(same)
        result.append(Range(rows[at], step, n))
        at += n
    return result


def nest(loop: Loop) -> Nest | None:
    """Return the two nested ranges that give a list of pairs, or ``None``."""
    rows = loop.rows
    if loop.width != 2 or len(rows) < 3:
        return None
    n = int(rows.max()) + 1
    i, j = rows[:, 0], rows[:, 1]
    if len(rows) == n * (n - 1) // 2:
        high, low = np.triu_indices(n, 1), np.tril_indices(n, -1)
        if np.array_equal(i, high[0]) and np.array_equal(j, high[1]):
            return Nest(f"range({n - 1})", f"range(i + 1, {n})")
        if np.array_equal(i, low[0]) and np.array_equal(j, low[1]):
            return Nest(f"range(1, {n})", "range(i)")
    width = int(j.max()) + 1
    if len(rows) == (int(i.max()) + 1) * width and width > 1:
        grid = np.indices((len(rows) // width, width)).reshape(2, -1)
        if np.array_equal(i, grid[0]) and np.array_equal(j, grid[1]):
            return Nest(f"range({len(rows) // width})", f"range({width})")
    return None
