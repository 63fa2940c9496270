"""Adjoints of reverse-mode differentiation, divided out as late and as seldom as possible."""

from dataclasses import dataclass
from fractions import Fraction

from problems.trace.graph import Graph, Node, is_power_of_two

ONE = Fraction(1)
_SMALL = 2**20  # 2/3 is written 2*x/3; a quotient of long decimals is rounded once instead


@dataclass(frozen=True, eq=False)
class Adjoint:
    """``factor * num / den`` (``None`` is 1); ``key`` is the node it comes from."""

    factor: Fraction
    num: Node | None
    den: Node | None
    key: int

    def times(self, node: Node, key: int, *, factor: Fraction = ONE) -> "Adjoint":
        """Multiply; constants and powers of two go into the exact factor."""
        factor = factor * self.factor
        if node.op == "const":
            return Adjoint(factor * Fraction(node.data), self.num, self.den, key)
        if node.op == "neg":
            factor, node = -factor, node.args[0]
        if node.op == "mul" and node.args[0].op == "const" and is_power_of_two(node.args[0].data):
            factor, node = factor * Fraction(node.args[0].data), node.args[1]
        return Adjoint(factor, node if self.num is None else self.num * node, self.den, key)

    def over(self, node: Node, key: int, *, factor: Fraction = ONE) -> "Adjoint":
        """Divide; constants and powers of two go into the exact factor."""
        factor = factor * self.factor
        if node.op == "const":
            return Adjoint(factor / Fraction(node.data), self.num, self.den, key)
        if node.op == "mul" and node.args[0].op == "const" and is_power_of_two(node.args[0].data):
            factor, node = factor / Fraction(node.args[0].data), node.args[1]
        return Adjoint(factor, self.num, node if self.den is None else self.den * node, key)

    def scaled(self, factor: Fraction, key: int) -> "Adjoint":
        return Adjoint(self.factor * factor, self.num, self.den, key)

    def divided(self, graph: Graph) -> "Adjoint":
        """Carry out the division, once, before the adjoint is used several times."""
        if self.den is None:
            return self
        num = graph.const(1.0) if self.num is None else self.num
        return Adjoint(self.factor, num / self.den, None, self.key)

    def node(self, graph: Graph) -> Node:
        """Return the value as one node."""
        size = abs(self.factor)
        num, den = self.num, self.den
        up, down = float(size), 1.0
        if Fraction(up) != size and max(size.numerator, size.denominator) < _SMALL:
            up, down = float(size.numerator), float(size.denominator)
        value = graph.const(up) if num is None else graph.mul(graph.const(up), num)
        if down != 1.0:
            den = graph.const(down) if den is None else graph.mul(graph.const(down), den)
        if den is not None:
            value = value / den
        return -value if self.factor < 0 else value


def merged(parts: list[Adjoint]) -> list[Adjoint]:
    """Join contributions that differ in their factor only: x + x is 2 x, exactly."""
    kept: dict[tuple[int, int], Adjoint] = {}
    for part in parts:
        name = (-1 if part.num is None else part.num.id, -1 if part.den is None else part.den.id)
        other = kept.get(name)
        if other is None:
            kept[name] = part
        else:
            kept[name] = Adjoint(other.factor + part.factor, part.num, part.den, other.key)
    return [part for part in kept.values() if part.factor != 0]


def added(parts: list[Adjoint], graph: Graph) -> Adjoint | None:
    """Add contributions in order; a common factor and a common denominator stay outside."""
    parts = merged(parts)
    if len(parts) <= 1:
        return parts[0] if parts else None
    size = abs(parts[0].factor)
    common = size if all(abs(part.factor) == size for part in parts) else ONE
    den = parts[0].den
    if any(part.den is not den for part in parts):
        den = None
    else:
        parts = [Adjoint(part.factor, part.num, None, part.key) for part in parts]
    total = parts[0].scaled(1 / common, 0).node(graph)
    for part in parts[1:]:
        total = total + part.scaled(1 / common, 0).node(graph)
    return Adjoint(common, total, den, parts[0].key)
