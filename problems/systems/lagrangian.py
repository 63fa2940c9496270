"""Mechanical systems defined by a Lagrangian, from which the momenta and the Hamiltonian are derived."""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Annotated, Any

from problems.checks import NOTHING, Named, at_least, checked_arguments
from problems.derive.elimination import Elimination, ZeroPivotError, with_nodes
from problems.derive.function import Function
from problems.derive.gradient import gradient
from problems.errors import InputError
from problems.graph import arguments
from problems.graph.fold import Copy
from problems.graph.nodes import Node, P
from problems.graph.source_line import line_of_function
from problems.systems.base import System, Value
from problems.systems.hamiltonian import Hamiltonian


class Lagrangian(Hamiltonian):
    """A mechanical system defined by the Lagrangian L(q, v), kinetic minus potential energy.

    L is quadratic in the velocities, ``L = v.M(q, t) v/2 + A(q, t).v - V(q, t)``, written in any form.
    The momenta are ``p = M v + A`` and ``H = (p - A).M^-1 (p - A)/2 + V``, where M is factored symbolically
    as L D L^T: every method receives a `Hamiltonian` in q and p, and no linear system with M(q) is solved
    numerically.

    Parameters
    ----------
    L : callable
        The Lagrangian; its arguments are among ``t, q, v, par, m``. `m.sum` must not contain velocities.
    dof : int
        Degrees of freedom.
    parameters, guards, name
        As for `Hamiltonian`.
    invariants : mapping of str to callable
        As for `Hamiltonian`, of ``t, q, p, y, par, m``; the energy is H.

    Raises
    ------
    problems.errors.InputError
        If L is not quadratic in v as it is written, or does not depend on one of the velocities.

    Examples
    --------
    A pendulum on a cart, which starts from velocities:

    >>> from problems import Lagrangian, Problem
    >>> def L(q, v, m):
    ...     x, y = v[0] + m.cos(q[1])*v[1], m.sin(q[1])*v[1]
    ...     return v[0]**2 + (x**2 + y**2)/2 + m.cos(q[1])
    >>> cart = Problem(Lagrangian(L, dof=2), q0=[0.0, 1.0], v0=[0.1, 0.0], t_end=10.0)
    >>> cart.y0.round(3).tolist(), abs(cart.velocity(cart.y0).round(15)).tolist()
    ([0.0, 1.0, 0.3, 0.054], [[0.1, 0.0]])
    """

    @checked_arguments
    def __init__(
        self,
        L: Callable[..., Any],
        *,
        dof: Annotated[int, at_least(1)],
        parameters: Named[Value] = NOTHING,
        invariants: Named[Callable[..., Any]] = NOTHING,
        guards: Named[Callable[..., Any]] = NOTHING,
        name: str | None = None,
    ) -> None:
        System.__init__(self, L, 2 * dof, dof, parameters, invariants, guards, name)
        self._line = line_of_function(L)
        # In L the places of the momenta hold the velocities.
        value = arguments.call(L, graph=self._graph, dim=self.dim, layout=self._layout, label="L", second="v")
        lagrangian = self._node(value, L, "L")
        momenta = self._slopes(lagrangian)
        self._write("momentum", momenta)
        self._write_energy(self._eliminated(lagrangian, momenta))
        self._trace_declared(invariants, guards)

    def __repr__(self) -> str:
        return f"Lagrangian({self.name}, dof={self.dof})"

    @property
    def momentum(self) -> Function:
        """dL/dv, dof outputs; the velocities stand in the places of the momenta."""
        return self._written["momentum"]

    @cached_property
    def velocity(self) -> Function:
        """The velocities q' from positions and momenta, dof outputs."""
        return self.field.part(0, self.dim // 2).named("velocity")

    def _slopes(self, node: Node) -> list[Node]:
        """Return the derivatives with respect to the velocities."""
        dof = self.dim // 2
        whole = gradient(node, self.dim)
        for loop, entries in whole.loops:
            if any((entry.index.values(loop) >= dof).any() for entry in entries):
                raise InputError(
                    f"{self._line}: a velocity stands in m.sum; write the kinetic energy in Python, such as "
                    "sum(v[i]**2 for i in range(n)), or the system as a Hamiltonian."
                )
        slopes = []
        for terms in whole.outputs[dof:]:
            total = self._graph.const(0.0)
            for term in terms:
                total = total + term.node
            slopes.append(total)
        return slopes

    def _eliminated(self, lagrangian: Node, momenta: list[Node]) -> Node:
        """Return the Hamiltonian, in which the momenta take the places of the velocities."""
        graph, dof = self._graph, len(momenta)
        mass = [self._slopes(p) for p in momenta]
        if any(m.flags & P for row in mass for m in row):
            raise InputError(
                f"{self._line}: L is not quadratic in v as it is written; expand it, or give the Hamiltonian."
            )
        zero = graph.const(0.0)
        rest = [graph.symbol("y", dof + i, flags=P) - self._at_rest(p) for i, p in enumerate(momenta)]
        places = [(i, j) for i in range(dof) for j in range(i + 1) if mass[i][j] is not zero]
        try:
            solved = Elimination(
                {place: number for number, place in enumerate(places)},
                [mass[i][j] for i, j in places], rest, [[j] for j in range(dof)], with_nodes,
            ).forward()  # fmt: skip
        except ZeroPivotError as error:
            raise InputError(
                f"{self._line}: L does not depend on v[{error.row}] by itself; each needs a mass."
            ) from None
        kinetic = zero
        for z, pivot in solved.values():
            kinetic = kinetic + z * z / (2.0 * pivot)
        return kinetic - self._at_rest(lagrangian)

    def _at_rest(self, root: Node) -> Node:
        """Return a node where all velocities are 0."""
        return _AtRest(self._graph).of(root)


class _AtRest(Copy):
    """Nodes where all velocities are 0."""

    def visit(self, node: Node, results: Sequence[Node]) -> Node:
        return super().visit(node, results) if node.flags & P else node

    def visit_symbol(self, node: Node) -> Node:
        return self.graph.const(0.0)

    def visit_mul(self, node: Node, a: Node, b: Node) -> Node:
        zero = self.graph.const(0.0)
        return zero if a is zero or b is zero else a * b

    def visit_div(self, node: Node, a: Node, b: Node) -> Node:
        zero = self.graph.const(0.0)
        return zero if a is zero else a / b
