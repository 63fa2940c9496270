"""Declared sums: one small term, traced once, over a list of indices.

``m.sum(term, index)`` calls ``term`` once with symbolic integers; ``q[3*i + 1]``
inside it is a symbol at an affine index. The graph keeps one node for the sum,
so that a thousand neighbours are a loop and not a hundred thousand lines. The
terms are added one after the other, in the order of ``index``.

A sum inside the term of another loop is a loop over all pairs of terms, which fills an array with one
number for each term of the outer loop (`problems.graph.loops.Stage`).
"""

import numbers
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from contextlib import contextmanager
from itertools import islice
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from problems import limits
from problems.errors import shown
from problems.graph.loops import Affine, Loop
from problems.graph.nodes import Graph, Node
from problems.graph.source_line import refuse, users_line


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

    def within(self, loop: Loop) -> "Index":
        """Return the same index as one of a loop inside its own."""
        return Index(self.graph, loop, self.affine.widened(loop.width)) if loop is not self.loop else self

    def _combined(self, other: Any, mine: int, its: int) -> "Index | None":
        index = self
        if isinstance(other, Index):
            scopes = self.graph.scopes
            if other.loop is not self.loop and not (self.loop in scopes and other.loop in scopes):
                return None
            loop = self.loop if other.loop is self.loop else max(self.loop, other.loop, key=scopes.index)
            index, b = self.within(loop), other.within(loop).affine
        elif isinstance(other, numbers.Integral) and not isinstance(other, bool):
            b = Affine((0,) * self.loop.width, int(other))
        else:
            return None
        a = index.affine
        pairs = zip(a.coefficients, b.coefficients, strict=True)
        total = Affine(tuple(mine * x + its * y for x, y in pairs), mine * a.offset + its * b.offset)
        return Index(self.graph, index.loop, total)

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


def rows_of(index: Iterable[Any], name: str) -> NDArray[np.int64]:
    """Return an index list as rows, shape (n, width)."""
    if isinstance(index, Ragged):
        refuse(f"{name} runs over a list that differs from term to term", "use it inside its own term only")
    if isinstance(index, np.ndarray) and index.ndim in (1, 2) and np.issubdtype(index.dtype, np.integer):
        limits.check(f"{users_line()}: this", "TERMS", len(index))
        return np.ascontiguousarray(index.reshape(len(index), -1), dtype=np.int64)
    if isinstance(index, Node | Index):
        refuse(f"the index list of {name} depends on a symbol", "give a range or a list of integers")
    try:
        size = len(index) if isinstance(index, Sized) else 0
    except OverflowError:  # of a range that is longer than any list
        size = sys.maxsize
    limits.check(f"{users_line()}: this", "TERMS", size)
    try:
        listed = list(islice(index, int(min(limits.limit("TERMS"), sys.maxsize - 1)) + 1))
    except TypeError:
        refuse(f"the index of {name} is {shown(index)}", "give a range or a list of integers")
    limits.check(f"{users_line()}: this", "TERMS", len(listed))
    if not listed:
        return np.zeros((0, 1), dtype=np.int64)
    try:
        rows = np.array([row if isinstance(row, tuple | list) else (row,) for row in listed])
    except (TypeError, ValueError):
        rows = np.array(None)
    if rows.ndim != 2 or not np.issubdtype(rows.dtype, np.integer):
        refuse(
            f"the index of {name} is not a list of integers or of equally long tuples of integers",
            f"write {name}(term, range(n)) or {name}(term, [(i, j) for i in range(n) for j in range(i)])",
        )
    return rows.astype(np.int64)


def listed(graph: Graph, rows: NDArray[np.int64], columns: range | None = None) -> list[Index]:
    """Return the indices of a loop over rows, those of some columns only."""
    loop = graph.loop(rows)
    unit = np.eye(loop.width, dtype=int)
    return [
        Index(graph, loop, Affine(tuple(int(c) for c in unit[column]), 0))
        for column in columns or range(loop.width)
    ]


