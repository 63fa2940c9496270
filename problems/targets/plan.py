"""From a function's graph to the statements that every emitter prints.

Small declared sums are written out term by term, large ones stay loops; powers
become products; statements are ordered so that one pair of bodies is finished
before the next begins. The order of additions is the same in all cases.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from problems.derive.function import Function, LoopTerm, Term
from problems.graph.fold import Fold
from problems.graph.functions import FUNCTIONS
from problems.graph.loops import Loop, Stage
from problems.graph.nodes import READS, Graph, Node, reachable

# Loops of at most this many operations in all are written out: 15 pairs of bodies are, 45 are not.
SMALL = 700
MANY = 4000  # operations of small loops, all together, beyond which they stay loops


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


@dataclass(frozen=True, eq=False)
class Fill:
    """An array of intermediate values, to be filled by loops and then by single summands.

    Attributes
    ----------
    name : str
        What it is called.
    size : int
        Number of values.
    zeros : list of int
        Those that start from (negative) zero.
    scatters : list of Scatter
        The loops.
    terms : list of (int, Node, bool)
        Further summands: the place, the node, and whether it is added to what is there.
    """

    name: str
    size: int
    zeros: "list[int]"
    scatters: "list[Scatter]"
    terms: "list[tuple[int, Node, bool]]"


Statement = Let | Reduce | Store | Fill


def array_of(stage: Stage) -> str:
    """Return what the array of a stage is called."""
    return f"w{stage.id}"


LOOP, TABLE = 25, 8  # additions that take as long to compile
COST = {name: function.cost for name, function in FUNCTIONS.items()} | {"table": TABLE}


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
    uses : Counter
        How often each node is used; one used once is printed in place.
    spare : dict
        For each declared sum, an output that is not yet in use when the sum is computed.
    """

    n_out: int
    first: list[Statement] = field(default_factory=list)
    zeros: list[int] = field(default_factory=list)
    scatters: list[Scatter] = field(default_factory=list)
    last: list[Statement] = field(default_factory=list)
    uses: Counter[int] = field(default_factory=Counter)
    spare: dict[int, int] = field(default_factory=dict)

    @property
    def cost(self) -> int:
        """Additions that take as long to compile."""
        scatters = [*self.scatters]
        total = 0
        for statement in self.first + self.last:
            match statement:
                case Let(node):
                    total += COST.get(node.op, 1)
                case Reduce(_, _, body):
                    total += LOOP + sum(COST.get(node.op, 1) for node in body)
                case Fill():
                    scatters += statement.scatters
        return total + sum(LOOP + sum(COST.get(n.op, 1) for n in scatter.body) for scatter in scatters)


class _Rewriting(Fold[Node]):
    """The same operations, powers as products."""

    def __init__(self, graph: Graph, uses: Counter[int]) -> None:
        super().__init__()
        self.graph, self.uses = graph, uses

    def visit_pow(self, node: Node, base: Node) -> Node:
        return self.graph.expanded(base, node.data)

    def visit_neg(self, node: Node, a: Node) -> Node:
        if a.op == "sub" and self.uses[node.args[0].id] == 1:
            return self.graph.sub(*a.args[::-1])  # -(a - b), used here only
        return self.graph.neg(a)

    def visit_operation(self, node: Node, *results: Node) -> Node:
        return self.graph.apply(node, results)


class _Expansion(_Rewriting):
    """Writes out the declared sums that are small enough."""

    def __init__(self, graph: Graph, limit: int | None, roots: Sequence[Node]) -> None:
        nodes = reachable(roots)
        uses = Counter(root.id for root in roots)
        uses.update(arg.id for node in nodes for arg in node.args)
        super().__init__(graph, uses)
        self.limit = limit
        self._stages: dict[Stage, Stage] = {}
        self._values: dict[Stage, list[Node]] = {}
        self.whole = limit is None or not any(node.op == "element" for node in nodes)
        if not self.whole and limit is not None and _size(nodes) <= limit:
            self.whole, self.limit = True, None
        if self.whole and limit is not None and _written(nodes, limit) > MANY:
            self.whole = False
        for node in nodes:
            if node.loop is None:
                self.known[node.id] = self.visit(node, [self.known[arg.id] for arg in node.reads])

    def visit_sum(self, node: Node, *_: Node) -> Node:
        loop, root = node.data, node.args[0]
        if not self.small(loop, [root]):
            return self.graph.sum(self.of_term([root], loop)[0], loop)
        first, *others = (term for (term,) in self.written_out([root], loop))
        return sum(others, first)

    def visit_element(self, node: Node, *_: Node) -> Node:
        stage, place = node.data
        if node.loop is None and self.whole:
            return self.values(stage)[place]
        return self.graph.element(self.stage(stage), place, node.loop)

    def stage(self, stage: Stage) -> Stage:
        """Return a stage whose loops stay loops, their nodes rewritten."""
        if stage not in self._stages:
            loops = []
            for loop, entries in stage.loops:
                inside = self.of_term([node for _, node in entries], loop)
                places = [place for place, _ in entries]
                loops.append((loop, tuple(zip(places, inside, strict=True))))
            terms = tuple((place, self.known[node.id]) for place, node in stage.terms)
            self._stages[stage] = self.graph.stage(stage.size, tuple(loops), terms)
        return self._stages[stage]

    def values(self, stage: Stage) -> list[Node]:
        """Return the values of a stage that is written out."""
        if stage not in self._values:
            chains: list[list[Node]] = [[] for _ in range(stage.size)]
            for loop, entries in stage.loops:
                places = [place.values(loop) for place, _ in entries]
                for k, nodes in enumerate(self.written_out([node for _, node in entries], loop)):
                    for place, node in zip(places, nodes, strict=True):
                        chains[int(place[k])].append(node)
            for place, node in stage.terms:
                chains[place].append(self.known[node.id])
            self._values[stage] = [_added(chain, self.graph) for chain in chains]
        return self._values[stage]

    def small(self, loop: Loop, roots: Sequence[Node]) -> bool:
        if not self.whole:
            return False
        # A root that does not vary in the loop still stands in each of its terms.
        operations = max(len(reachable(roots, loop)), len(roots))
        return self.limit is None or len(loop) * operations <= self.limit

    def written_out(self, roots: Sequence[Node], loop: Loop) -> list[list[Node]]:
        """Return the roots at every term of a loop."""
        term = _Term(self, roots, loop)
        return [term.written(k) for k in range(len(loop))]


