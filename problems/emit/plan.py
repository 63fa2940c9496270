"""From a function's graph to the statements that every emitter prints.

Small declared sums are written out term by term, large ones stay loops; powers
become products; statements are ordered so that one pair of bodies is finished
before the next begins. The order of additions is the same in all cases.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from problems.calculus.functions import Function
from problems.calculus.gradient import LoopTerm, Term, reachable
from problems.emit.rewrite import Rewriter, body_of
from problems.trace.graph import Graph, Node
from problems.trace.sums import Loop

# Loops of at most this many operations in all are written out: 15 pairs of bodies are, 45 are not.
SMALL = 700


@dataclass(frozen=True, eq=False)
class Let:
    """A value to be computed."""

    node: Node


@dataclass(frozen=True, eq=False)
class Store:
    """An output is complete."""

    place: int
    node: Node


@dataclass(frozen=True, eq=False)
class Reduce:
    """``node``, a declared sum, to be computed by a loop over ``body``."""

    node: Node
    loop: Loop
    body: tuple[Node, ...]


@dataclass(frozen=True, eq=False)
class Scatter:
    """A loop over ``body`` that adds onto outputs.

    Attributes
    ----------
    unique : tuple of bool
        For each entry, whether its outputs receive nothing else from any loop,
        so that they are stored rather than added to.
    """

    loop: Loop
    body: tuple[Node, ...]
    entries: tuple[LoopTerm, ...]
    unique: tuple[bool, ...]


@dataclass
class Plan:
    """Statements in order.

    Attributes
    ----------
    n_out : int
        Number of outputs.
    first, last : list
        Statements before and after the loops that add onto outputs.
    zeros : list of int
        Outputs that the loops add to, so that they start from (negative) zero.
    scatters : list of Scatter
        The loops that add onto outputs.
    uses : dict
        How often each node is used; one used once is printed in place.
    spare : dict
        For each declared sum, an output that is not yet in use when the sum is computed.
    """

    n_out: int
    first: list[Let | Reduce | Store] = field(default_factory=list)
    zeros: list[int] = field(default_factory=list)
    scatters: list[Scatter] = field(default_factory=list)
    last: list[Let | Reduce | Store] = field(default_factory=list)
    uses: dict[int, int] = field(default_factory=dict)
    spare: dict[int, int] = field(default_factory=dict)


def make_plan(function: Function, *, limit: int | None = SMALL) -> Plan:
    """Order the operations of a function.

    Parameters
    ----------
    function : Function
        What to compute.
    limit : int or None
        Largest number of operations of a declared sum that is written out;
        ``None`` writes out all of them, 0 none.
    """
    graph = function.graph
    loop_roots = [entry.node for _, entries in function.loops for entry in entries]
    scalar_roots = [term.node for terms in function.outputs for term in terms]
    rewriter = Rewriter(graph, limit, loop_roots + scalar_roots)

    chains: list[list[Term]] = [[] for _ in function.outputs]
    kept: list[tuple[Loop, list[LoopTerm]]] = []
    step = -1_000_000_000  # written-out loops come before the other summands
    for loop, entries in function.loops:
        roots = [entry.node for entry in entries]
        if not rewriter.small(loop, roots):
            inside = rewriter.inside(roots, loop)
            kept.append((loop, [LoopTerm(e.index, n) for e, n in zip(entries, inside, strict=True)]))
            continue
        places = [entry.index.values(loop) for entry in entries]
        for k, nodes in enumerate(rewriter.written_out(roots, loop)):
            for place, node in zip(places, nodes, strict=True):
                step += 1
                chains[int(place[k])].append(Term(node, step))
    for chain, terms in zip(chains, function.outputs, strict=True):
        chain.extend(Term(rewriter.done[term.node.id], term.key) for term in terms)

    plan = Plan(len(chains))
    covered = _scatters(plan, kept)
    finals, hints = _chains(graph, chains, covered)
    _schedule(plan, finals, hints)
    return plan


def _scatters(plan: Plan, kept: list[tuple[Loop, list[LoopTerm]]]) -> set[int]:
    hits = np.zeros(plan.n_out, dtype=np.int64)
    for loop, entries in kept:
        for entry in entries:
            np.add.at(hits, entry.index.values(loop), 1)
    for loop, entries in kept:
        unique = tuple(bool((hits[entry.index.values(loop)] == 1).all()) for entry in entries)
        body = body_of([entry.node for entry in entries], loop)
        plan.scatters.append(Scatter(loop, tuple(body), tuple(entries), unique))
        for entry, alone in zip(entries, unique, strict=True):
            if not alone:
                plan.zeros.extend(int(place) for place in entry.index.values(loop))
    plan.zeros = sorted(set(plan.zeros))
    return {int(place) for place in np.flatnonzero(hits)}


def _chains(
    graph: Graph, chains: list[list[Term]], covered: set[int]
) -> tuple[list[tuple[int, Node]], list[Node]]:
    """Add up the summands of each output; return the sums and the partial sums in order of use."""
    finals: list[tuple[int, Node]] = []
    partial: list[tuple[int, Node]] = []
    for place, chain in enumerate(chains):
        total = graph.symbol("out", place, flags=0) if chain and place in covered else None
        for term in chain:
            total = term.node if total is None else total + term.node
            partial.append((term.key, total))
        if chain or place not in covered:
            finals.append((place, graph.const(0.0) if total is None else total))
    return finals, [node for _, node in sorted(partial, key=lambda item: item[0])]


def _schedule(plan: Plan, finals: list[tuple[int, Node]], hints: list[Node]) -> None:
    outputs: dict[int, list[int]] = {}
    for place, node in finals:
        outputs.setdefault(node.id, []).append(place)
    done: set[int] = set()
    captured = [
        arg for scatter in plan.scatters for node in scatter.body for arg in node.args if arg.loop is None
    ] + [e.node for scatter in plan.scatters for e in scatter.entries if e.node.loop is None]

    def emit(roots: Sequence[Node], statements: list[Let | Reduce | Store]) -> None:
        for root in roots:
            for node in _demanded(root, done):
                if node.op == "sum":
                    statements.append(Reduce(node, node.data, tuple(body_of(node.args, node.data))))
                else:
                    statements.append(Let(node))
                for place in outputs.pop(node.id, ()):
                    statements.append(Store(place, node))

    if plan.scatters:
        # Sums first: they need an output that is not in use yet.
        captured += [n for n in reachable([node for _, node in finals]) if n.op == "sum"]
    emit(captured, plan.first)
    needed = {node.id for node in reachable([node for _, node in finals])}
    emit([node for node in hints if node.id in needed] + [node for _, node in finals], plan.last)
    if not plan.scatters:
        plan.first, plan.last = plan.first + plan.last, []

    used: set[int] = set()
    for statement in plan.first + plan.last:
        if isinstance(statement, Store):
            used.add(statement.place)
        elif isinstance(statement, Reduce):
            plan.spare[statement.node.id] = next(i for i in range(plan.n_out) if i not in used)
    uses = plan.uses
    for statement in plan.first + plan.last:
        if isinstance(statement, Let):
            for arg in statement.node.args:
                uses[arg.id] = uses.get(arg.id, 0) + 1
        elif isinstance(statement, Store):
            uses[statement.node.id] = uses.get(statement.node.id, 0) + 1
        else:
            _count_body(uses, statement.body, [statement.node.args[0]])
    for scatter in plan.scatters:
        _count_body(uses, scatter.body, [entry.node for entry in scatter.entries])


def _count_body(uses: dict[int, int], body: Sequence[Node], roots: Sequence[Node]) -> None:
    for arg in [arg for node in body for arg in node.args] + list(roots):
        # What a loop takes from outside is computed once, before the loop.
        uses[arg.id] = uses.get(arg.id, 0) + (1 if arg.loop is not None else 2)


def _demanded(root: Node, done: set[int]) -> list[Node]:
    """Return what ``root`` needs and is not done yet, arguments first, depth first."""
    ordered: list[Node] = []
    stack: list[tuple[Node, bool]] = [(root, False)]
    while stack:
        node, ready = stack.pop()
        if node.id in done:
            continue
        if ready:
            done.add(node.id)
            ordered.append(node)
            continue
        stack.append((node, True))
        if node.op == "sum":
            inner = body_of(node.args, node.data)
            needed = [arg for n in inner for arg in n.args if arg.loop is None]
        else:
            needed = list(node.args)
        stack.extend((arg, False) for arg in reversed(needed) if arg.id not in done)
    return ordered
