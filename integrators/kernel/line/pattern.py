"""What is not identically 0 in the gradients of several invariants, and in the equations made of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.protocol import Array
from problems.derive.elimination import least_fill
from problems.derive.jacobian import Jacobian
from problems.problem import System


@dataclass(frozen=True, eq=False)
class Pattern:
    """Where the entries of the gradients are.

    Attributes
    ----------
    dim : int
        Length of the state.
    columns : list of list of int
        Of each invariant the components that its gradient has entries for.
    tables : dict of str to ndarray of int
        The arrays of a `LineContext` that say so.
    """

    dim: int
    columns: list[list[int]]
    tables: dict[str, NDArray[np.int64]]

    @classmethod
    def of(cls, system: System, slopes: Sequence[Jacobian]) -> "Pattern":
        """Return the pattern of the gradients of invariants, one after another."""
        columns = [part.columns[part.rows == a].tolist() for part in slopes for a in range(part.shape[0])]
        return cls(system.dim, columns, _tables(system, columns))

    @property
    def count(self) -> int:
        """Number of entries."""
        return sum(map(len, self.columns))

    def gradients(self, entries: Array) -> Array:
        """Return gradients, shape (n, dim), from their entries."""
        whole = np.zeros((len(self.columns), self.dim))
        owners = np.repeat(np.arange(len(self.columns)), [len(part) for part in self.columns])
        whole[owners, self.tables["column"]] = entries
        return whole


def _tables(system: System, columns: Sequence[Sequence[int]]) -> dict[str, NDArray[np.int64]]:
    dim, n = system.dim, len(columns)
    order, ends = order_of_sums(system)
    place = np.empty(dim, dtype=np.int64)
    place[order] = np.arange(dim)
    part = np.concatenate([[0], np.cumsum(ends)[:-1]])[place] if dim else place
    first = np.concatenate([[0], np.cumsum([len(own) for own in columns])])
    row = [{d: dim + int(first[a]) + i for i, d in enumerate(own)} for a, own in enumerate(columns)]
    by_column = [[(row[a][d], a) for a in range(n) if d in row[a]] for d in range(dim)]
    touching: list[set[int]] = [set() for _ in range(n)]
    for entries in by_column:
        for _, a in entries:
            touching[a].update(b for _, b in entries)
    pairs = [(a, b) for a in range(n) for b in sorted(touching[a] | {a}) if b <= a]
    number = {pair: i for i, pair in enumerate(pairs)}
    rows_a, rows_b, last, begins = [], [], [], [0]
    for a, b in pairs:
        shared = sorted((d for d in row[a] if d in row[b]), key=place.__getitem__)
        rows_a += [row[a][d] for d in shared]
        rows_b += [row[b][d] for d in shared]
        parts = [part[d] for d in shared]
        last += [i + 1 == len(parts) or parts[i + 1] != parts[i] for i in range(len(parts))]
        begins.append(len(rows_a))
    turn = least_fill(touching) if system.on_manifold else list(range(n))
    lower = _fill(touching, turn) if system.on_manifold else [list(range(i)) for i in range(n)]
    lists: dict[str, Any] = {
        "column": [d for own in columns for d in own],
        "column_first": np.concatenate([[0], np.cumsum([len(entries) for entries in by_column])]),
        "column_row": [r for entries in by_column for r, _ in entries],
        "column_owner": [a for entries in by_column for _, a in entries],
        "pair_first": begins,
        "diagonal": [number[a, a] for a in range(n)],
        "row_a": rows_a,
        "row_b": rows_b,
        "ends": last,
        "turn": turn,
        "lower_first": np.concatenate([[0], np.cumsum([len(part) for part in lower])]),
        "lower_column": [j for part in lower for j in part],
        "lower_pair": [
            number.get((max(turn[i], turn[j]), min(turn[i], turn[j])), -1)
            for i, part in enumerate(lower)
            for j in part
        ],
    }
    return {name: np.array(values, dtype=np.int64) for name, values in lists.items()}


def _fill(touching: Sequence[set[int]], turn: Sequence[int]) -> list[list[int]]:
    """Return the columns of each row of the factor L, in the order of elimination."""
    place = {a: i for i, a in enumerate(turn)}
    rows: list[set[int]] = [set() for _ in turn]  # columns after the row, as it is eliminated
    for i, a in enumerate(turn):
        rows[i] |= {place[b] for b in touching[a] if place[b] > i}
        if rows[i]:
            rows[min(rows[i])] |= rows[i] - {min(rows[i])}
    return [[j for j in range(i) if i in rows[j]] for i in range(len(turn))]


def order_of_sums(system: System) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the order in which components are summed up, and where its partial sums end.

    The same coordinate of all bodies, body by body, makes a partial sum: in an
    odd sum over two bodies that mirror each other it is exactly 0. Without bodies,
    positions and momenta make one each.
    """
    indices = np.arange(system.dim)
    if system.bodies is not None and system.dof is not None:
        groups = list(
            indices.reshape(2, -1, system.bodies.dimension)
            .transpose(0, 2, 1)
            .reshape(2 * system.bodies.dimension, -1)
        )
    else:
        groups = np.array_split(indices, 1 if system.dof is None else 2)
    ends = [np.arange(group.size) == group.size - 1 for group in groups]
    return np.concatenate(groups).astype(np.int64), np.concatenate(ends).astype(np.int64)
