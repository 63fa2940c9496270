"""Mechanical systems with holonomic constraints, whose multipliers are formulas."""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from problems.checks import NOTHING, Named, at_least, checked_arguments
from problems.derive.elimination import ZeroPivotError
from problems.derive.function import Function, array, joined, stacked
from problems.derive.jacobian import Jacobian
from problems.derive.multipliers import Motion, entries, places_of
from problems.errors import InputError, shown
from problems.graph import arguments
from problems.graph.each import length
from problems.graph.fold import Copy
from problems.graph.nodes import Graph, P, T
from problems.graph.source_line import line_of_function
from problems.systems.base import System, Value
from problems.systems.hamiltonian import Hamiltonian
from problems.systems.lagrangian import Lagrangian

Array = NDArray[np.float64]


class Constrained(System):
    r"""A mechanical system with holonomic constraints g(q) = 0.

    With the energy H(q, p), u = dH/dp and the Jacobian G = dg/dq,

    .. math::

        q' = u, \qquad p' = -\frac{\partial H}{\partial q} + f - G^T \lambda, \qquad g(q) = 0.

    The multipliers follow from g'' = 0: with the velocity of the constraints w(q, p) = G u,

    .. math::

        \frac{\partial w}{\partial p} G^T \lambda = \frac{\partial w}{\partial q} u
            + \frac{\partial w}{\partial p} \Big( f - \frac{\partial H}{\partial q} \Big),

    whose symmetric matrix :math:`G (\partial^2 H / \partial p^2) G^T` is factored as L D L', without zeros
    between constraints that share no coordinate: a chain costs O(n). Equal constraints may be written in
    loops, with ``m.each``; the code then grows with the logarithm of their number. With these multipliers q'
    and p' are an ordinary system (of index 0). On the manifold g = 0, w = 0 its invariants are the energy,
    ``"constraints"`` (all g) and ``"constraint_rates"`` (all w). `integrators.HBVM` conserves them at
    round-off.

    Parameters
    ----------
    H : callable, Hamiltonian or Lagrangian
        The energy, a function as for `Hamiltonian`; or a system without constraints, whose ``dof`` and
        ``parameters`` are taken.
    constraints : sequence of callable
        Functions g whose arguments are among ``q, par, m``. Each returns one number, a list, or ``m.each``.
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
    independent: ClassVar[frozenset[str]] = frozenset({"constraints", "constraint_rates"})
    derived: ClassVar[frozenset[str]] = on_manifold | independent

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
        forces = None if force is None else self._forces(force)
        self._eliminate(free, *self._traced_constraints(constraints), forces)
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

    def jacobian(self, function: str = "field") -> Jacobian | None:
        """``None`` of the field: multipliers depend on all that is linked, so differences cost no more."""
        return None if function == "field" else super().jacobian(function)

    def slopes(self, invariant: str) -> Jacobian:
        if invariant not in {"constraints", "constraint_rates"}:
            return super().slopes(invariant)
        if invariant not in self._jacobians:
            self._jacobians[invariant] = entries(self.invariants[invariant], self.dim)
        found = self._jacobians[invariant]
        assert found is not None
        return found

    def _offered(self, graph: Graph) -> dict[str, Callable[[], Any]]:
        copy = Copy(graph)
        return {"multipliers": lambda: [copy.of(root) for root in self.multipliers.roots]}

    def _traced_constraints(self, constraints: Sequence[Callable[..., Any]]) -> tuple[Function, list[str]]:
        """Return all constraints as one function, and of each the line where it is written."""
        if (
            not isinstance(constraints, list | tuple)
            or not constraints
            or not all(map(callable, constraints))
        ):
            raise InputError(
                f"constraints={shown(constraints)} must be a list of functions, such as constraints=[rod]."
            )
        parts: list[Function] = []
        lines: list[str] = []
        for i, function in enumerate(constraints):
            label, line = f"constraints[{i}]", line_of_function(function)
            value = self._call(function, label)
            part = self._listed(value if arguments.is_list(value) else [value], function, label)
            flags = [node.flags for node in part.roots]
            if any(flag & P for flag in flags):
                raise InputError(f"{line}: a constraint depends on momenta; it must be a function of q.")
            if any(flag & T for flag in flags):
                raise InputError(
                    f"{line}: a constraint depends on the time; take the time as a further coordinate q[n], "
                    "with H + p[n]."
                )
            parts.append(part)
            lines += [line] * len(part.outputs)
        return stacked(parts, "invariant:constraints"), lines

    def _forces(self, force: Callable[..., Any]) -> Function:
        value, dof = self._call(force, "force"), self.dim // 2
        if not arguments.is_list(value) or length(value) != dof:
            raise InputError(f"{line_of_function(force)}: force must return a list of dof={dof} numbers.")
        return self._listed(value, force, "force")

    def _eliminate(
        self, free: Hamiltonian, constraints: Function, lines: list[str], force: Function | None
    ) -> None:
        """Write the field, the multipliers and the invariants."""
        dof = self.dim // 2
        velocity, push = free.field.part(0, dof), free.field.part(dof, 2 * dof)
        if force is not None:
            outputs = tuple(a + b for a, b in zip(push.outputs, force.outputs, strict=True))
            push = Function(self._graph, outputs, joined([(0, push.loops), (0, force.loops)]))
        if velocity.loops and free.velocity_scale is None:
            raise InputError(
                f"{self.name}: with constraints, momenta stand in m.sum as p[i]**2/(2*m) with constant "
                "masses only; write the energy with sum(... for i in range(n))."
            )
        motion = Motion(velocity, push, free.velocity_scale)
        rates = motion.along(constraints).named("invariant:constraint_rates")
        moving = places_of(rates)
        for i, line in enumerate(lines):
            if i not in moving:
                raise InputError(f"{line}: a constraint depends on no coordinate that moves; leave it out.")
        if any(node.flags & T for node in rates.roots):
            raise InputError(
                f"{lines[0]}: the velocities depend on the time; take it as a further coordinate q[n], with "
                "H + p[n]."
            )
        try:
            multipliers, momenta = motion.multipliers(constraints, rates)
        except ZeroPivotError as error:
            raise InputError(
                f"{lines[error.row]}: the constraint follows from the others, or moves "
                "nothing with a mass; leave it out."
            ) from None
        self._written["field"] = self._listed([array(velocity), momenta], repr, "field").named("field")
        self._write("multipliers", multipliers)
        self._written["invariant:constraints"], self._written["invariant:constraint_rates"] = (
            constraints, rates,
        )  # fmt: skip
        self._vectors |= {"constraints", "constraint_rates"}
        [energy] = self._written["hamiltonian"].roots
        if force is None and not energy.flags & T:
            self._write("invariant:energy", [energy])


_SHARED = ("name", "dim", "dof", "bodies", "parameters", "_layout", "n_par", "_graph")
"""What `Constrained.free` has of it."""
