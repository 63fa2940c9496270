"""Piecewise polynomials that formulas look up."""

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Table:
    """A piecewise polynomial of one argument; beyond its ends the outer pieces go on.

    Attributes
    ----------
    knots : tuple of float
        Ascending, n >= 2.
    rows : tuple of tuple of float
        The pieces' coefficients in powers of ``x - knots[i]``, highest first: n - 1 pieces, or n, where
        another one begins at the last knot.
    extrapolate : bool
        Whether arguments beyond the ends are asked for, see `problems.analysis.tables`.
    """

    knots: tuple[float, ...]
    rows: tuple[tuple[float, ...], ...]
    extrapolate: bool = False

    def slope(self) -> "Table":
        """Return the derivative."""
        rows = tuple(
            tuple((len(row) - 1 - i) * c for i, c in enumerate(row[:-1])) or (0.0,) for row in self.rows
        )
        return Table(self.knots, rows, self.extrapolate)

    def at(self, x: Any) -> Any:
        """Return the value at a number or an array of any kind, of doubles or of more digits."""
        return interpolated(np, self.knots, self.rows, x)


def interpolated(library: Any, knots: Any, rows: Any, x: Any) -> Any:
    """Return the values of a `Table` at an array, by Horner's scheme.

    Parameters
    ----------
    library : module
        NumPy, or JAX's.
    knots, rows
        As in `Table`; also as arrays.
    x : array
        Of the library; also of numbers with more digits, which have the leading ones in ``hi``.
    """
    place = library.searchsorted(library.asarray(knots), getattr(x, "hi", x), side="right") - 1
    place = library.clip(place, 0, len(rows) - 1)
    rest = x - library.asarray(knots)[place]
    first, *others = library.asarray(rows).T
    value = first[place] + 0.0 * rest
    for coefficient in others:
        value = value * rest + coefficient[place]
    return value
