r"""Reverse-mode differentiation of a traced scalar, through declared sums.

One sweep from the scalar back to the state. An adjoint is carried as an exact
rational factor, a numerator and a denominator, and is divided out only where it
fans out, so that quotients of roots need one division. With ``V = -k/sqrt(r2)``,

    dV/dr2 = k/(2 r2 sqrt(r2)),     dV/dx = (k/(r2 sqrt(r2))) x   for  r2 = x*x + ...

(the 2 of the square and the 1/2 of the root cancel before anything is rounded):
per pair of bodies one root, one division and about twenty other operations.

The contributions to an adjoint are added in the order in which the user's
expression uses the variable, the terms of declared sums first. This order is
the same whether a sum is emitted as a loop or term by term.
"""

from dataclasses import dataclass
from fractions import Fraction

from problems.derive.function import Function, LoopTerm, Term
from problems.graph.fold import Visitor
from problems.graph.functions import FUNCTIONS, Slope
from problems.graph.loops import Affine, Loop, Place, Stage
from problems.graph.nodes import STATE, Graph, Node, is_power_of_two, reachable

_ONE = Fraction(1)
_SMALL = 2**20  # 2/3 is written 2*x/3; a quotient of long decimals is rounded once instead


@dataclass(frozen=True, eq=False)
class _Adjoint:
    """``factor * num / den`` (``None`` is 1); ``key`` is the node it comes from."""

    factor: Fraction
    num: Node | None
    den: Node | None
    key: int

    def times(self, node: Node, key: int, *, factor: Fraction = _ONE) -> "_Adjoint":
        """Multiply; constants and powers of two go into the exact factor."""
        factor = factor * self.factor
        if node.op == "const":
            return _Adjoint(factor * Fraction(node.data), self.num, self.den, key)
        if node.op == "neg":
            factor, node = -factor, node.args[0]
        if node.op == "mul" and node.args[0].op == "const" and is_power_of_two(node.args[0].data):
            factor, node = factor * Fraction(node.args[0].data), node.args[1]
        return _Adjoint(factor, node if self.num is None else self.num * node, self.den, key)

    def over(self, node: Node, key: int, *, factor: Fraction = _ONE) -> "_Adjoint":
        """Divide; constants and powers of two go into the exact factor."""
        factor = factor * self.factor
        if node.op == "const":
            return _Adjoint(factor / Fraction(node.data), self.num, self.den, key)
        if node.op == "mul" and node.args[0].op == "const" and is_power_of_two(node.args[0].data):
            factor, node = factor / Fraction(node.args[0].data), node.args[1]
        return _Adjoint(factor, self.num, node if self.den is None else self.den * node, key)

    def scaled(self, factor: Fraction, key: int) -> "_Adjoint":
        return _Adjoint(self.factor * factor, self.num, self.den, key)

    def divided(self, graph: Graph) -> "_Adjoint":
        """Carry out the division, once, before the adjoint is used several times."""
        if self.den is None:
            return self
        num = graph.const(1.0) if self.num is None else self.num
        return _Adjoint(self.factor, num / self.den, None, self.key)

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


def _merged(parts: list[_Adjoint]) -> list[_Adjoint]:
    """Join contributions that differ in their factor only: x + x is 2 x, exactly."""
    kept: dict[tuple[int, int], _Adjoint] = {}
    for part in parts:
        name = (-1 if part.num is None else part.num.id, -1 if part.den is None else part.den.id)
        other = kept.get(name)
        if other is None:
            kept[name] = part
        else:
            kept[name] = _Adjoint(other.factor + part.factor, part.num, part.den, other.key)
    return [part for part in kept.values() if part.factor != 0]


def _added(parts: list[_Adjoint], graph: Graph) -> _Adjoint | None:
    """Add contributions in order; a common factor and a common denominator stay outside."""
    parts = _merged(parts)
    if len(parts) <= 1:
        return parts[0] if parts else None
    size = abs(parts[0].factor)
    common = size if all(abs(part.factor) == size for part in parts) else _ONE
    den = parts[0].den
    if any(part.den is not den for part in parts):
        den = None
    else:
        parts = [_Adjoint(part.factor, part.num, None, part.key) for part in parts]
    total = parts[0].scaled(1 / common, 0).node(graph)
    for part in parts[1:]:
        total = total + part.scaled(1 / common, 0).node(graph)
    return _Adjoint(common, total, den, parts[0].key)


