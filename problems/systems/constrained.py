"""Mechanical systems with holonomic constraints, whose multipliers are eliminated symbolically."""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from problems.checks import NOTHING, Named, at_least, checked_arguments
from problems.derive.elimination import Elimination, ZeroPivotError, least_fill
from problems.derive.function import Function
from problems.derive.gradient import gradient
from problems.errors import InputError, shown
from problems.graph import arguments
from problems.graph.fold import Copy
from problems.graph.nodes import Graph, Node, P, T
from problems.graph.source_line import line_of_function
from problems.systems.base import System, Value
from problems.systems.hamiltonian import Hamiltonian
from problems.systems.lagrangian import Lagrangian

Array = NDArray[np.float64]
Row = dict[int, Node]


class Constrained(System):
    r"""A mechanical system with holonomic constraints g(q) = 0.

    With the energy H(q, p), u = dH/dp and the Jacobian G = dg/dq,

    .. math::

        q' = u, \qquad p' = -\frac{\partial H}{\partial q} + f - G^T \lambda, \qquad g(q) = 0.

    The multipliers follow from g'' = 0: with the velocity of the constraints w(q, p) = G u,

    .. math::

        \frac{\partial w}{\partial p} G^T \lambda = \frac{\partial w}{\partial q} u
            + \frac{\partial w}{\partial p} \Big( f - \frac{\partial H}{\partial q} \Big),

    whose symmetric matrix :math:`G (\partial^2 H / \partial p^2) G^T` is factored symbolically, without the
    zeros between constraints that share no coordinate: a chain costs O(n). With these multipliers q' and p'
    are an ordinary system (of index 0). On the manifold g = 0, w = 0 its invariants are the energy,
    ``"constraints"`` (all g) and ``"constraint_rates"`` (all w). `integrators.HBVM` conserves them at
    round-off.

    Parameters
    ----------
    H : callable, Hamiltonian or Lagrangian
        The energy, a function as for `Hamiltonian`; or a system without constraints, whose ``dof`` and
        ``parameters`` are taken.
    constraints : sequence of callable
        Functions g whose arguments are among ``q, par, m``. Each returns one number or a list.
    dof : int, optional
        Number of coordinates q.
    parameters, guards, name
        As for `Hamiltonian`.
    invariants : mapping of str to callable
        Quantities that are conserved besides.
    force : callable, optional
        Forces f beside those of H, such as friction, a list of ``dof`` numbers; arguments among ``t, q, p, y,
        par, m``. The energy is then no invariant.

    Raises
    ------
    problems.errors.InputError
        For constraints that depend on momenta or on the time, and those that depend on no coordinate that can
        be accelerated.

    Notes
    -----
    A constraint that moves, g(q, t) = 0, is one with the time as a further coordinate:
    ``H + p[n]`` with ``q[n]`` for t. Then ``p[n]`` is the energy that the motion has put in.

    References
    ----------
    E. Hairer, C. Lubich, G. Wanner, *Geometric Numerical Integration*, Springer 2006, section VII.1.

    Examples
    --------
    A pendulum of length 1, in Cartesian coordinates:

    >>> from problems import Constrained, Problem
    >>> def H(q, p):
    ...     return (p[0]**2 + p[1]**2)/2 + q[1]
    >>> def rod(q):
    ...     return (q[0]**2 + q[1]**2 - 1)/2
    >>> pendulum = Constrained(H, constraints=[rod], dof=2)
    >>> Problem(pendulum, q0=[1.0, 0.0], p0=[0.0, 0.0], t_end=10.0).errors([[0.0, -1.0, 1.0, 0.0]])["energy"]
    array([0.33333333])
    """

    kind = "vector_field"
    on_manifold: ClassVar[frozenset[str]] = frozenset({"energy", "constraints"})
    derived: ClassVar[frozenset[str]] = on_manifold | {"constraint_rates"}

    @checked_arguments
    def __init__(
        self,
        H: Callable[..., Any] | Hamiltonian,
        *,
        constraints: Sequence[Callable[..., Any]],
        dof: Annotated[int, at_least(1)] | None = None,
        parameters: Named[Value] = NOTHING,
        invariants: Named[Callable[..., Any]] = NOTHING,
        guards: Named[Callable[..., Any]] = NOTHING,
        force: Callable[..., Any] | None = None,
        name: str | None = None,
    ) -> None:
        if isinstance(H, Hamiltonian):
            if dof is not None or parameters:
                raise InputError(f"leave out dof= and parameters=: they are those of {H.name}.")
            free = H
        elif dof is None:
            raise InputError("Constrained needs dof=, the number of coordinates.")
        else:
            free = Hamiltonian(H, dof=dof, parameters=parameters, name=name)
        taken = {"energy", "constraints", "constraint_rates"} & set(invariants)
        if taken:
            raise InputError(f"the invariant {sorted(taken)[0]!r} is there by itself; give the others only.")
        assert free.dof is not None
        super().__init__(
            repr, free.dim, free.dof, free.parameters, invariants, guards, name or free.name
        )  # fmt: skip
        self._graph = free._graph
        for key in ("hamiltonian", "momentum"):
            if key in free._written:
                self._written[key] = free._written[key]
        self._eliminate(self._traced_constraints(constraints), None if force is None else self._forces(force))
        self._trace_declared(invariants, guards)
        of_energy = ["energy"] if "invariant:energy" in self._written else []
        self._list([*of_energy, "constraints", "constraint_rates", *invariants], guards)

    def __repr__(self) -> str:
        return f"Constrained({self.name}, dof={self.dof})"

    @property
    def energy(self) -> Function | None:
        """``None``: the energy is an invariant on the manifold only, by name."""
        return None

    @property
    def multipliers(self) -> Function:
        """The multipliers lambda from t, q, p, one output for each constraint."""
        return self._written["multipliers"]

    @cached_property
    def free(self) -> Hamiltonian:
        """The same system without constraints and further forces."""
        free = object.__new__(Lagrangian if "momentum" in self._written else Hamiltonian)
        vars(free).update({key: value for key, value in vars(self).items() if key in _SHARED})
        free._written = {k: self._written[k] for k in ("hamiltonian", "momentum") if k in self._written}
        free._vectors = set()
        free._start_memories()
        free._list([], [])
        return free

    def _offered(self, graph: Graph) -> dict[str, Callable[[], Any]]:
        copy = Copy(graph)
        return {"multipliers": lambda: [copy.of(root) for root in self.multipliers.roots]}

    def _traced_constraints(self, constraints: Sequence[Callable[..., Any]]) -> list[tuple[str, Node]]:
        if (
            not isinstance(constraints, list | tuple)
            or not constraints
            or not all(map(callable, constraints))
        ):
            raise InputError(
                f"constraints={shown(constraints)} must be a list of functions, such as constraints=[rod]."
            )
        found = []
        for i, function in enumerate(constraints):
            label = f"constraints[{i}]"
            value = self._call(function, label)
            values = value if arguments.is_list(value) else [value]
            for part in values:
                node = self._node(part, function, label)
                if node.flags & (P | T):
                    raise InputError(
                        f"{line_of_function(function)}: a constraint depends on "
                        + (
                            "momenta; it must be a function of q."
                            if node.flags & P
                            else "the time; take the time as a further coordinate q[n], with H + p[n]."
                        )
                    )
                found.append((line_of_function(function), node))
        return found

    def _forces(self, force: Callable[..., Any]) -> list[Node]:
        value, dof = self._call(force, "force"), self.dim // 2
        if not arguments.is_list(value) or len(value) != dof:
            raise InputError(f"{line_of_function(force)}: force must return a list of dof={dof} numbers.")
        return [self._node(part, force, "force") for part in value]

    def _slopes(self, node: Node) -> Row:
        """Return the derivatives that are not 0, by the component of the state."""
        whole = gradient(node, self.dim)
        if whole.loops:
            raise InputError(
                f"{self.name}: with constraints the energy and the constraints are written without m.sum; "
                "use sum(... for i in range(n))."
            )
        found: Row = {}
        for i, terms in enumerate(whole.outputs):
            for term in terms:
                found[i] = found[i] + term.node if i in found else term.node
        return found

    def _eliminate(self, constraints: list[tuple[str, Node]], force: list[Node] | None) -> None:
        """Write the field, the multipliers and the invariants."""
        graph, dof = self._graph, self.dim // 2
        zero = graph.const(0.0)
        [energy] = self._written["hamiltonian"].roots
        slope = self._slopes(energy)
        speed = {i - dof: node for i, node in slope.items() if i >= dof}
        push = {i: -node for i, node in slope.items() if i < dof}
        for i, node in enumerate(force or ()):
            push[i] = push[i] + node if i in push else node
        rows, rates = [], []
        for line, node in constraints:
            row = self._slopes(node)
            rate = _product(row, speed)
            if rate is None:
                raise InputError(f"{line}: a constraint depends on no coordinate that moves; leave it out.")
            if rate.flags & T:
                raise InputError(
                    f"{line}: the velocities depend on the time; take it as a further coordinate q[n], with "
                    "H + p[n]."
                )
            rows.append(row)
            rates.append(rate)
        turns = [self._slopes(rate) for rate in rates]
        by_speed = [{i - dof: node for i, node in turn.items() if i >= dof} for turn in turns]
        n = len(rows)
        matrix = {
            (a, b): node
            for a in range(n)
            for b in range(a + 1)
            if (node := _product(by_speed[a], rows[b])) is not None
        }
        order = least_fill([{b for b in range(n) if (max(a, b), min(a, b)) in matrix} for a in range(n)])
        right = []
        for a in order:
            along = {i: node for i, node in turns[a].items() if i < dof}
            first, second = _product(along, speed), _product(by_speed[a], push)
            terms = [term for term in (first, second) if term is not None]
            right.append(sum(terms[1:], terms[0]) if terms else zero)
        ordered = [
            {
                j: matrix[max(a, b), min(a, b)]
                for j, b in enumerate(order[: i + 1])
                if (max(a, b), min(a, b)) in matrix
            }
            for i, a in enumerate(order)
        ]
        try:
            solved = Elimination(ordered).solve(right)
        except ZeroPivotError as error:
            raise InputError(
                f"{constraints[order[error.row]][0]}: the constraint follows from the others, or moves "
                "nothing with a mass; leave it out."
            ) from None
        multipliers = [solved[order.index(a)] for a in range(n)]
        slopes = [push.get(i, zero) for i in range(dof)]
        for row, multiplier in zip(rows, multipliers, strict=True):
            for i, node in row.items():
                slopes[i] = slopes[i] - node * multiplier
        self._write("field", [*(speed.get(i, zero) for i in range(dof)), *slopes])
        self._write("multipliers", multipliers)
        self._write("invariant:constraints", [node for _, node in constraints])
        self._write("invariant:constraint_rates", rates)
        self._vectors |= {"constraints", "constraint_rates"}
        if force is None and not energy.flags & T:
            self._write("invariant:energy", [energy])


_SHARED = ("name", "dim", "dof", "bodies", "parameters", "_layout", "n_par", "_graph")
"""What `Constrained.free` has of it."""


def _product(a: Row, b: Row) -> Node | None:
    """Return the sum of the products of entries that both have; ``None`` if there are none."""
    total: Node | None = None
    for i, node in a.items():
        if i in b:
            term = node * b[i]
            total = term if total is None else total + term
    return total
