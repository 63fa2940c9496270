"""On which sides of its switching surfaces a traced field is evaluated, and how far from them."""

from dataclasses import replace
from math import pi

from problems.analysis.structure import WITHOUT_END, has_kink
from problems.derive.function import Function, Term
from problems.graph.nodes import STATE, Node, reachable
from problems.graph.tables import Table

GOLDEN = (5.0**0.5 - 1.0) / 2.0  # multiples of it are far from equal sums


def sides(field: Function, most: int) -> Function | None:
    """Return a function whose first value changes where a condition, a sign or a piece of a table does.

    Parameters
    ----------
    field : Function
        Of a system; conditions in time alone do not count, see `problems.analysis.switches`.
    most : int
        Surfaces whose distances have an output of their own.

    Returns
    -------
    Function or None
        Its first output is the same everywhere between two switching surfaces. In a loop, sides that change
        in two terms at once and in opposite directions may cancel. Each of the others, ``most`` of them,
        changes its sign on one surface and is smooth beside it; on those of a loop, and on those that are
        left, one of them does that is of the size of the smallest. ``None`` where the field has no such
        surface.
    """
    conditions = [
        node
        for node in reachable(field.roots)
        if (has_kink(node) or node.op == "table") and node.args[0].flags & STATE
    ]
    if not conditions:
        return None
    terms = tuple(
        Term(_side(node) * (1.0 + GOLDEN * (i + 1) % 1.0), i)
        for i, node in enumerate(dict.fromkeys(conditions))
    )
    distances = list(dict.fromkeys(_distance(node) for node in conditions))
    if len(distances) > most:
        last = distances[most - 1 :]
        squares, counts = [_inverse_square(node) for node in last], [_above(node) for node in last]
        smallest = _smallest(sum(squares[1:], squares[0]))
        distances[most - 1 :] = [smallest * _parity(sum(counts[1:], counts[0]))]
    outputs = (terms, *((Term(node, 0),) for node in distances))
    return replace(field, outputs=outputs, loops=(), name="sides")


def _side(node: Node) -> Node:
    graph, x = node.graph, node.args[0]
    if node.op == "table":
        knots = node.data.knots
        side = graph.table(x, Table(knots, tuple((float(i),) for i in range(len(knots) - 1))))
    elif node.op in WITHOUT_END:
        side = node
    else:
        side = _above(x)
    return side if node.loop is None else graph.sum(side, node.loop)


def _distance(node: Node) -> Node:
    """Return what vanishes where the node switches, and changes its sign there."""
    graph, x = node.graph, node.args[0]
    if node.op == "table":
        ends = node.data.knots
        pieces = tuple((float(i),) for i in range(len(ends) - 1))
        low, high, piece = (
            graph.table(x, Table(ends, values))
            for values in (tuple((x,) for x in ends[:-1]), tuple((x,) for x in ends[1:]), pieces)
        )
        x = (x - low) * (high - x)
    elif node.op == "round":
        x, piece = 0.25 - (x - node) ** 2, node
    elif node.op == "floor":
        x, piece = (x - node) * (1.0 - (x - node)), node
    else:
        piece = _above(x)
        if node.loop is None:
            return x
    if node.loop is None:
        return x * _parity(piece)
    return _smallest(graph.sum(_inverse_square(x), node.loop)) * _parity(graph.sum(piece, node.loop))


def _parity(count: Node) -> Node:
    """Return 1 for an even number, and -1 for an odd one."""
    return count.graph.call("cos", pi * count)


def _above(x: Node) -> Node:
    return x.graph.where(x, x.graph.const(1.0), x.graph.const(0.0))


def _inverse_square(x: Node) -> Node:
    return 1.0 / (x * x)


def _smallest(inverse_squares: Node) -> Node:
    """Return a number that is at most as large as the smallest of those whose inverse squares are added."""
    return inverse_squares.graph.call("sqrt", 1.0 / inverse_squares)
