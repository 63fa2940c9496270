"""Reverse-mode differentiation of traced functions: products of weights with the derivatives.

With ``f(t, y, par)`` of m outputs and weights w_1 .. w_m one function gives all of

    sum_i w_i df_i/dy_j     or     sum_i w_i df_i/dpar_j

at a few times the cost of ``f``, however many variables or parameters there are. It is the gradient
(`problems.derive.gradient`) of the scalar ``sum_i w_i f_i``; a declared sum stays one.
"""

from typing import Literal

from problems.derive.function import Function
from problems.derive.gradient import gradient
from problems.graph.fold import Copy, shifted
from problems.graph.nodes import PAR, Graph, Node, Q, T

Variables = Literal["state", "parameters"]


def reverse(function: Function, *, variables: Variables, count: int, name: str) -> Function:
    """Return the products of weights with the derivatives of a function, a function itself.

    Parameters
    ----------
    function : Function
        Of t, of the state and of parameters.
    variables : {"state", "parameters"}
        What it is differentiated with respect to.
    count : int
        How many of these there are.
    name : str
        What generated code and messages call it.

    Returns
    -------
    Function
        One output for each variable. In ``y`` the weights come before the state; ``t`` and ``par`` are as
        they were. It has a graph of its own.

    Examples
    --------
    >>> import numpy as np, problems
    >>> from problems import targets
    >>> pendulum = problems.load("pendulum").system
    >>> product = reverse(pendulum.field, variables="state", count=2, name="product")
    >>> targets.numpy(pendulum, product)(
    ...     0.0, np.array([1.0, 2.0, 0.5, 0.0]), pendulum.pack()
    ... ).round(3).tolist()
    [-1.755, 1.0]
    """
    weights = len(function.outputs)
    copy = _Weighted(Graph(function.graph.dof), weights, variables)
    graph = copy.graph
    total = graph.const(0.0)
    for loop, entries in function.loops:
        inside = graph.loop(loop.rows)
        for entry in entries:
            weight = graph.symbol("y", entry.index, flags=PAR, loop=inside)
            total = total + graph.sum(weight * copy.of(entry.node), inside)
    for i, terms in enumerate(function.outputs):
        for term in terms:
            total = total + graph.symbol("y", i, flags=PAR) * copy.of(term.node)
    if variables == "state":
        return gradient(total, weights + count).part(weights, weights + count).named(name)
    return gradient(total, count).named(name)


class _Weighted(Copy):
    """Nodes on a graph where the state comes behind weights, and counts as such if it is to vary."""

    def __init__(self, graph: Graph, weights: int, variables: Variables):
        super().__init__(graph)
        self._weights = weights
        # What a gradient is taken with respect to has the flags of a state.
        self._flags = {"t": T, "y": Q, "par": PAR} if variables == "state" else {"t": T, "y": PAR, "par": Q}

    def visit_symbol(self, node: Node) -> Node:
        space, place = node.data
        place = shifted(place, self._weights) if space == "y" else place
        return self.graph.symbol(space, place, flags=self._flags[space], loop=self.loop(node.loop))