class _Term(_Rewriting):
    """The nodes of a loop at one term of it after another."""

    def __init__(self, outside: _Expansion, roots: Sequence[Node], loop: Loop) -> None:
        super().__init__(outside.graph, outside.uses)
        self.known, self._values = outside.known, outside.values
        self._roots, self._loop, self._k = roots, loop, 0
        reads = (node for node in reachable(roots, loop) if node.op in READS)
        self._places = {node.id: node.place.values(loop).tolist() for node in reads}

    def written(self, k: int) -> list[Node]:
        """Return the roots at a term."""
        self._k = k
        return self.of_term(self._roots, self._loop)

    def visit_symbol(self, node: Node) -> Node:
        return self.graph.elsewhere(node, self._places[node.id][self._k], None)

    visit_index = visit_entry = visit_symbol

    def visit_element(self, node: Node, *_: Node) -> Node:
        return self._values(node.data[0])[self._places[node.id][self._k]]


def _added(chain: list[Node], graph: Graph) -> Node:
    return sum(chain[1:], chain[0]) if chain else graph.const(0.0)


def unrolled(function: Function) -> int:
    """Return how many operations a function is where all loops are written out."""
    added = sum(len(loop) * len(entries) for loop, entries in function.loops)
    return _size(reachable(function.roots)) + added + sum(map(len, function.outputs))


def _size(nodes: Sequence[Node]) -> int:
    """Return how many operations nodes are where all loops are written out."""
    total = 0
    for node in nodes:
        total += 1 if node.loop is None else len(node.loop)
    for stage in {node.data[0] for node in nodes if node.op == "element"}:
        total += sum(len(loop) * len(entries) for loop, entries in stage.loops) + len(stage.terms)
    return total


def _written(nodes: Sequence[Node], limit: int) -> int:
    """Return how many operations the small sums are together where they are written out."""
    sums = ((node.data, node.args) for node in nodes if node.op == "sum")
    each = (len(loop) * max(len(reachable(roots, loop)), 1) for loop, roots in sums)
    return sum(size for size in each if size <= limit)


def written_out(function: Function) -> list[Node]:
    """Return the outputs of a function as nodes, its declared sums written out; one without summands is 0."""
    expansion = _Expansion(function.graph, None, function.roots)
    terms_of: list[list[Node]] = [[] for _ in function.outputs]
    for loop, entries in function.loops:
        places = [entry.index.values(loop) for entry in entries]
        for k, nodes in enumerate(expansion.written_out([entry.node for entry in entries], loop)):
            for place, node in zip(places, nodes, strict=True):
                terms_of[int(place[k])].append(node)
    for nodes, terms in zip(terms_of, function.outputs, strict=True):
        nodes.extend(expansion.known[term.node.id] for term in terms)
    return [_added(nodes, function.graph) for nodes in terms_of]


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
    expansion = _Expansion(graph, limit, function.roots)

    chains: list[list[Term]] = [[] for _ in function.outputs]
    kept: list[tuple[Loop, list[LoopTerm]]] = []
    step = -1_000_000_000  # written-out loops come before the other summands
    for loop, entries in function.loops:
        roots = [entry.node for entry in entries]
        if not expansion.small(loop, roots):
            inside = expansion.of_term(roots, loop)
            kept.append((loop, [LoopTerm(e.index, n) for e, n in zip(entries, inside, strict=True)]))
            continue
        places = [entry.index.values(loop) for entry in entries]
        for k, nodes in enumerate(expansion.written_out(roots, loop)):
            for place, node in zip(places, nodes, strict=True):
                step += 1
                chains[int(place[k])].append(Term(node, step))
    for chain, terms in zip(chains, function.outputs, strict=True):
        chain.extend(Term(expansion.known[term.node.id], term.key) for term in terms)

    plan = Plan(len(chains))
    covered = _scatters(plan, kept)
    finals, hints = _chains(graph, chains, covered)
    _schedule(plan, finals, hints)
    return plan


