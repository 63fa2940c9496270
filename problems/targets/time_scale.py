r"""The time scale of a trajectory, from its formula.

For ``y' = f(y)`` with positions and momenta and the Jacobian J the matrix ``(J^2)_qq`` is, where
``q'' = a(q)``, the derivative of the accelerations. Its norm is the square of a rate, as long as forces are
not constant:

    w^4 = |(J^2)_qq|^2 + w_0^4,

with the Frobenius norm and a constant w_0. For Kepler's problem w is of the size of ``r^-3/2``.
"""

from problems.derive.forward import Slopes
from problems.derive.function import Function, function_of
from problems.graph.fold import Copy
from problems.graph.nodes import PAR, STATE, Node
from problems.targets.plan import written_out


def time_scale(field: Function, parameters: int) -> Function:
    """Return the fourth power of the rate of a field, and the rate of change of its logarithm.

    Parameters
    ----------
    field : Function
        Right-hand side for positions and momenta; not of the time. Its declared sums are written out.
    parameters : int
        Length of the parameter vector.

    Returns
    -------
    Function
        Two outputs, ``w^4`` and ``w'/w`` along the field; ``par`` holds the parameters, then ``w_0^4``.
    """
    graph, f = field.graph, written_out(field)
    dof, zero, unity = len(f) // 2, graph.const(0.0), graph.const(1.0)
    total = graph.symbol("par", parameters, flags=PAR)
    for j in range(dof):
        column = _along(f, _along(f, [unity if i == j else zero for i in range(2 * dof)]))
        for entry in column[:dof]:
            total = total + entry * entry
    (slope,) = _along([total], f)
    return function_of(graph, [total, slope / (4.0 * total)], "time_scale")


def _along(nodes: list[Node], directions: list[Node]) -> list[Node]:
    """Return the derivatives of nodes along a direction whose components are nodes of the same graph."""
    slopes = _Along(directions)
    zero = directions[0].graph.const(0.0)
    return [zero if (slope := slopes.of(node)) is None else slope for node in nodes]


class _Same(Copy):
    def of(self, root: Node) -> Node:
        return root


class _Along(Slopes):
    def __init__(self, directions: list[Node]):
        super().__init__(_Same(directions[0].graph), STATE)
        self._directions = directions

    def at(self, node: Node) -> Node:
        return node

    def visit_symbol(self, node: Node) -> Node | None:
        slope = self._directions[node.data[1]] if node.data[0] == "y" else None
        return None if slope is None or (slope.op == "const" and slope.data == 0.0) else slope
