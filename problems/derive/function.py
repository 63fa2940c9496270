"""Vector functions on a graph: what is differentiated, emitted and evaluated."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from problems.graph.each import Each
from problems.graph.nodes import Affine, Graph, Loop, Node


@dataclass(frozen=True, eq=False)
class Term:
    """A summand of one output.

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
    """A summand of many outputs: ``node`` is added at ``index`` for each term of a loop."""

    index: Affine
    node: Node


Loops = tuple[tuple[Loop, tuple[LoopTerm, ...]], ...]
"""Summands that stand in loops, loop by loop."""


@dataclass(frozen=True, eq=False)
class Function:
    """Outputs, each a chain of summands that are added left to right; equal to itself only.

    Attributes
    ----------
    graph : Graph
        Where the nodes live.
    outputs : tuple of tuple of Term
        The summands of each output, in order; none: the output is 0.
    loops : tuple of (Loop, tuple of LoopTerm)
        Summands in loops, by place of the output; they come before the others.
    name : str
        What generated code and messages call it, such as ``"field"`` or ``"invariant:energy"``.
    """

    graph: Graph
    outputs: tuple[tuple[Term, ...], ...]
    loops: Loops = ()
    name: str = ""

    @property
    def roots(self) -> list[Node]:
        """The values of all summands."""
        return [term.node for terms in self.outputs for term in terms] + [
            entry.node for _, entries in self.loops for entry in entries
        ]

    def named(self, name: str) -> "Function":
        """Return the same function under a name."""
        return Function(self.graph, self.outputs, self.loops, name)

    def part(self, low: int, high: int) -> "Function":
        """Return the outputs low to high - 1; no summand in a loop may belong to others as well."""
        loops: list[tuple[Loop, tuple[LoopTerm, ...]]] = []
        for loop, entries in self.loops:
            inside = tuple(
                LoopTerm(entry.index.shifted(-low), entry.node)
                for entry in entries
                if low <= int(entry.index.values(loop)[0]) < high
            )
            if inside:
                loops.append((loop, inside))
        return Function(self.graph, self.outputs[low:high], tuple(loops))

    def plain(self) -> list[Any]:
        """Return the outputs as lists of numbers; nodes and loops by their numbers in the graph."""
        return [
            [[[term.node.id, term.key] for term in terms] for terms in self.outputs],
            [
                [loop.id, [[list(e.index.coefficients), e.index.offset, e.node.id] for e in entries]]
                for loop, entries in self.loops
            ],
        ]

    @classmethod
    def of_plain(cls, graph: Graph, plain: Sequence[Any], name: str) -> "Function":
        """Return the function that `plain` was returned by, on the same graph or one like it."""
        nodes, loops = graph.nodes, graph.loops
        outputs = tuple(tuple(Term(nodes[i], key) for i, key in terms) for terms in plain[0])
        return cls(
            graph,
            outputs,
            tuple(
                (loops[i], tuple(LoopTerm(Affine(tuple(c), offset), nodes[n]) for c, offset, n in entries))
                for i, entries in plain[1]
            ),
            name,
        )

    def __neg__(self) -> "Function":
        return renewed(self, self.graph, lambda node: -node).named("")


def function_of(graph: Graph, nodes: Iterable[Node], name: str = "") -> Function:
    """Return the function whose outputs are ``nodes``."""
    return Function(graph, tuple((Term(node, node.id),) for node in nodes), name=name)


def renewed(function: Function, graph: Graph, change: Callable[[Node], Node | None]) -> Function:
    """Return a function with other summands, those left out for which there is ``None``."""
    outputs = tuple(
        tuple(Term(node, term.key) for term in terms if (node := change(term.node)) is not None)
        for terms in function.outputs
    )
    loops = (
        (
            graph.loop(loop.rows),
            tuple(LoopTerm(e.index, node) for e in entries if (node := change(e.node)) is not None),
        )
        for loop, entries in function.loops
    )
    return Function(graph, outputs, tuple(part for part in loops if part[1]), function.name)


def stacked(functions: Sequence[Function], name: str = "") -> Function:
    """Return one function with the outputs of all, in order; what they share is computed once.

    Its name is ``name``, or that of all of them.
    """
    outputs: list[tuple[Term, ...]] = []
    moved: list[tuple[int, Loops]] = []
    for function in functions:
        moved.append((len(outputs), function.loops))
        outputs.extend(function.outputs)
    name = name or ", ".join(function.name for function in functions)
    return Function(functions[0].graph, tuple(outputs), joined(moved), name)


def array(function: Function) -> Each:
    """Return the outputs of a function as an array that loops may read."""
    loops = tuple((loop, tuple((e.index, e.node) for e in part)) for loop, part in function.loops)
    terms = tuple((i, term.node) for i, summands in enumerate(function.outputs) for term in summands)
    return Each(function.graph, len(function.outputs), loops, terms)


def joined(parts: Iterable[tuple[int, Loops]]) -> Loops:
    """Join summands in loops, each part moved by some places, so that each loop runs once."""
    entries_of: dict[Loop, list[LoopTerm]] = {}
    for shift, loops in parts:
        for loop, entries in loops:
            moved = (LoopTerm(entry.index.shifted(shift), entry.node) for entry in entries)
            entries_of.setdefault(loop, []).extend(moved)
    return tuple((loop, tuple(entries)) for loop, entries in entries_of.items())
