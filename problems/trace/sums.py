"""Declared sums: one small term, traced once, over a list of indices.

``m.sum(term, index)`` calls ``term`` once with symbolic integers; ``q[3*i + 1]``
inside it is a symbol at an affine index. The graph keeps one node for the sum,
so that a thousand neighbours are a loop and not a hundred thousand lines. The
terms are added one after the other, in the order of ``index``.
"""

import numbers
import sys
from collections.abc import Callable, Iterable, Sized
from itertools import islice
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from problems import limits
from problems.errors import shown
from problems.trace.graph import Affine, Graph, Loop, Node
from problems.trace.source_line import refuse, users_line


class Index:
    """A symbolic integer inside a term of a declared sum; see `Affine`."""

    __slots__ = ("affine", "graph", "loop")

    def __init__(self, graph: Graph, loop: Loop, affine: Affine) -> None:
        self.graph = graph
        self.loop = loop
        self.affine = affine

    def __repr__(self) -> str:
        return f"Index({self.affine})"

    def as_node(self) -> Node:
        """Return the index as a number of the graph."""
        return self.graph.index(self.affine, self.loop)

    def _combined(self, other: Any, mine: int, its: int) -> "Index | None":
        if isinstance(other, Index) and other.loop is self.loop:
            a, b = self.affine, other.affine
        elif isinstance(other, numbers.Integral) and not isinstance(other, bool):
            a, b = self.affine, Affine((0,) * self.loop.width, int(other))
        else:
            return None
        pairs = zip(a.coefficients, b.coefficients, strict=True)
        total = Affine(tuple(mine * x + its * y for x, y in pairs), mine * a.offset + its * b.offset)
        return Index(self.graph, self.loop, total)

    def __add__(self, other: Any) -> Any:
        combined = self._combined(other, 1, 1)
        return self.as_node() + other if combined is None else combined

    def __radd__(self, other: Any) -> Any:
        combined = self._combined(other, 1, 1)
        return other + self.as_node() if combined is None else combined

    def __sub__(self, other: Any) -> Any:
        combined = self._combined(other, 1, -1)
        return self.as_node() - other if combined is None else combined

    def __rsub__(self, other: Any) -> Any:
        combined = self._combined(other, -1, 1)
        return other - self.as_node() if combined is None else combined

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, numbers.Integral) and not isinstance(other, bool):
            return self._combined(0, int(other), 0)
        return self.as_node() * other

    def __rmul__(self, other: Any) -> Any:
        if isinstance(other, numbers.Integral) and not isinstance(other, bool):
            return self._combined(0, int(other), 0)
        return other * self.as_node()

    def __neg__(self) -> Any:
        return self._combined(0, -1, 0)

    def __truediv__(self, other: Any) -> Node:
        return self.as_node() / other

    def __rtruediv__(self, other: Any) -> Node:
        return other / self.as_node()

    def __pow__(self, other: Any) -> Node:
        return self.as_node() ** other

    def __hash__(self) -> int:
        return hash((self.loop.id, self.affine))

    def _refuse(self, *_: Any) -> NoReturn:
        refuse(
            "a term of m.sum does with its index more than q[a*i + b]",
            "put what varies into the index list, such as m.sum(term, [(i, (i + 1) % n) for i in range(n)])",
        )

    __bool__ = __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = _refuse  # type: ignore[assignment]
    __index__ = __int__ = __float__ = __round__ = _refuse
    __mod__ = __rmod__ = __floordiv__ = __rfloordiv__ = __divmod__ = _refuse


def _rows(index: Iterable[Any]) -> NDArray[np.int64]:
    if isinstance(index, Node | Index):
        refuse("the index list of m.sum depends on a symbol", "give a range or a list of integers")
    try:
        size = len(index) if isinstance(index, Sized) else 0
    except OverflowError:  # of a range that is longer than any list
        size = sys.maxsize
    limits.check(f"{users_line()}: this", "TERMS", size)
    try:
        listed = list(islice(index, int(min(limits.limit("TERMS"), sys.maxsize - 1)) + 1))
    except TypeError:
        refuse(f"the index of m.sum is {shown(index)}", "give a range or a list of integers")
    limits.check(f"{users_line()}: this", "TERMS", len(listed))
    if not listed:
        return np.zeros((0, 1), dtype=np.int64)
    try:
        rows = np.array([row if isinstance(row, tuple | list) else (row,) for row in listed])
    except (TypeError, ValueError):
        rows = np.array(None)
    if rows.ndim != 2 or not np.issubdtype(rows.dtype, np.integer):
        refuse(
            "the index of m.sum is not a list of integers or of equally long tuples of integers",
            "write m.sum(term, range(n)) or m.sum(term, [(i, j) for i in range(n) for j in range(i)])",
        )
    return rows.astype(np.int64)


def declare(graph: Graph, term: Callable[..., Any], index: Iterable[Any]) -> Node:
    """Return the node of ``sum of term(i[, j, ...])`` over ``index``.

    Parameters
    ----------
    graph : Graph
        The graph being traced.
    term : callable
        Called once, with one symbolic integer for each column of ``index``.
    index : iterable of int, or of tuples of int
        The indices, in the order in which the terms are added.

    Raises
    ------
    problems.errors.InputError
        If the index is not a list of integers, or a sum stands inside a sum.
    """
    if not callable(term):
        refuse(
            "the first argument of m.sum is not a function",
            "write m.sum(lambda i: q[i]**2, range(n)), or Python's sum() for a short list",
        )
    if graph.in_term:
        refuse("a sum stands inside the term of a sum", "use one m.sum over a list of tuples")
    rows = _rows(index)
    if len(rows) == 0:
        return graph.const(0.0)
    loop = graph.loop(rows)
    unit = np.eye(loop.width, dtype=int)
    indices = [Index(graph, loop, Affine(tuple(int(c) for c in row), 0)) for row in unit]
    graph.in_term = True
    try:
        body = graph.node(term(*indices))
    finally:
        graph.in_term = False
    if body.loop is None:  # the term does not depend on the index
        return graph.const(float(len(rows))) * body
    return graph.sum(body, loop)
