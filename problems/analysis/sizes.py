"""How large the terms of a quantity are: the scale that its errors are relative to.

A sum such as an energy may vanish while its terms do not: that of a pendulum that is released from the
horizontal, or of a parabolic orbit. What rounding makes of it is a part of the terms, not of the sum.
"""

from collections.abc import Sequence
from weakref import WeakKeyDictionary

from problems.derive.function import Function, renewed, stacked
from problems.graph.fold import Fold
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
        sizes = renewed(function, function.graph, _Sizes(STATE).of)
        _known[function] = stacked([function, sizes], function.name)
    return _known[function]


def size_in_time(node: Node) -> Node:
    """Return the sum of the absolute terms of a function of the time: of those that depend on it."""
    size = _Sizes(T).of(node)
    return node.graph.const(0.0) if size is None else size


class _Sizes(Fold[Node | None]):
    """The sums of absolute terms of nodes; ``None`` for those that have no terms.

    What is inside a term is none of its business: `arguments` are the nodes whose terms are those of a node.
    """

    def __init__(self, moving: int) -> None:
        super().__init__()
        self._moving = moving  # what terms depend on

    def arguments(self, node: Node) -> Sequence[Node]:
        match node.op:
            case "add" | "sub" | "neg" | "sum":
                return node.args
            case "mul" if len(moving := [arg for arg in node.args if arg.flags & self._moving]) == 1:
                return moving
            case "div" if not node.args[1].flags & self._moving:
                return node.args[:1]
            case "where":
                return node.args[1:]
        return ()

    def visit(self, node: Node, results: Sequence[Node | None]) -> Node | None:
        if not node.flags & self._moving:
            return None
        return super().visit(node, results) if results else abs(node)

    def visit_add(self, node: Node, *sizes: Node | None) -> Node | None:
        first, *others = (size for size in sizes if size is not None)
        return first + others[0] if others else first

    visit_sub = visit_add
    visit_neg = visit_add

    def visit_mul(self, node: Node, size: Node) -> Node:
        (factor,) = (arg for arg in node.args if not arg.flags & self._moving)
        return abs(factor) * size

    def visit_div(self, node: Node, size: Node) -> Node:
        return size / abs(node.args[1])

    def visit_sum(self, node: Node, size: Node) -> Node:
        return node.graph.sum(size, node.data)

    def visit_where(self, node: Node, *sizes: Node | None) -> Node:
        zero = node.graph.const(0.0)
        return node.graph.where(node.args[0], *(zero if size is None else size for size in sizes))