def _scatters(plan: Plan, kept: Sequence[tuple[Loop, Sequence[LoopTerm]]]) -> set[int]:
    hits = np.zeros(plan.n_out, dtype=np.int64)
    for loop, entries in kept:
        for entry in entries:
            np.add.at(hits, entry.index.values(loop), 1)
    for loop, entries in kept:
        unique = tuple(bool((hits[entry.index.values(loop)] == 1).all()) for entry in entries)
        body = reachable([entry.node for entry in entries], loop)
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
    done: set[int | Stage] = set()
    captured = _captured(plan.scatters)

    def emit(roots: "Sequence[Node | Stage]", statements: list[Statement]) -> None:
        for root in roots:
            for node in _demanded(root, done):
                if isinstance(node, Stage):
                    statements.append(_filled(node))
                    continue
                if node.op == "sum":
                    statements.append(Reduce(node, node.data, tuple(reachable(node.args, node.data))))
                else:
                    statements.append(Let(node))
                for place in outputs.pop(node.id, ()):
                    statements.append(Store(place, node))

    if plan.scatters:
        # Sums first: they need an output that is not in use yet.
        captured += [n for n in reachable([node for _, node in finals]) if n.op == "sum" and n.loop is None]
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
            uses.update(arg.id for arg in statement.node.reads)
        elif isinstance(statement, Fill):
            for scatter in statement.scatters:
                _count_body(uses, scatter.body, [entry.node for entry in scatter.entries])
            uses.update(node.id for _, node, _ in statement.terms)
        elif isinstance(statement, Store):
            uses[statement.node.id] += 1
        else:
            _count_body(uses, statement.body, [statement.node.args[0]])
    for scatter in plan.scatters:
        _count_body(uses, scatter.body, [entry.node for entry in scatter.entries])


def _count_body(uses: Counter[int], body: Sequence[Node], roots: Sequence[Node]) -> None:
    for arg in [arg for node in body for arg in node.reads] + list(roots):
        # What a loop takes from outside is computed once, before the loop.
        uses[arg.id] += 1 if arg.loop is not None else 2


def _outside(body: Sequence[Node], roots: Sequence[Node]) -> "list[Node | Stage]":
    """Return what the terms of a loop take from outside."""
    needed: list[Node | Stage] = []
    for node in body:
        needed += [node.data[0]] if node.op == "element" else [arg for arg in node.args if arg.loop is None]
    return needed + [root for root in roots if root.loop is None]


def _captured(scatters: Sequence[Scatter]) -> "list[Node | Stage]":
    roots = [entry.node for scatter in scatters for entry in scatter.entries if entry.node.loop is None]
    bodies = [outer for scatter in scatters for outer in _outside(scatter.body, ())]
    return bodies + roots


def _filled(stage: Stage) -> Fill:
    plan = Plan(stage.size)
    covered = _scatters(
        plan, [(loop, [LoopTerm(place, node) for place, node in entries]) for loop, entries in stage.loops]
    )
    terms: list[tuple[int, Node, bool]] = []
    for place, node in stage.terms:
        terms.append((place, node, place in covered))
        covered.add(place)
    zeros = sorted({*plan.zeros, *(place for place in range(stage.size) if place not in covered)})
    return Fill(array_of(stage), stage.size, zeros, plan.scatters, terms)


def _needed(item: "Node | Stage") -> "Sequence[Node | Stage]":
    """Return what a value, or an array, is calculated from."""
    if isinstance(item, Stage):
        needed: list[Node | Stage] = []
        for loop, entries in item.loops:
            roots = [node for _, node in entries]
            needed += _outside(reachable(roots, loop), roots)
        return needed + [node for _, node in item.terms]
    if item.op == "element":
        return [item.data[0]]
    return _outside(reachable(item.args, item.data), item.args) if item.op == "sum" else item.args


def _demanded(root: "Node | Stage", done: "set[int | Stage]") -> "list[Node | Stage]":
    """Return what ``root`` needs and is not done yet, arguments first, depth first."""
    ordered: list[Node | Stage] = []
    stack: list[tuple[Node | Stage, bool]] = [(root, False)]
    while stack:
        item, ready = stack.pop()
        key = item if isinstance(item, Stage) else item.id
        if key in done:
            continue
        if ready:
            done.add(key)
            ordered.append(item)
            continue
        stack.append((item, True))
        stack.extend((arg, False) for arg in reversed(_needed(item)))
    return ordered
