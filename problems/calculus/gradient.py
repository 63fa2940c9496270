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

from problems.calculus.adjoint import ONE, Adjoint, added, merged
from problems.trace.graph import STATE, Node
from problems.trace.sums import Affine, Loop


@dataclass(frozen=True, eq=False)
class Term:
    """A summand of a derivative.

    Attributes
    ----------
    node : Node
        Its value.
    key : int
        Where the user's expression uses the variable: emitters that follow it
        finish one pair of bodies before they begin the next.
    """

    node: Node
    key: int


@dataclass(frozen=True, eq=False)
class LoopTerm:
    """A summand of many derivatives: ``node`` is added at ``index`` for each term of a loop."""

    index: Affine
    node: Node


@dataclass(frozen=True, eq=False)
class Gradient:
    """Derivatives of a scalar with respect to the state.

    Attributes
    ----------
    terms : dict of int to tuple of Term
        Summands by place in the state, in order; places without one are absent.
    loops : tuple of (Loop, tuple of LoopTerm)
        Summands that stand in loops; they come before `terms`.
    """

    terms: dict[int, tuple[Term, ...]]
    loops: tuple[tuple[Loop, tuple[LoopTerm, ...]], ...]


def reachable(roots: list[Node]) -> list[Node]:
    """Return all nodes that ``roots`` depend on, arguments first."""
    seen: dict[int, Node] = {}
    stack = list(roots)
    while stack:
        node = stack.pop()
        if node.id not in seen:
            seen[node.id] = node
            stack.extend(node.args)
    return [seen[key] for key in sorted(seen)]


