"""Forward-mode differentiation of traced functions: derivatives along several directions at once.

With ``f(t, y, par)`` and directions (dy, dpar) one function gives, for each of them,

    sum_j df/dy_j dy_j + sum_j df/dpar_j dpar_j,

by the product and chain rules on every operation. A declared sum stays one, so the cost is a few
times that of ``f`` for each direction, whatever the number of variables, and what directions share,
such as the root of a distance, is computed once.
"""

from collections.abc import Callable, Sequence

from problems.derive.function import Function, renewed, stacked
from problems.graph.fold import Copy, Fold, shifted
from problems.graph.functions import FUNCTIONS, Slope
from problems.graph.loops import Stage
from problems.graph.nodes import PAR, STATE, Graph, Node


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
    >>> from problems import targets
    >>> pendulum = problems.load("pendulum").system
    >>> along = forward(pendulum.field, size=2, directions=1, name="tangent")
    >>> targets.numpy(pendulum, along)(0.0, np.array([1.0, 0.0, 0.5, 0.0]), pendulum.pack()).round(3).tolist()
    [0.0, -0.878]
    """
    values = _Behind(Graph(function.graph.dof), size * directions)
    parts = [_Tangent(values, size, parameters, direction).along(function) for direction in range(directions)]
    return stacked([*parts, *([values.function(function)] if beside else [])], name)


class _Behind(Copy):
    """Nodes where the state comes behind the directions."""

    def __init__(self, graph: Graph, shift: int):
        super().__init__(graph)
        self._shift = shift

    def visit_symbol(self, node: Node) -> Node:
        return self.moved(node, self._shift if node.data[0] == "y" else 0)

    def function(self, function: Function) -> Function:
        """Return a function of the new arguments."""
        return renewed(function, self.graph, self.of)

    def moved(self, node: Node, shift: int) -> Node:
        """Return a symbol whose place is moved."""
        space, place = node.data
        return self.graph.symbol(space, shifted(place, shift), flags=node.flags, loop=self.loop(node.loop))


class Slopes(Fold[Node | None]):
    """The derivatives of nodes along one direction; ``None`` where they are 0.

    Parameters
    ----------
    values : Copy
        The nodes in terms of the new arguments.
    active : int
        Flags of what varies.
    """

    def __init__(self, values: Copy, active: int):
        super().__init__()
        self.values, self.graph, self.active = values, values.graph, active
        self._stages: dict[Stage, Stage | None] = {}

    def of(self, root: Node) -> Node | None:
        self.values.of(root)
        return super().of(root)

    def along(self, function: Function) -> Function:
        """Return the derivatives of a function's outputs."""
        return renewed(function, self.graph, self.of)

    def at(self, node: Node) -> Node:
        """Return the value of a node."""
        return self.values.known[node.id]

    def visit(self, node: Node, results: Sequence[Node | None]) -> Node | None:
        return super().visit(node, results) if node.flags & self.active else None

    def visit_add(self, node: Node, a: Node | None, b: Node | None) -> Node | None:
        return _joined(self.graph.add, a, b)

    def visit_sub(self, node: Node, a: Node | None, b: Node | None) -> Node | None:
        return a if b is None else _joined(self.graph.sub, a, b, self.graph.neg)

    def visit_neg(self, node: Node, a: Node | None) -> Node | None:
        return None if a is None else self.graph.neg(a)

    def visit_mul(self, node: Node, a: Node | None, b: Node | None) -> Node | None:
        x, y = node.args
        if x is y:
            return None if a is None else 2.0 * self.at(x) * a
        left = None if a is None else a * self.at(y)
        right = None if b is None else self.at(x) * b
        return _joined(self.graph.add, left, right)

    def visit_div(self, node: Node, a: Node | None, b: Node | None) -> Node | None:
        below = None if b is None else self.at(node) * b
        top = a if below is None else _joined(self.graph.sub, a, below, self.graph.neg)
        return None if top is None else top / self.at(node.args[1])

    def visit_pow(self, node: Node, a: Node | None) -> Node | None:
        n = node.data
        return None if a is None else (n * self.graph.int_power(self.at(node.args[0]), n - 1)) * a

    def visit_where(self, node: Node, condition: Node | None, a: Node | None, b: Node | None) -> Node | None:
        if a is None and b is None:
            return None
        zero = self.graph.const(0.0)
        return self.graph.where(self.at(node.args[0]), *(zero if part is None else part for part in (a, b)))

    def visit_sum(self, node: Node, body: Node | None) -> Node | None:
        return None if body is None else self.graph.sum(body, self.graph.loop(node.data.rows))

    def visit_element(self, node: Node, *_: Node | None) -> Node | None:
        stage, place = node.data
        if stage not in self._stages:
            parts = stage.parts(lambda root: self.known[root.id], lambda loop: self.graph.loop(loop.rows))
            self._stages[stage] = self.graph.stage(stage.size, *parts) if any(parts) else None
        slope = self._stages[stage]
        return None if slope is None else self.graph.element(slope, place, self.values.loop(node.loop))

    def visit_table(self, node: Node, a: Node | None) -> Node | None:
        return None if a is None else self.graph.table(self.at(node.args[0]), node.data.slope()) * a

    def visit_operation(self, node: Node, *results: Node | None) -> Node | None:
        total = None
        slopes = FUNCTIONS[node.op].slopes(self.at(node))
        for slope, part in zip(slopes, results, strict=True):
            if part is not None and slope.factor != 0:
                total = _joined(self.graph.add, total, _times(slope, part))
        return total


class _Tangent(Slopes):
    """Derivatives along one of the directions that stand before the state, and behind the parameters."""

    def __init__(self, values: _Behind, size: int, parameters: int | None, direction: int):
        super().__init__(values, STATE | (0 if parameters is None else PAR))
        self._behind = values
        self._shifts = {"y": size * direction}
        if parameters is not None:
            self._shifts["par"] = parameters * (1 + direction)

    def visit_symbol(self, node: Node) -> Node | None:
        shift = self._shifts.get(node.data[0])
        return None if shift is None else self._behind.moved(node, shift)


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
