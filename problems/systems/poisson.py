"""Poisson systems y' = B(y) grad H(y), with a skew-symmetric structure matrix B."""

from collections.abc import Callable
from typing import Annotated, Any

from problems.checks import NOTHING, Named, at_least, checked_arguments
from problems.derive.function import Function
from problems.derive.gradient import gradient
from problems.derive.opposite import opposite
from problems.errors import InputError
from problems.graph import arguments
from problems.graph.nodes import Node
from problems.graph.source_line import line_of_function
from problems.systems.base import System, Value


class Poisson(System):
    """A system y' = B(y) grad H(y), which conserves its energy H and the Casimirs of B.

    Parameters
    ----------
    H : callable
        The energy; its arguments are among ``y, par, m`` (and ``t``, but then the energy is not conserved).
        Use Python's sums: `m.sum` is for canonical systems.
    B : callable
        Returns the structure matrix, dim lists of dim entries, with ``B[j][i]`` written as ``-B[i][j]``
        or so that this can be seen, as ``1/x`` and ``-1/x``, ``x - y`` and ``y - x``; arguments as for ``H``.
    dim : int
        Length of the state.
    parameters, guards, name
        As for `Hamiltonian`.
    invariants : mapping of str to callable
        Quantities conserved besides the energy, such as the Casimirs of B.

    Raises
    ------
    problems.errors.InputError
        If B does not have the right shape or is not written as a skew-symmetric matrix.

    Examples
    --------
    The rigid body:

    >>> from problems import Poisson
    >>> def H(y):
    ...     return (y[0]**2/2 + y[1]**2 + 3*y[2]**2/2)/2
    >>> def B(y):
    ...     return [[0, -y[2], y[1]], [y[2], 0, -y[0]], [-y[1], y[0], 0]]
    >>> Poisson(H, B, dim=3)
    Poisson(H, dim=3)
    """

    kind = "poisson"

    @checked_arguments
    def __init__(
        self,
        H: Callable[..., Any],
        B: Callable[..., Any],
        *,
        dim: Annotated[int, at_least(1)],
        parameters: Named[Value] = NOTHING,
        invariants: Named[Callable[..., Any]] = NOTHING,
        guards: Named[Callable[..., Any]] = NOTHING,
        name: str | None = None,
    ) -> None:
        super().__init__(H, dim, None, parameters, invariants, guards, name)
        energy = self._scalar(H, "H")
        self._write_energy(energy)
        slope = self._energy_slope(energy, H)
        matrix = self._matrix(B)
        self._write("gradient", slope)
        self._write("structure", [b for row in matrix for b in row])
        self._write("field", [_product(row, slope) for row in matrix])
        self._trace_declared(invariants, guards)

    def __repr__(self) -> str:
        return f"Poisson({self.name}, dim={self.dim})"

    @property
    def slope(self) -> Function:
        """Grad H, dim outputs."""
        return self._written["gradient"]

    @property
    def structure(self) -> Function:
        """B row by row, dim*dim outputs."""
        return self._written["structure"]

    def _energy_slope(self, energy: Node, H: Callable[..., Any]) -> list[Node]:
        slopes = gradient(energy, self.dim)
        if slopes.loops:
            raise InputError(
                f"{line_of_function(H)}: H of a Poisson system uses m.sum; write the sum in Python, "
                "such as sum(y[i]**2 for i in range(n))."
            )
        slope = []
        for terms in slopes.outputs:
            total = self._graph.const(0.0)
            for term in terms:
                total = total + term.node
            slope.append(total)
        return slope

    def _matrix(self, B: Callable[..., Any]) -> list[list[Node]]:
        rows = self._call(B, "B")
        line = line_of_function(B)
        if (
            not arguments.is_list(rows)
            or len(rows) != self.dim
            or not all(arguments.is_list(row) and len(row) == self.dim for row in rows)
        ):
            raise InputError(f"{line}: B must return {self.dim} lists of {self.dim} entries.")
        matrix = [
            [self._node(b, B, f"B's entry [{i}][{j}]") for j, b in enumerate(row)]
            for i, row in enumerate(rows)
        ]
        places = [(i, j) for i in range(self.dim) for j in range(i + 1)]
        skew = opposite((matrix[i][j], matrix[j][i]) for i, j in places)
        for i, j in (place for place, is_skew in zip(places, skew, strict=True) if not is_skew):
            raise InputError(
                f"{line}: B is not skew-symmetric as it is written: [{i}][{j}] is not minus "
                f"[{j}][{i}]; write the one as minus the other, and 0 on the diagonal."
            )
        return matrix


def _product(row: list[Node], slope: list[Node]) -> Node:
    """Return sum_j row_j slope_j, in the order of j, without the zeros."""
    total: Node | None = None
    for b, d in zip(row, slope, strict=True):
        if any(node.op == "const" and node.data == 0.0 for node in (b, d)):
            continue
        total = b * d if total is None else total + b * d
    return row[0].graph.const(0.0) if total is None else total
