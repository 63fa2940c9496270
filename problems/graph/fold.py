"""One walk over a graph: what differentiates, evaluates, analyses and prints are subclasses of it."""

from collections.abc import Sequence
from typing import Any, Generic, TypeVar

from problems.graph.loops import Affine, Loop, Stage
from problems.graph.nodes import Graph, Node, reachable

R = TypeVar("R")


class Visitor(Generic[R]):
    """What is done with an operation.

    A subclass has a method ``visit_NAME(node, *results)`` for the operations that it treats in its own way,
    and `visit_operation` for all others.
    """

    def visit(self, node: Node, results: Sequence[Any]) -> R:
        """Return the result of a node, from those of its arguments or what else the operations are given."""
        return getattr(self, f"visit_{node.op}", self.visit_operation)(node, *results)

    def visit_operation(self, node: Node, *results: Any) -> R:
        """Return the result of an operation that has no method of its own."""
        raise NotImplementedError(f"{type(self).__name__} has no {node.op}")


class Fold(Visitor[R]):
    """A result for each node, made of the results of its arguments: each is visited once, after these.

    Attributes
    ----------
    known : dict of int to result
        By number of the node.
    """

    def __init__(self) -> None:
        self.known: dict[int, R] = {}

    def arguments(self, node: Node) -> Sequence[Node]:
        """Return the nodes that the result of one is made of."""
        return node.args

    def of(self, root: Node) -> R:
        """Return the result of a node."""
        for node in reachable([root], arguments=self.arguments):
            if node.id not in self.known:
                self.known[node.id] = self.visit(node, [self.known[arg.id] for arg in self.arguments(node)])
        return self.known[root.id]

    def of_term(self, roots: Sequence[Node], loop: Loop) -> list[R]:
        """Return the results of nodes in a loop, where those of what stands outside are known."""
        body: dict[int, R] = {}
        for node in reachable(roots, loop):
            results = [body[arg.id] if arg.id in body else self.known[arg.id] for arg in node.reads]
            body[node.id] = self.visit(node, results)
        return [body[root.id] if root.id in body else self.known[root.id] for root in roots]


class Copy(Fold[Node]):
    """The same operations on other arguments, on a graph that may be another one.

    A subclass says what becomes of the symbols.
    """

    def __init__(self, graph: Graph) -> None:
        super().__init__()
        self.graph = graph
        self._stages: dict[Stage, Stage] = {}

    def visit_const(self, node: Node) -> Node:
        return self.graph.const(node.data)

    def visit_symbol(self, node: Node) -> Node:
        space, place = node.data
        return self.graph.symbol(space, place, flags=node.flags, loop=self.loop(node.loop))

    def visit_index(self, node: Node) -> Node:
        loop = self.loop(node.loop)
        assert loop is not None
        return self.graph.index(node.data, loop)

    def visit_entry(self, node: Node) -> Node:
        constants, place = node.data
        return self.graph.entry(self.graph.constants(constants.values), place, self.loop(node.loop))

    def visit_element(self, node: Node, *_: Node) -> Node:
        stage, place = node.data
        return self.graph.element(self.stage(stage), place, self.loop(node.loop))

    def stage(self, stage: Stage) -> Stage:
        """Return the stage that takes the place of one."""
        if stage not in self._stages:
            parts = stage.parts(lambda root: self.known[root.id], lambda loop: self.graph.loop(loop.rows))
            self._stages[stage] = self.graph.stage(stage.size, *parts)
        return self._stages[stage]

    def visit_sum(self, node: Node, body: Node) -> Node:
        loop = self.loop(node.data)
        assert loop is not None
        return self.graph.sum(body, loop)

    def visit_operation(self, node: Node, *results: Node) -> Node:
        return self.graph.apply(node, results)

    def loop(self, loop: Loop | None) -> Loop | None:
        """Return the loop that takes the place of one."""
        return None if loop is None else self.graph.loop(loop.rows)


def shifted(place: int | Affine, shift: int) -> int | Affine:
    """Return the place of a symbol plus a constant."""
    return place.shifted(shift) if isinstance(place, Affine) else place + shift
