"""Columns of a sparse Jacobian whose differences one evaluation of the field gives.

Columns that have no row in common are moved together (A. R. Curtis, M. J. D. Powell, J. K. Reid, *On the
estimation of sparse Jacobian matrices*, J. Inst. Math. Appl. 13 (1974)). Of a dense matrix each column is a
group of its own.
"""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.int64]

STEP = 1.4901161193847656e-08  # sqrt(eps): where the errors of a difference balance
SMALL = 1e-5  # of the largest component: no difference is taken over less


@dataclass(frozen=True)
class Groups:
    """Groups of columns, as a solver's memory holds them.

    Attributes
    ----------
    numbers : dict of str to int
        Lengths of the tables.
    tables : dict of str to ndarray
        See `integrators.kernel.implicit.workspace.Workspace`.
    """

    numbers: dict[str, int]
    tables: dict[str, Any]

    @classmethod
    def none(cls) -> Self:
        """Return the groups of a Jacobian that is not taken by differences."""
        return cls._made(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))

    @classmethod
    def of(cls, rows: Integers, columns: Integers, size: int) -> Self:
        """Return the groups for entries at these places of a matrix of so many rows and columns."""
        return cls._made(groups(rows, columns, size), columns)

    @classmethod
    def _made(cls, group: Integers, columns: Integers) -> Self:
        count = int(group.max(initial=-1)) + 1
        order = np.argsort(group, kind="stable")
        place = np.empty_like(order)
        place[order] = np.arange(order.size)
        numbers = {
            "grouped": group.size,
            "group_count": count,
            "group_ends": count + 1,
            "column_ends": group.size + 1,
            "grouped_entries": columns.size,
        }
        tables = {
            "columns": order,
            "column_groups": group,
            "column_starts": np.searchsorted(group[order], np.arange(count + 1)),
            "column_entries": np.argsort(place[columns], kind="stable"),
            "entry_starts": np.searchsorted(np.sort(place[columns]), np.arange(group.size + 1)),
        }
        return cls(numbers, {name: table.astype(np.int64) for name, table in tables.items()})


def groups(rows: Integers, columns: Integers, size: int) -> Integers:
    """Return the number of the group of each column: the first that has none of its rows yet."""
    if rows.size == size * size:
        return np.arange(size)
    from scipy.sparse import csc_matrix

    pattern = csc_matrix((np.ones(rows.size, dtype=np.int8), (rows, columns)), shape=(size, size))
    together = (pattern.T.astype(np.int64) @ pattern).tocsr()
    found = np.full(size, -1, dtype=np.int64)
    for column in range(size):
        near = found[together.indices[together.indptr[column] : together.indptr[column + 1]]]
        taken = np.zeros(near.size + 1, dtype=bool)
        taken[near[(near >= 0) & (near <= near.size)]] = True
        found[column] = int(np.argmin(taken)) if not taken.all() else near.size + 1
    return found
