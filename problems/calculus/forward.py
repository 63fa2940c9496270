"""Forward-mode differentiation of traced functions: derivatives along several directions at once.

With ``f(t, y, par)`` and directions (dy, dpar) one function gives, for each of them,

    sum_j df/dy_j dy_j + sum_j df/dpar_j dpar_j,

by the product and chain rules on every operation. A declared sum stays one, so the cost is a few
times that of ``f`` for each direction, whatever the number of variables, and what directions share,
such as the root of a distance, is computed once.
"""

from collections.abc import Callable

from problems.calculus.function import Function, LoopTerm, Term
from problems.trace.functions import FUNCTIONS, Slope
from problems.trace.graph import PAR, STATE, Affine, Graph, Loop, Node, reachable


def forward(
    function: Function, *, size: int, directions: int, parameters: int | None = None, name: str,
    beside: bool = False,
) -> Function:  # fmt: skip
    """Return the derivatives of a function along directions, a function itself.

    Parameters
    ----------
    function : Function
        Of t, of ``size`` components of the state, and of parameters.
    size : int
        Components of the state that it depends on.
    directions : int
        Their number, n >= 1.
    parameters : int, optional
        Length of the parameter vector, where directions have a part in it; by default they have none.
    name : str
        What generated code and messages call it.
    beside : bool
        Whether the outputs of ``function`` itself are to follow those of the derivatives.

    Returns
    -------
    Function
        The outputs of ``function`` for the first direction, then for the second, and so on. The arguments:
        ``y`` holds the directions' parts in the state, one after another, then the state; ``par`` the
        parameters, then the directions' parts in these, one after another. It has a graph of its own: these
        are not the system's arguments.

    Examples
    --------
    >>> import numpy as np, problems
    >>> from problems import emit
    >>> pendulum = problems.load("pendulum").system
    >>> along = forward(pendulum.field, size=2, directions=1, name="tangent")
    >>> emit.numpy(pendulum, along)(0.0, np.array([1.0, 0.0, 0.5, 0.0]), pendulum.pack()).round(3).tolist()
    [0.0, -0.878]
    """
    rule = Rule(Graph(function.graph.dof), size, directions, parameters)
    outputs = len(function.outputs)
    products: list[tuple[Term, ...]] = [()] * (outputs * directions)
    for i, terms in enumerate(function.outputs):
        for direction in range(directions):
            products[outputs * direction + i] = tuple(
                Term(node, term.key)
                for term in terms
                if (node := rule.slope(term.node, direction)) is not None
            )
    if beside:
        products += [
            tuple(Term(rule.value(term.node), term.key) for term in terms) for terms in function.outputs
        ]
    loops: list[tuple[Loop, tuple[LoopTerm, ...]]] = []
    for loop, entries in function.loops:
        moved: list[LoopTerm] = []
        for direction in range(directions):
            for entry in entries:
                node = rule.slope(entry.node, direction)
                if node is not None:
                    moved.append(LoopTerm(entry.index.shifted(outputs * direction), node))
        if beside:
            moved += [
                LoopTerm(entry.index.shifted(outputs * directions), rule.value(entry.node))
                for entry in entries
            ]
        if moved:
            loops.append((rule.graph.loop(loop.rows), tuple(moved)))
    return Function(rule.graph, tuple(products), tuple(loops), name)


