"""Which formulas are minus one another in all bits, however they are written: 1/x and -1/x, for example."""

from collections.abc import Hashable, Iterable

from problems.graph.fold import Fold
from problems.graph.nodes import Node

Signed = tuple[float, int]
"""A sign, and a number that all formulas with the same absolute value in all bits have."""


def opposite(pairs: Iterable[tuple[Node, Node]]) -> list[bool]:
    """Return of each pair of nodes whether the one is minus the other, by the exact rules of rounding.

    Sums and products may be in either order; of functions other than ``+ - * /``, odd powers and choices
    nothing is known but that equal arguments give equal values.
    """
    fold = _Signs()
    results = []
    for a, b in pairs:
        (sign, number), (other, same) = fold.of(a), fold.of(b)
        zero = fold.numbers.get(("const", 0.0))
        results.append(number == same and (sign == -other or number == zero))
    return results


class _Signs(Fold[Signed]):
    def __init__(self) -> None:
        super().__init__()
        self.numbers: dict[Hashable, int] = {}

    def _signed(self, sign: float, *key: Hashable) -> Signed:
        return sign, self.numbers.setdefault(key, len(self.numbers))

    def visit_const(self, node: Node) -> Signed:
        return self._signed(-1.0 if node.data < 0.0 else 1.0, "const", abs(node.data))

    def visit_neg(self, node: Node, a: Signed) -> Signed:
        return -a[0], a[1]

    def visit_mul(self, node: Node, a: Signed, b: Signed) -> Signed:
        return self._signed(a[0] * b[0], "mul", *sorted([a[1], b[1]]))

    def visit_div(self, node: Node, a: Signed, b: Signed) -> Signed:
        return self._signed(a[0] * b[0], "div", a[1], b[1])

    def visit_add(self, node: Node, a: Signed, b: Signed) -> Signed:
        (y, t), (x, s) = sorted([(a[1], a[0]), (b[1], b[0])], reverse=True)
        return self._signed(s, "add", x, y, s * t)

    def visit_sub(self, node: Node, a: Signed, b: Signed) -> Signed:
        return self.visit_add(node, a, (-b[0], b[1]))

    def visit_pow(self, node: Node, a: Signed) -> Signed:
        return self._signed(a[0] ** (node.data % 2), "pow", a[1], node.data)

    def visit_where(self, node: Node, condition: Signed, a: Signed, b: Signed) -> Signed:
        return self._signed(a[0], "where", condition, a[1], b[1], a[0] * b[0])

    def visit_operation(self, node: Node, *args: Signed) -> Signed:
        return self._signed(1.0, "node", node.id)
