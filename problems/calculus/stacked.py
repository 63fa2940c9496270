"""Gradients of invariants, and several functions of a system as one.

The methods that keep several invariants need, at every stage, the vector field
and the gradients of the invariants. As one function they share their common
subexpressions: the distances of bodies are computed once.
"""

from collections.abc import Sequence

from problems.calculus.functions import Function
from problems.calculus.gradient import Gradient, LoopTerm, Term, gradient
from problems.trace.graph import Graph, Node
from problems.trace.sums import Loop


def gradients(graph: Graph, nodes: Sequence[Node], dim: int) -> Function:
    """Return the gradients of scalars with respect to the state, one after another.

    Parameters
    ----------
    graph : Graph
        Where the nodes live.
    nodes : sequence of Node
        The scalars.
    dim : int
        Length of the state.

    Returns
    -------
    Function
        ``len(nodes) * dim`` outputs; the gradient of the i-th scalar begins at ``i * dim``.
    """
    parts: list[Function] = []
    for node in nodes:
        found: Gradient = gradient(node)
        outputs = tuple(found.terms.get(place, ()) for place in range(dim))
        parts.append(Function(graph, outputs, found.loops))
    return stacked(parts)


def energy_gradient(field: Function, dof: int) -> Function:
    """Return grad H from a canonical field (dH/dp, -dH/dq), with the very same roundings."""
    head = tuple(tuple(_minus(term) for term in terms) for terms in field.outputs[dof:])
    loops = tuple(
        (loop, tuple(_turned(loop, entry, dof) for entry in entries)) for loop, entries in field.loops
    )
    return Function(field.graph, head + field.outputs[:dof], loops)


def stacked(functions: Sequence[Function]) -> Function:
    """Return one function with the outputs of all, in order; each loop runs once."""
    outputs: list[tuple[Term, ...]] = []
    loops: dict[int, tuple[Loop, list[LoopTerm]]] = {}
    for function in functions:
        for loop, entries in function.loops:
            moved = [LoopTerm(entry.index.shifted(len(outputs)), entry.node) for entry in entries]
            loops.setdefault(loop.id, (loop, []))[1].extend(moved)
        outputs.extend(function.outputs)
    return Function(functions[0].graph, tuple(outputs), tuple((loop, tuple(e)) for loop, e in loops.values()))


def _minus(term: Term) -> Term:
    return Term(-term.node, term.key)


def _turned(loop: Loop, entry: LoopTerm, dof: int) -> LoopTerm:
    if int(entry.index.values(loop)[0]) < dof:
        return LoopTerm(entry.index.shifted(dof), entry.node)
    return LoopTerm(entry.index.shifted(-dof), -entry.node)