class _Sweep(Visitor[None]):
    def __init__(self, root: Node) -> None:
        self.graph = root.graph
        self.nodes = reachable([root])
        self.parts: dict[int, list[_Adjoint]] = {}
        self._stages: dict[Stage, list[tuple[Loop | None, Place, Node]]] = {}
        self._owners: dict[int, list[Stage]] = {}  # stages by the nodes that they add up
        self._needed: set[int] = set()
        self._inverse: dict[int, Node] = {}
        self._survey()

    def _survey(self) -> None:
        """Find the values that derivatives need anyway, and among them the reciprocals; and the stages."""
        for stage in dict.fromkeys(node.data[0] for node in self.nodes if node.op == "element"):
            for root in dict.fromkeys(stage.roots):
                self._owners.setdefault(root.id, []).append(stage)
        for node in self.nodes:
            if not node.flags & STATE or node.op == "element":
                continue
            if node.op == "mul":
                a, b = node.args
                self._needed.update([b.id] if a.flags & STATE else [])
                self._needed.update([a.id] if b.flags & STATE else [])
            elif node.op in ("pow", "table"):
                self._needed.add(node.args[0].id)
            elif (function := FUNCTIONS.get(node.op)) is not None and function.derivative is not None:
                self._needed.update([node.id] if function.of_value else [arg.id for arg in node.args])
            elif node.op == "div":
                self._needed.add(node.args[1].id)
        for node in self.nodes:
            if node.op == "div" and node.id in self._needed:
                a, b = node.args
                if a.op == "const" and a.data == 1.0:
                    self._inverse[b.id] = node

    def _over(self, part: _Adjoint, node: Node, key: int, factor: Fraction = _ONE) -> _Adjoint:
        """Divide by ``node``, or multiply by its reciprocal where that is known."""
        inverse = self._inverse.get(node.id)
        if inverse is not None:
            return part.times(inverse, key, factor=factor)
        return part.over(node, key, factor=factor)

    def _give(self, node: Node, part: _Adjoint) -> None:
        if node.flags & STATE and part.factor != 0:
            self.parts.setdefault(node.id, []).append(part)

    def from_stages(self, node: Node) -> None:
        """Give a node what the values of stages that it is a summand of are multiplied by.

        All that reads a stage comes after its summands, so that the adjoints of its values are complete.
        """
        for stage in self._owners.get(node.id, ()):
            adjoints = self._adjoints(stage)
            if adjoints is None:
                continue
            for place, root in stage.terms:
                if root is node:
                    self._give(node, _Adjoint(_ONE, self.graph.element(adjoints, place, None), None, node.id))
            for loop, entries in stage.loops:
                for place, root in entries:
                    if root is node:
                        value = self.graph.element(adjoints, place, loop)
                        self._give(node, _Adjoint(_ONE, value, None, node.id))

    def _adjoints(self, stage: Stage) -> Stage | None:
        """Return the adjoints of a stage's values, a stage themselves."""
        given = self._stages.get(stage)
        if not given:
            return None
        loops: dict[Loop, list[tuple[Affine, Node]]] = {}
        terms: list[tuple[int, Node]] = []
        for loop, place, node in given:
            if isinstance(place, Affine) and loop is not None:
                loops.setdefault(loop, []).append((place, node))
            elif isinstance(place, int):
                terms.append((place, node))
        inside = tuple((loop, tuple(entries)) for loop, entries in loops.items())
        return self.graph.stage(stage.size, inside, tuple(terms))

    def collected(self, node: Node) -> list[_Adjoint]:
        """Return the contributions to a node in the user's order, those from loops summed up."""
        parts = self.parts.pop(node.id, [])[::-1]
        return self._out_of_loops(parts) if node.loop is None else parts

    def _out_of_loops(self, parts: list[_Adjoint]) -> list[_Adjoint]:
        graph = self.graph
        outside: list[_Adjoint] = []
        inside: dict[Loop, list[_Adjoint]] = {}
        for part in parts:
            loop = next((n.loop for n in (part.num, part.den) if n is not None and n.loop is not None), None)
            # A contribution from inside a loop that does not vary there still occurs once per term.
            loop = loop or self.graph.nodes[part.key].loop
            if loop is None:
                outside.append(part)
            else:
                inside.setdefault(loop, []).append(part)
        sums: list[_Adjoint] = []
        for loop, loop_parts in inside.items():
            total = _added(loop_parts, graph)
            if total is not None:
                body = _Adjoint(_ONE, total.num, total.den, 0).node(graph)
                sums.append(_Adjoint(total.factor, graph.sum(body, loop), None, total.key))
        return sums + outside

    def pull(self, node: Node, adjoint: _Adjoint) -> None:
        """Pass the adjoint of ``node`` on to its arguments."""
        active = [arg for arg in node.args if arg.flags & STATE] if node.op != "element" else []
        if len(active) > 1 and node.args[0] is not node.args[-1]:
            adjoint = adjoint.divided(self.graph)
        self.visit(node, [adjoint])

    def visit_add(self, node: Node, adjoint: _Adjoint) -> None:
        for arg in reversed(node.args):
            self._give(arg, adjoint.scaled(_ONE, node.id))

    def visit_sub(self, node: Node, adjoint: _Adjoint) -> None:
        self._give(node.args[1], adjoint.scaled(-_ONE, node.id))
        self._give(node.args[0], adjoint.scaled(_ONE, node.id))

    def visit_neg(self, node: Node, adjoint: _Adjoint) -> None:
        self._give(node.args[0], adjoint.scaled(-_ONE, node.id))

    def visit_mul(self, node: Node, adjoint: _Adjoint) -> None:
        a, b = node.args
        if a is b:
            self._give(a, adjoint.times(a, node.id, factor=Fraction(2)))
            return
        if b.flags & STATE:
            self._give(b, adjoint.times(a, node.id))
        if a.flags & STATE:
            self._give(a, adjoint.times(b, node.id))

    def visit_div(self, node: Node, adjoint: _Adjoint) -> None:
        a, b = node.args
        key = node.id
        if b.flags & STATE:
            if node.id in self._needed:
                part = self._over(adjoint.times(node, key), b, key, -_ONE)
            elif b.op == "sqrt":
                part = adjoint.times(a, key, factor=-_ONE).over(b.args[0], key)
            else:
                part = adjoint.times(a, key, factor=-_ONE).over(self.graph.mul(b, b), key)
            self._give(b, part)
        if a.flags & STATE:
            self._give(a, self._over(adjoint, b, key))

    def visit_pow(self, node: Node, adjoint: _Adjoint) -> None:
        (x,), n = node.args, node.data
        self._give(x, adjoint.times(self.graph.int_power(x, n - 1), node.id, factor=Fraction(n)))

    def visit_where(self, node: Node, adjoint: _Adjoint) -> None:
        condition, a, b = node.args
        value, zero = adjoint.node(self.graph), self.graph.const(0.0)
        for arg, (first, second) in ((b, (zero, value)), (a, (value, zero))):
            self._give(arg, _Adjoint(_ONE, self.graph.where(condition, first, second), None, node.id))

    def visit_sum(self, node: Node, adjoint: _Adjoint) -> None:
        self._give(node.args[0], adjoint.divided(self.graph).scaled(_ONE, node.id))

    def visit_element(self, node: Node, adjoint: _Adjoint) -> None:
        stage, place = node.data
        self._stages.setdefault(stage, []).append((node.loop, place, adjoint.node(self.graph)))

    def visit_table(self, node: Node, adjoint: _Adjoint) -> None:
        (x,) = node.args
        self._give(x, adjoint.times(self.graph.table(x, node.data.slope()), node.id))

    def visit_operation(self, node: Node, *adjoints: _Adjoint) -> None:
        (adjoint,) = adjoints
        slopes = FUNCTIONS[node.op].slopes(node)
        for arg, slope in reversed([*zip(node.args, slopes, strict=True)]):
            self._give(arg, self._along(slope, adjoint, node.id))

    def _along(self, slope: Slope, adjoint: _Adjoint, key: int) -> _Adjoint:
        """Return the adjoint times a derivative."""
        adjoint = adjoint.scaled(slope.factor, key)
        if slope.times is not None:
            adjoint = adjoint.times(slope.times, key)
        return adjoint if slope.over is None else self._over(adjoint, slope.over, key)