class Rule:
    """The values of nodes where the state comes behind the directions, and their derivatives."""

    def __init__(self, graph: Graph, size: int, directions: int, parameters: int | None):
        self.graph, self.size, self.directions, self.parameters = graph, size, directions, parameters
        self.active = STATE | (0 if parameters is None else PAR)
        self.values: dict[int, Node] = {}
        self.slopes: dict[tuple[int, int], Node | None] = {}

    def value(self, root: Node) -> Node:
        """Return a node in terms of the new arguments."""
        for node in reachable([root]):
            if node.id not in self.values:
                self.values[node.id] = self._value(node)
        return self.values[root.id]

    def _value(self, node: Node) -> Node:
        graph = self.graph
        match node.op:
            case "const":
                return graph.const(node.data)
            case "symbol":
                return self._symbol(node, self.size * self.directions if node.data[0] == "y" else 0)
            case "index":
                assert node.loop is not None
                return graph.index(node.data, graph.loop(node.loop.rows))
            case "sum":
                return graph.sum(self.values[node.args[0].id], graph.loop(node.data.rows))
        return graph.apply(node, tuple(self.values[arg.id] for arg in node.args))

    def slope(self, root: Node, direction: int) -> Node | None:
        """Return the derivative of a node along a direction; ``None`` where it is 0."""
        self.value(root)
        for node in reachable([root]):
            if (node.id, direction) not in self.slopes:
                self.slopes[node.id, direction] = self._slope(node, direction)
        return self.slopes[root.id, direction]

    def _symbol(self, node: Node, shift: int) -> Node:
        """Return a symbol whose place is moved."""
        space, place = node.data
        if shift:
            place = place.shifted(shift) if isinstance(place, Affine) else place + shift
        loop = None if node.loop is None else self.graph.loop(node.loop.rows)
        return self.graph.symbol(space, place, flags=node.flags, loop=loop)

    def _slope(self, node: Node, direction: int) -> Node | None:
        if not node.flags & self.active or node.op in ("const", "index"):
            return None
        graph, along = self.graph, [self.slopes[arg.id, direction] for arg in node.args]
        at = [self.values[arg.id] for arg in node.args]
        match node.op:
            case "symbol":
                if node.data[0] == "y":
                    return self._symbol(node, self.size * direction)
                if node.data[0] == "par" and self.parameters is not None:
                    return self._symbol(node, self.parameters * (1 + direction))
                return None
            case "add":
                return _joined(graph.add, along[0], along[1])
            case "sub":
                return along[0] if along[1] is None else _joined(graph.sub, along[0], along[1], graph.neg)
            case "neg":
                return None if along[0] is None else graph.neg(along[0])
            case "mul" if node.args[0] is node.args[1]:
                return None if along[0] is None else 2.0 * at[0] * along[0]
            case "mul":
                left = None if along[0] is None else along[0] * at[1]
                right = None if along[1] is None else at[0] * along[1]
                return _joined(graph.add, left, right)
            case "div":
                below = None if along[1] is None else self.values[node.id] * along[1]
                top = along[0] if below is None else _joined(graph.sub, along[0], below, graph.neg)
                return None if top is None else top / at[1]
            case "pow":
                n = node.data
                return None if along[0] is None else (n * graph.int_power(at[0], n - 1)) * along[0]
            case "where":
                if along[1] is None and along[2] is None:
                    return None
                zero = graph.const(0.0)
                return graph.where(at[0], *(zero if part is None else part for part in along[1:]))
            case "sum":
                return None if along[0] is None else graph.sum(along[0], graph.loop(node.data.rows))
            case "table":
                return None if along[0] is None else graph.table(at[0], node.data.slope()) * along[0]
        total = None
        slopes = FUNCTIONS[node.op].slopes(self.values[node.id])
        for slope, part in zip(slopes, along, strict=True):
            if part is not None and slope.factor != 0:
                total = _joined(graph.add, total, _times(slope, part))
        return total


def _joined(
    operation: Callable[[Node, Node], Node],
    a: Node | None,
    b: Node | None,
    alone: Callable[[Node], Node] | None = None,
) -> Node | None:
    """Return an operation on two nodes of which ``None`` is 0; ``alone`` is what it makes of the second."""
    if b is None:
        return a
    if a is None:
        return b if alone is None else alone(b)
    return operation(a, b)


def _times(slope: Slope, part: Node) -> Node:
    """Return a derivative times a number."""
    value = part if slope.times is None else slope.times * part
    value = value if slope.factor == 1 else float(slope.factor) * value
    return value if slope.over is None else value / slope.over