def declare(graph: Graph, term: Callable[..., Any], index: Iterable[Any]) -> Node:
    """Return the node of ``sum of term(i[, j, ...])`` over ``index``.

    Parameters
    ----------
    graph : Graph
        The graph being traced.
    term : callable
        Called once, with one symbolic integer for each column of ``index``.
    index : iterable of int, or of tuples of int
        The indices, in the order in which the terms are added; inside the term of another loop also a list
        that this one gives.

    Raises
    ------
    problems.errors.InputError
        If the index is not a list of integers.
    """
    if not callable(term):
        refuse(
            "the first argument of m.sum is not a function",
            "write m.sum(lambda i: q[i]**2, range(n)), or Python's sum() for a short list",
        )
    if graph.scopes:
        return _inside(graph, term, index)
    rows = rows_of(index, "m.sum")
    if len(rows) == 0:
        return graph.const(0.0)
    loop, value = traced(graph, rows, range(rows.shape[1]), term)
    body = graph.node(value)
    if body.loop is None:  # the term does not depend on the index
        return graph.const(float(len(rows))) * body
    return graph.sum(body, loop)


class _UnnumberedError(Exception):
    """The terms of a loop have to be numbered."""


def traced(
    graph: Graph, rows: NDArray[np.int64], columns: range, term: Callable[..., Any]
) -> tuple[Loop, Any]:
    """Return the loop over rows, and what a term returns for symbolic integers, those of some columns.

    Where a sum inside of the term needs the number of the term, it is one more column.
    """
    indices = listed(graph, rows, columns)
    try:
        with scope(graph, indices[0].loop):
            return indices[0].loop, term(*indices)
    except _UnnumberedError:
        indices = listed(graph, np.hstack([rows, np.arange(len(rows))[:, np.newaxis]]), columns)
    with scope(graph, indices[0].loop):
        return indices[0].loop, term(*indices)


@contextmanager
def scope(graph: Graph, loop: Loop) -> Iterator[None]:
    """Let the indices of a loop be used."""
    graph.scopes.append(loop)
    try:
        yield
    finally:
        graph.scopes.pop()


class Ragged:
    """A list of indices for each term of a loop: what `m.sum` runs over inside of it."""

    def __init__(self, loop: Loop, lists: Sequence[NDArray[np.int64]]):
        self.loop, self.lists = loop, lists

    def __len__(self) -> NoReturn:
        refuse("the length of a list that differs from term to term is asked for", "count with m.sum")

    def __iter__(self) -> NoReturn:
        refuse(
            "this runs over a list that differs from term to term",
            "use m.sum, as in m.sum(lambda j: y[j], neighbours)",
        )


def _inside(graph: Graph, term: Callable[..., Any], index: Any) -> Node:
    """Return the sum over a list, for each term of the loop that is being traced."""
    outer = graph.scopes[-1]
    if isinstance(index, Ragged):
        if index.loop not in graph.scopes:
            refuse("this list belongs to another loop", "use it inside its own term only")
        of_term = _rows_of_terms(index.loop, outer, graph)
        lists = [index.lists[k] for k in of_term]
        lengths = np.array([len(each) for each in lists])
        inner = np.concatenate(lists) if lists else np.zeros((0, 1), dtype=np.int64)
    else:
        each = rows_of(index, "m.sum")
        lengths = np.full(len(outer), len(each))
        limits.check(f"{users_line()}: this", "TERMS", len(outer) * len(each))
        inner = np.tile(each, (len(outer), 1))
    limits.check(f"{users_line()}: this", "TERMS", len(inner))
    if len(inner) == 0:
        return graph.const(0.0)
    if outer.count is None:
        raise _UnnumberedError
    rows = np.hstack([np.repeat(outer.rows, lengths, axis=0), inner])
    loop, value = traced(graph, rows, range(outer.width, rows.shape[1]), term)
    body = graph.lifted_to(graph.node(value), loop)
    stage = graph.stage(len(outer), ((loop, ((outer.count.widened(loop.width), body),)),))
    return graph.element(stage, outer.count, outer)


def _rows_of_terms(loop: Loop, inner: Loop, graph: Graph) -> NDArray[np.int64]:
    """Return for each term of a loop that of the one around it in which it is."""
    if loop.count is None:
        refuse("this list's loop is not numbered", "begin its tuples with the running number")
    return loop.count.widened(inner.width).values(inner)