def gradient(root: Node, dim: int) -> Function:
    """Differentiate a scalar with respect to the state.

    Parameters
    ----------
    root : Node
        The scalar; not inside a loop.
    dim : int
        Length of the state.

    Returns
    -------
    Function
        ``dim`` outputs; those of components that the scalar does not use have no summands.
    """
    graph = root.graph
    outputs: list[tuple[Term, ...]] = [()] * dim
    loops: dict[Loop, list[LoopTerm]] = {}
    sweep = _Sweep(root)
    sweep.parts[root.id] = [_Adjoint(_ONE, None, None, root.id)]
    for node in reversed(sweep.nodes):
        sweep.from_stages(node)
        if not node.flags & STATE or node.id not in sweep.parts:
            continue
        parts = sweep.collected(node)
        loop = node.loop
        if node.op == "symbol" and loop is None:
            outputs[node.data[1]] = tuple(Term(part.node(graph), part.key) for part in _merged(parts))
            continue
        total = _added(parts, graph)
        if total is None:
            continue
        if node.op == "symbol" and loop is not None:
            loops.setdefault(loop, []).append(LoopTerm(node.data[1], total.node(graph)))
        else:
            sweep.pull(node, total)
    ordered = sorted(loops, key=lambda loop: loop.id)
    return Function(graph, tuple(outputs), tuple((loop, tuple(loops[loop][::-1])) for loop in ordered))
