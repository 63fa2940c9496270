"""Sparse Jacobians of traced vector fields.

Every summand of a field is a traced scalar, so `problems.derive.gradient.gradient`
gives its row of the Jacobian, and with it which entries are not zero. Where
summands stand in a loop, the loop's terms are differentiated once: the summand
of term k at output a(k) has derivatives with respect to y[b(k)], which stand at
the places (a(k), b(k)) for all k. The Jacobian stays a loop over the same list,
with the places of its entries as further columns of the list. Where the term reads an
array that loops have filled, the loop is over all that meets there: a product of two
sparse matrices, term by term.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from problems.derive.function import Function, LoopTerm, Term
from problems.derive.gradient import gradient
from problems.graph.fold import Copy
from problems.graph.loops import Affine, Loop, Stage
from problems.graph.nodes import STATE, Graph, Node, Q, reachable

Integers = NDArray[np.int64]

LARGEST = 2_000_000  # integers in one loop's list; beyond, source text is the wrong place for a list
_CAPTURED = 1 << 40  # places beyond any state stand for values that a loop's term takes from outside


@dataclass(frozen=True, eq=False)
class Jacobian:
    """The derivatives of a field with respect to the state, entry by entry.

    Its values come from the emitters, in the order of ``rows`` and ``columns``:
    ``targets.numpy(system, system.jacobian())(t, y, par)``; ``targets.numba`` likewise.

    Attributes
    ----------
    function : Function
        One output per entry, for the emitters.
    rows, columns : ndarray of int64, shape (n,)
        Places of the entries, row by row and sorted in each row; all others are zero.
    shape : tuple of int
        Numbers of rows and columns.
    """

    function: Function
    rows: Integers
    columns: Integers
    shape: tuple[int, int]

    @property
    def density(self) -> float:
        """Part of the matrix that is stored."""
        return self.rows.size / (self.shape[0] * self.shape[1])


def jacobian(function: Function, name: str, columns: int | None = None) -> Jacobian | None:
    """Return the derivatives of a function with respect to components of the state.

    Parameters
    ----------
    function : Function
        A field, or the force of a separable system, which depends on the positions alone.
    name : str
        What generated code and messages call it.
    columns : int, optional
        How many components, by default as many as there are outputs.

    Returns
    -------
    Jacobian or None
        ``None`` where the list of entries would be larger than `LARGEST`.
    """
    shape = len(function.outputs), len(function.outputs) if columns is None else columns
    entries = _Entries(function.graph, shape[1])
    for loop, terms in function.loops:
        for term in terms:
            entries.of_loop_term(loop, term.index, term.node)
    for row, terms in enumerate(function.outputs):
        for term in terms:
            entries.of_term(row, term.node)
    return entries.collected(name, shape)


class _Entries:
    def __init__(self, graph: Graph, size: int) -> None:
        self.graph = graph
        self.size = size
        self.plain: dict[tuple[int, int], list[Node]] = {}
        # Derivatives in a loop: that at [row, column] stands there for each term.
        self.loops: dict[Loop, dict[tuple[Affine, Affine], Node]] = {}
        self.too_large = False
        self._stages: dict[Stage, _Entries] = {}

    def of_term(self, row: int, node: Node) -> None:
        """Enter the derivatives of a summand of one output."""
        slopes = gradient(node, self.size)
        for column, terms in enumerate(slopes.outputs):
            if terms:
                self.plain.setdefault((row, column), []).extend(term.node for term in terms)
        for loop, terms in slopes.loops:
            for term in terms:
                self._enter(loop, _constant(loop, row), term.index, term.node)

    def of_loop_term(self, loop: Loop, row: Affine, node: Node) -> None:
        """Enter the derivatives of a summand that stands in a loop."""
        outside: dict[int, Node] = {}

        def captured(inner: Node) -> Node:
            if not inner.flags & STATE or (inner.loop is not None and inner.op != "element"):
                return inner
            outside[inner.id] = inner
            # As a symbol of the loop it keeps a derivative of its own in every term.
            return self.graph.symbol("captured", _constant(loop, _CAPTURED + inner.id), flags=Q, loop=loop)

        def brought_back(inner: Node) -> Node:
            stand_in = inner.op == "symbol" and inner.data[0] == "captured"
            return outside[inner.data[1].offset - _CAPTURED] if stand_in else inner

        isolated = _copied(self.graph, node, loop, captured) if node.loop is loop else captured(node)
        if not isolated.flags & STATE:
            return
        for found_loop, terms in gradient(self.graph.sum(isolated, loop), self.size).loops:
            assert found_loop is loop
            for term in terms:
                slope = _copied(self.graph, term.node, loop, brought_back)
                if term.index.offset < _CAPTURED:
                    self._enter(loop, row, term.index, slope)
                else:
                    self._chain(loop, row, slope, outside[term.index.offset - _CAPTURED])

    def _chain(self, loop: Loop, row: Affine, slope: Node, inner: Node) -> None:
        """Enter ``slope`` times the derivatives of ``inner``, which stands outside the loop."""
        if inner.op == "element" and inner.loop is loop:
            self._through(loop, row, slope, *inner.data)
            return
        if inner.op == "symbol":
            self._enter(loop, row, _constant(loop, inner.data[1]), slope)
            return
        slopes = gradient(inner, self.size)
        for column, terms in enumerate(slopes.outputs):
            for term in terms:
                self._enter(loop, row, _constant(loop, column), slope * term.node)
        for other, terms in slopes.loops:
            self._product(loop, row, slope, other, terms)

    def _through(self, loop: Loop, row: Affine, slope: Node, stage: Stage, place: Affine) -> None:
        """Enter ``slope`` times the derivatives of a stage's values: a loop over what meets at each value."""
        if stage not in self._stages:
            self._stages[stage] = _Entries(self.graph, self.size)
            for other, terms in stage.loops:
                for at, node in terms:
                    self._stages[stage].of_loop_term(other, at, node)
            for at, node in stage.terms:
                self._stages[stage].of_term(at, node)
        inner, read = self._stages[stage], place.values(loop)
        self.too_large |= inner.too_large
        for (at, column), nodes in inner.plain.items():
            rows = loop.rows[read == at]
            if len(rows) == 0:  # nothing reads it
                continue
            some = self.graph.loop(rows)
            for node in nodes:
                product = _moved(self.graph, slope, loop, some, 0) * node
                self._enter(some, row, _constant(some, column), product)
        for other, entries in inner.loops.items():
            for (at, column), node in entries.items():
                first, second = meeting(read, at.values(other))
                if first.size == 0:  # nothing reads what these terms fill
                    continue
                both = _child(other, loop, first, second)
                shift = 0 if both is other else loop.width
                if both is None:
                    if first.size * (loop.width + other.width) > LARGEST:
                        self.too_large = True
                        return
                    both = self.graph.loop(np.hstack([loop.rows[first], other.rows[second]]))
                left = _moved(self.graph, slope, loop, both, 0)
                right = node if both is other else _moved(self.graph, node, other, both, shift)
                self._enter(both, row.widened(both.width), column.widened(both.width, shift), left * right)

    def _product(self, loop: Loop, row: Affine, slope: Node, other: Loop, terms: Sequence[LoopTerm]) -> None:
        """Enter products of a term of each of two loops: a loop over all pairs of terms."""
        n, m = len(loop), len(other)
        if n * m * (loop.width + other.width) > LARGEST:
            self.too_large = True
            return
        pairs = np.hstack([np.repeat(loop.rows, m, axis=0), np.tile(other.rows, (n, 1))])
        both = self.graph.loop(pairs)
        left = _moved(self.graph, slope, loop, both, 0)
        for term in terms:
            right = _moved(self.graph, term.node, other, both, loop.width)
            column = term.index.widened(both.width, loop.width)
            self._enter(both, row.widened(both.width), column, left * right)

    def _enter(self, loop: Loop, row: Affine, column: Affine, node: Node) -> None:
        nodes = self.loops.setdefault(loop, {})
        before = nodes.get((row, column))
        nodes[row, column] = node if before is None else before + node

    def collected(self, name: str, shape: tuple[int, int]) -> Jacobian | None:
        """Return the Jacobian; its entries in order, the loops' lists with their places."""
        lengths = [len(loop) * (loop.width + len(nodes)) for loop, nodes in self.loops.items()]
        if self.too_large or max(lengths, default=0) > LARGEST:
            return None
        size = self.size
        inside = {
            loop: [row.values(loop) * size + column.values(loop) for row, column in nodes]
            for loop, nodes in self.loops.items()
        }
        plain = np.array([row * size + column for row, column in self.plain], dtype=np.int64)
        places = np.unique(np.concatenate([plain, *(flat for each in inside.values() for flat in each)]))
        if places.size == 0:
            places = np.zeros(1, dtype=np.int64)  # a constant field: one entry, which is 0
        outputs: list[tuple[Term, ...]] = [()] * places.size
        for place, nodes in zip(np.searchsorted(places, plain), self.plain.values(), strict=True):
            outputs[place] = tuple(Term(node, node.id) for node in nodes)
        loops: list[tuple[Loop, tuple[LoopTerm, ...]]] = []
        for loop, nodes in self.loops.items():
            columns = np.stack([np.searchsorted(places, flat) for flat in inside[loop]], axis=1)
            longer = self.graph.loop(np.hstack([loop.rows, columns]))
            terms: list[LoopTerm] = []
            for i, node in enumerate(nodes.values(), start=loop.width):
                place = tuple(int(j == i) for j in range(longer.width))
                terms.append(LoopTerm(Affine(place, 0), _moved(self.graph, node, loop, longer, 0)))
            loops.append((longer, tuple(terms)))
        function = Function(self.graph, tuple(outputs), tuple(loops), name)
        return Jacobian(function, places // size, places % size, shape)


def _constant(loop: Loop, place: int) -> Affine:
    return Affine((0,) * loop.width, place)


def meeting(read: Integers, filled: Integers) -> tuple[Integers, Integers]:
    """Return the pairs (i, j) with ``read[i] == filled[j]``."""
    order = np.argsort(filled, kind="stable")
    low, high = (np.searchsorted(filled[order], read, side=side) for side in ("left", "right"))
    first = np.repeat(np.arange(read.size), high - low)
    within = np.arange(first.size) - np.repeat(np.cumsum(high - low) - (high - low), high - low)
    return first, order[np.repeat(low, high - low) + within]


def _child(other: Loop, loop: Loop, first: Integers, second: Integers) -> Loop | None:
    """Return the other loop if it is inside of ``loop``, and each of its terms meets the one around it."""
    alike = second.size == len(other) and other.width >= loop.width
    inside = alike and np.array_equal(second, np.arange(second.size))
    return other if inside and np.array_equal(other.rows[:, : loop.width], loop.rows[first]) else None


class _Replaced(Copy):
    """A node of a loop whose symbols, and what comes from outside, are replaced by ``leaf``."""

    def __init__(self, graph: Graph, loop: Loop, leaf: Callable[[Node], Node]):
        super().__init__(graph)
        self._loop, self._leaf = loop, leaf

    def of(self, root: Node) -> Node:
        for node in reachable([root], self._loop):
            results = [self._of_argument(arg) for arg in node.reads]
            self.known[node.id] = self.visit(node, results)
        return self._of_argument(root)

    def _of_argument(self, node: Node) -> Node:
        return self.known[node.id] if node.id in self.known else self._leaf(node)

    def visit_symbol(self, node: Node) -> Node:
        return self._leaf(node)

    visit_index = visit_entry = visit_symbol

    def visit_element(self, node: Node, *_: Node) -> Node:
        return self._leaf(node)


def _copied(graph: Graph, root: Node, loop: Loop, leaf: Callable[[Node], Node]) -> Node:
    """Return ``root`` with ``leaf`` applied to the loop's symbols and to what comes from outside."""
    return _Replaced(graph, loop, leaf).of(root)


def _moved(graph: Graph, root: Node, loop: Loop, to: Loop, at: int) -> Node:
    """Return a node of ``loop`` in a loop whose list has the columns of ``loop`` from ``at`` on."""

    def leaf(node: Node) -> Node:
        return node if node.loop is None else graph.widened(node, to, at)

    return _copied(graph, root, loop, leaf)
