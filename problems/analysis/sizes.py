"""How large the terms of a quantity are: the scale that its errors are relative to.

A sum such as an energy may vanish while its terms do not: that of a pendulum that is released from the
horizontal, or of a parabolic orbit. What rounding makes of it is a part of the terms, not of the sum.
"""

from collections.abc import Iterable
from weakref import WeakKeyDictionary

from problems.derive.function import Function, renewed, stacked
from problems.graph.nodes import STATE, Node, T

_known: WeakKeyDictionary[Function, Function] = WeakKeyDictionary()


def with_sizes(function: Function) -> Function:
    """Return a function with the outputs of another one, followed by the sum of absolute terms of each.

    The terms are those of the sum as it is written, after factors that do not depend on the state are
    multiplied in: of ``p**2/2 - par.g*m.cos(q)`` they are ``p**2/2`` and ``par.g*m.cos(q)``. A product of
    two things that depend on the state is one term, and so is a function of a sum. What does not depend
    on the state is none: a constant may be added to an energy at will.
    """
    if function not in _known:
        sized = _Sizes(function.roots, STATE).known
        sizes = renewed(function, function.graph, lambda node: sized[node.id])
        _known[function] = stacked([function, sizes], function.name)
    return _known[function]


def size_in_time(node: Node) -> Node:
    """Return the sum of the absolute terms of a function of the time: of those that depend on it."""
    size = _Sizes([node], T).known[node.id]
    return node.graph.const(0.0) if size is None else size


class _Sizes:
    """The sums of absolute terms of nodes; ``None`` for those that have no terms.

    No `problems.graph.fold.Fold`, which visits every node: what is inside a term is none of its business.
    """

    def __init__(self, roots: Iterable[Node], moving: int) -> None:
        self._moving = moving  # what terms depend on
        summands: dict[int, Node] = {}
        stack = list(roots)
        while stack:
            node = stack.pop()
            if node.id not in summands:
                summands[node.id] = node
                stack.extend(self._summands(node))
        self.known: dict[int, Node | None] = {}
        for number in sorted(summands):  # arguments come first
            self.known[number] = self._size(summands[number])

    def _size(self, node: Node) -> Node | None:
        if not node.flags & self._moving:
            return None
        inside = [self.known[summand.id] for summand in self._summands(node)]
        match node.op:
            case "add" | "sub":
                first, *others = (size for size in inside if size is not None)
                return first + others[0] if others else first
            case "neg":
                return inside[0]
            case "mul" if inside and inside[0] is not None:
                return self._factor(node) * inside[0]
            case "div" if inside and inside[0] is not None:
                return inside[0] / abs(node.args[1])
            case "sum" if inside[0] is not None:
                return node.graph.sum(inside[0], node.data)
            case "where" if inside:
                zero = node.graph.const(0.0)
                return node.graph.where(node.args[0], *(zero if size is None else size for size in inside))
        return abs(node)

    def _summands(self, node: Node) -> tuple[Node, ...]:
        """Return the parts of a node whose terms are its own."""
        match node.op:
            case "add" | "sub" | "neg" | "sum":
                return node.args
            case "mul" if len(moving := [arg for arg in node.args if arg.flags & self._moving]) == 1:
                return tuple(moving)
            case "div" if not node.args[1].flags & self._moving:
                return node.args[:1]
            case "where":
                return node.args[1:]
        return ()

    def _factor(self, node: Node) -> Node:
        """Return the absolute value of the factor that does not move."""
        (factor,) = (arg for arg in node.args if not arg.flags & self._moving)
        return abs(factor)
