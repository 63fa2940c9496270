"""On which sides of its switching surfaces a traced field is evaluated, as one function."""

from dataclasses import replace

from problems.analysis.structure import has_kink
from problems.calculus.function import Function, Term
from problems.trace.graph import STATE, Node, Table, reachable

GOLDEN = (5.0**0.5 - 1.0) / 2.0  # multiples of it are far from equal sums


def sides(field: Function) -> Function | None:
    """Return a function whose value changes where a condition, a sign or a piece of a table does.

    Parameters
    ----------
    field : Function
        Of a system; conditions in time alone do not count, see `problems.analysis.switches`.

    Returns
    -------
    Function or None
        With one output, the same everywhere between two switching surfaces. In a loop, sides that change
        in two terms at once and in opposite directions may cancel. ``None`` where the field has no such
        surface.
    """
    found = [
        node
        for node in reachable(field.roots)
        if (has_kink(node) or node.op == "table") and node.args[0].flags & STATE
    ]
    if not found:
        return None
    terms = tuple(
        Term(_side(node) * (1.0 + GOLDEN * (i + 1) % 1.0), i) for i, node in enumerate(dict.fromkeys(found))
    )
    return replace(field, outputs=(terms,), loops=(), name="sides")


def _side(node: Node) -> Node:
    graph, x = node.graph, node.args[0]
    if node.op == "table":
        knots = node.data.knots
        side = graph.table(x, Table(knots, tuple((float(i),) for i in range(len(knots) - 1))))
    else:
        side = graph.where(x, graph.const(1.0), graph.const(0.0))
    return side if node.loop is None else graph.sum(side, node.loop)
