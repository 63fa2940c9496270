"""Which formulas are minus one another in all bits, however they are written: 1/x and -1/x, for example."""

from collections.abc import Hashable, Iterable

from problems.graph.nodes import Node, reachable

Signed = tuple[float, int]
"""A sign, and a number that all formulas with the same absolute value in all bits have."""


def opposite(pairs: Iterable[tuple[Node, Node]]) -> list[bool]:
    """Return of each pair of nodes whether the one is minus the other, by the exact rules of rounding.

    Sums and products may be in either order; of functions other than ``+ - * /``, odd powers and choices
    nothing is known but that equal arguments give equal values.
    """
    pairs = list(pairs)
    known: dict[int, Signed] = {}
    numbers: dict[Hashable, int] = {}
    for node in reachable(node for pair in pairs for node in pair):
        args = [known[arg.id] for arg in node.args]
        if node.op == "neg":
            known[node.id] = -args[0][0], args[0][1]
        else:
            sign, key = _signed(node, args)
            known[node.id] = sign, numbers.setdefault(key, len(numbers))
    zero = numbers.get(("const", 0.0))
    results = []
    for a, b in pairs:
        (sign, number), (other, same) = known[a.id], known[b.id]
        results.append(number == same and (sign == -other or number == zero))
    return results


def _signed(node: Node, args: list[Signed]) -> tuple[float, Hashable]:
    match node.op:
        case "const":
            return (-1.0 if node.data < 0.0 else 1.0), ("const", abs(node.data))
        case "mul" | "div":
            (s, x), (t, y) = args
            return s * t, (node.op, *(sorted([x, y]) if node.op == "mul" else (x, y)))
        case "add" | "sub":
            (s, x), (t, y) = args
            (y, t), (x, s) = sorted([(x, s), (y, t if node.op == "add" else -t)], reverse=True)
            return s, ("add", x, y, s * t)
        case "pow":
            sign, x = args[0]
            return sign ** (node.data % 2), ("pow", x, node.data)
        case "where":
            condition, (s, x), (t, y) = args
            return s, ("where", condition, x, y, s * t)
    return 1.0, ("node", node.id)