class _Sweep:
    def __init__(self, root: Node) -> None:
        self.graph = root.graph
        self.nodes = reachable([root])
        self.parts: dict[int, list[Adjoint]] = {}
        self._needed: set[int] = set()
        self._inverse: dict[int, Node] = {}
        self._survey()

    def _survey(self) -> None:
        """Find the values that derivatives need anyway, and among them the reciprocals."""
        for node in self.nodes:
            if not node.flags & STATE:
                continue
            if node.op == "mul":
                a, b = node.args
                self._needed.update([b.id] if a.flags & STATE else [])
                self._needed.update([a.id] if b.flags & STATE else [])
            elif node.op in ("pow", "sin", "cos", "log", "abs"):
                self._needed.add(node.args[0].id)
            elif node.op in ("sqrt", "exp", "tan"):
                self._needed.add(node.id)
            elif node.op == "div":
                self._needed.add(node.args[1].id)
        for node in self.nodes:
            if node.op == "div" and node.id in self._needed:
                a, b = node.args
                if a.op == "const" and a.data == 1.0:
                    self._inverse[b.id] = node

    def _over(self, part: Adjoint, node: Node, key: int, factor: Fraction = ONE) -> Adjoint:
        """Divide by ``node``, or multiply by its reciprocal where that is known."""
        inverse = self._inverse.get(node.id)
        if inverse is not None:
            return part.times(inverse, key, factor=factor)
        return part.over(node, key, factor=factor)

    def _give(self, node: Node, part: Adjoint) -> None:
        if node.flags & STATE and part.factor != 0:
            self.parts.setdefault(node.id, []).append(part)

    def collected(self, node: Node) -> list[Adjoint]:
        """Return the contributions to a node in the user's order, those from loops summed up."""
        parts = self.parts.pop(node.id, [])[::-1]
        return self._out_of_loops(parts) if node.loop is None else parts

    def _out_of_loops(self, parts: list[Adjoint]) -> list[Adjoint]:
        graph = self.graph
        outside: list[Adjoint] = []
        inside: dict[int, tuple[Loop, list[Adjoint]]] = {}
        for part in parts:
            loop = next((n.loop for n in (part.num, part.den) if n is not None and n.loop is not None), None)
            # A contribution from inside a loop that does not vary there still occurs once per term.
            loop = loop or self.graph.nodes[part.key].loop
            if loop is None:
                outside.append(part)
            else:
                inside.setdefault(loop.id, (loop, []))[1].append(part)
        sums: list[Adjoint] = []
        for loop, loop_parts in inside.values():
            total = added(loop_parts, graph)
            if total is not None:
                body = Adjoint(ONE, total.num, total.den, 0).node(graph)
                sums.append(Adjoint(total.factor, graph.sum(body, loop), None, total.key))
        return sums + outside

    def pull(self, node: Node, adjoint: Adjoint) -> None:
        """Pass the adjoint of ``node`` on to its arguments."""
        graph, key = self.graph, node.id
        active = [arg for arg in node.args if arg.flags & STATE]
        if len(active) > 1 and node.args[0] is not node.args[-1]:
            adjoint = adjoint.divided(graph)
        match node.op:
            case "add":
                for arg in reversed(node.args):
                    self._give(arg, adjoint.scaled(ONE, key))
            case "sub":
                self._give(node.args[1], adjoint.scaled(-ONE, key))
                self._give(node.args[0], adjoint.scaled(ONE, key))
            case "neg":
                self._give(node.args[0], adjoint.scaled(-ONE, key))
            case "mul":
                a, b = node.args
                if a is b:
                    self._give(a, adjoint.times(a, key, factor=Fraction(2)))
                else:
                    if b.flags & STATE:
                        self._give(b, adjoint.times(a, key))
                    if a.flags & STATE:
                        self._give(a, adjoint.times(b, key))
            case "div":
                self._pull_quotient(node, adjoint)
            case "pow":
                (x,), n = node.args, node.data
                self._give(x, adjoint.times(graph.int_power(x, n - 1), key, factor=Fraction(n)))
            case "sqrt":
                self._give(node.args[0], self._over(adjoint, node, key, Fraction(1, 2)))
            case "sum":
                adjoint = adjoint.divided(graph)
                self._give(node.args[0], adjoint.scaled(ONE, key))
            case _:
                self._give(node.args[0], self._pull_function(node, adjoint))

    def _pull_quotient(self, node: Node, adjoint: Adjoint) -> None:
        a, b = node.args
        key = node.id
        if b.flags & STATE:
            if node.id in self._needed:
                part = self._over(adjoint.times(node, key), b, key, -ONE)
            elif b.op == "sqrt":
                part = adjoint.times(a, key, factor=-ONE).over(b.args[0], key)
            else:
                part = adjoint.times(a, key, factor=-ONE).over(self.graph.mul(b, b), key)
            self._give(b, part)
        if a.flags & STATE:
            self._give(a, self._over(adjoint, b, key))

    def _pull_function(self, node: Node, adjoint: Adjoint) -> Adjoint:
        graph, key = self.graph, node.id
        x = node.args[0]
        match node.op:
            case "sin":
                return adjoint.times(graph.call("cos", x), key)
            case "cos":
                return adjoint.times(graph.call("sin", x), key, factor=-ONE)
            case "tan":
                return adjoint.times(graph.node(1.0) + node * node, key)
            case "exp":
                return adjoint.times(node, key)
            case "log":
                return self._over(adjoint, x, key)
            case "abs":
                return adjoint.times(graph.call("sign", x), key)
            case "sign":
                return adjoint.scaled(Fraction(0), key)
        raise AssertionError(f"no derivative of {node.op}")  # pragma: no cover


def gradient(root: Node) -> Gradient:
    """Differentiate a scalar with respect to every component of the state that it uses.

    Parameters
    ----------
    root : Node
        The scalar; not inside a loop.

    Returns
    -------
    Gradient
        Summands in order, added up by `problems.calculus.functions`.
    """
    graph = root.graph
    terms: dict[int, tuple[Term, ...]] = {}
    loops: dict[int, tuple[Loop, list[LoopTerm]]] = {}
    if not root.flags & STATE:
        return Gradient({}, ())
    sweep = _Sweep(root)
    sweep.parts[root.id] = [Adjoint(ONE, None, None, root.id)]
    for node in reversed(sweep.nodes):
        if not node.flags & STATE or node.id not in sweep.parts:
            continue
        parts = sweep.collected(node)
        if node.op != "symbol":
            total = added(parts, graph)
            if total is not None:
                sweep.pull(node, total)
            continue
        place = node.data[1]
        if node.loop is None:
            terms[place] = tuple(Term(part.node(graph), part.key) for part in merged(parts))
        else:
            total = added(parts, graph)
            if total is not None:
                entry = LoopTerm(place, total.node(graph))
                loops.setdefault(node.loop.id, (node.loop, []))[1].append(entry)
    ordered = [(loop, tuple(entries[::-1])) for _, (loop, entries) in sorted(loops.items())]
    return Gradient(terms, tuple(ordered))
