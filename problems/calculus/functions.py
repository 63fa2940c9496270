"""The vector functions of a system, as graphs ready for the emitters.

A `Function` is a list of outputs. Each output is a chain of summands, added
left to right; summands that stand in loops come before the others.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from problems.calculus.gradient import Gradient, LoopTerm, Term
from problems.trace.graph import PAR, Graph, Node, P
from problems.trace.sums import Loop


@dataclass(frozen=True, eq=False)
class Function:
    """Outputs of one emitted function.

    Attributes
    ----------
    graph : Graph
        Where the nodes live.
    outputs : tuple of tuple of Term
        The summands of each output, in order; none: the output is 0.
    loops : tuple of (Loop, tuple of LoopTerm)
        Summands in loops, by place of the output.
    """

    graph: Graph
    outputs: tuple[tuple[Term, ...], ...]
    loops: tuple[tuple[Loop, tuple[LoopTerm, ...]], ...] = ()


def plain(graph: Graph, nodes: Sequence[Node]) -> Function:
    """Return the function whose outputs are ``nodes``."""
    return Function(graph, tuple((Term(node, node.id),) for node in nodes))


def _terms(gradient: Gradient, place: int, sign: int) -> tuple[Term, ...]:
    terms = gradient.terms.get(place, ())
    return terms if sign > 0 else tuple(Term(-term.node, term.key) for term in terms)


def _loops(
    gradient: Gradient, low: int, high: int, shift: int, sign: int
) -> list[tuple[Loop, tuple[LoopTerm, ...]]]:
    """Return the loop summands of the places low..high-1, moved by ``shift``."""
    kept: list[tuple[Loop, tuple[LoopTerm, ...]]] = []
    for loop, entries in gradient.loops:
        inside = tuple(
            LoopTerm(entry.index.shifted(shift), entry.node if sign > 0 else -entry.node)
            for entry in entries
            if low <= int(entry.index.values(loop)[0]) < high
        )
        if inside:
            kept.append((loop, inside))
    return kept


def _joined(
    *parts: list[tuple[Loop, tuple[LoopTerm, ...]]],
) -> tuple[tuple[Loop, tuple[LoopTerm, ...]], ...]:
    """Join the summands of the same loop, so that each loop runs once."""
    joined: dict[int, tuple[Loop, tuple[LoopTerm, ...]]] = {}
    for part in parts:
        for loop, entries in part:
            before = joined[loop.id][1] if loop.id in joined else ()
            joined[loop.id] = (loop, before + entries)
    return tuple(joined.values())


def force(graph: Graph, gradient: Gradient, dof: int) -> Function:
    """Return -dH/dq."""
    outputs = tuple(_terms(gradient, i, -1) for i in range(dof))
    return Function(graph, outputs, _joined(_loops(gradient, 0, dof, 0, -1)))


def hamiltonian_field(graph: Graph, gradient: Gradient, dof: int, scale: Function | None) -> Function:
    """Return (dH/dp, -dH/dq); with ``scale``, dH/dp is written as the scale times p."""
    pull = force(graph, gradient, dof)
    if scale is None:
        outputs = tuple(_terms(gradient, dof + i, +1) for i in range(dof))
        velocity = _loops(gradient, dof, 2 * dof, -dof, +1)
    else:
        outputs = tuple(_times_momentum(scale.outputs[i], dof + i) for i in range(dof))
        velocity = [
            (loop, tuple(_loop_times_momentum(graph, loop, entry, dof) for entry in entries))
            for loop, entries in scale.loops
        ]
    moved = [
        (loop, tuple(LoopTerm(entry.index.shifted(dof), entry.node) for entry in entries))
        for loop, entries in pull.loops
    ]
    return Function(graph, outputs + pull.outputs, _joined(velocity, moved))


def _times_momentum(scale: tuple[Term, ...], place: int) -> tuple[Term, ...]:
    return tuple(Term(term.node * term.node.graph.symbol("y", place, flags=P), term.key) for term in scale)


def _loop_times_momentum(graph: Graph, loop: Loop, entry: LoopTerm, dof: int) -> LoopTerm:
    momentum = graph.symbol("y", entry.index.shifted(dof), flags=P, loop=loop)
    return LoopTerm(entry.index, entry.node * momentum)


def velocity_scale(graph: Graph, gradient: Gradient, dof: int) -> Function | None:
    """Return c with dH/dp_i = c_i p_i and c_i a function of parameters, or ``None``.

    Found from the structure of dH/dp: products and quotients of p_i with
    parameters and constants, and sums of these.
    """
    outputs: list[tuple[Term, ...]] = []
    for i in range(dof):
        total: Node | None = None
        terms = gradient.terms.get(dof + i, ())
        for term in terms:
            scale = _coefficient(term.node, ("y", dof + i))
            if scale is None:
                return None
            total = scale if total is None else total + scale
        outputs.append(() if total is None else (Term(total, terms[0].key),))
    loops: list[tuple[Loop, tuple[LoopTerm, ...]]] = []
    for loop, entries in _loops(gradient, dof, 2 * dof, -dof, +1):
        scaled: list[LoopTerm] = []
        for entry in entries:
            scale = _coefficient(entry.node, ("y", entry.index.shifted(dof)))
            if scale is None:
                return None
            scaled.append(LoopTerm(entry.index, scale))
        loops.append((loop, tuple(scaled)))
    return Function(graph, tuple(outputs), tuple(loops))


def _coefficient(node: Node, momentum: tuple[str, object]) -> Node | None:
    """Return c, free of state and time, with ``node = c * momentum``; ``None`` if it has not this form."""
    graph = node.graph
    if node.op == "symbol":
        return graph.const(1.0) if node.data == momentum else None
    if node.op == "neg":
        inner = _coefficient(node.args[0], momentum)
        return None if inner is None else -inner
    if node.op in ("add", "sub"):
        a, b = (_coefficient(arg, momentum) for arg in node.args)
        if a is None or b is None:
            return None
        return a + b if node.op == "add" else a - b
    if node.op in ("mul", "div"):
        a, b = node.args
        if not b.flags & ~PAR:
            inner = _coefficient(a, momentum)
            return None if inner is None else graph.apply(node, (inner, b))
        if node.op == "mul" and not a.flags & ~PAR:
            inner = _coefficient(b, momentum)
            return None if inner is None else a * inner
    return None
