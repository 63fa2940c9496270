"""Canonical Hamiltonian systems, defined by a Python function that returns the energy."""

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Annotated, Any

from problems.checks import NOTHING, Named, at_least, checked_arguments
from problems.derive.function import Function, LoopTerm, Term, joined, stacked
from problems.derive.gradient import gradient
from problems.errors import InputError, shown, unknown
from problems.graph.nodes import PAR, Loop, Node, P
from problems.systems.base import Bodies, System, Value


class Hamiltonian(System):
    """A canonical system: y = (q, p), q' = dH/dp, p' = -dH/dq.

    Parameters
    ----------
    H : callable
        The energy, in ordinary arithmetic; its arguments are among ``t, q, p, y, par, m``. It is traced:
        called once, with symbols.
    dof : int
        Degrees of freedom.
    parameters : mapping of str to float or sequence of float
        Names, shapes and default values of the parameters.
    invariants : mapping of str to callable
        Quantities conserved besides the energy; each a number or a list.
    guards : mapping of str to callable
        Quantities that are exactly 0 by symmetry.
    bodies : Bodies, optional
        Description of an N-body system.
    domain : callable, optional
        A function that is positive wherever H is defined.
    name : str, optional
        Name for messages; that of the function by default.

    Examples
    --------
    >>> from problems import Hamiltonian
    >>> def H(q, p, m):
    ...     return p[0]**2/2 - m.cos(q[0])
    >>> Hamiltonian(H, dof=1).separable
    True
    """

    kind = "hamiltonian"

    @checked_arguments
    def __init__(
        self,
        H: Callable[..., Any],
        *,
        dof: Annotated[int, at_least(1)],
        parameters: Named[Value] = NOTHING,
        invariants: Named[Callable[..., Any]] = NOTHING,
        guards: Named[Callable[..., Any]] = NOTHING,
        bodies: Bodies | None = None,
        domain: Callable[..., Any] | None = None,
        name: str | None = None,
    ) -> None:
        super().__init__(H, 2 * dof, dof, parameters, invariants, guards, name)
        if bodies is not None:
            bodies = _checked_bodies(bodies, self.parameters, dof)
        self.bodies = bodies
        self._write_energy(self._scalar(H, "H"))
        self._trace_declared(invariants, guards)
        if domain is not None:
            self._write("domain", [self._scalar(domain, "domain")])

    def __repr__(self) -> str:
        return f"Hamiltonian({self.name}, dof={self.dof})"

    @cached_property
    def _slope(self) -> Function:
        """dH/dq, then dH/dp."""
        [energy] = self._written["hamiltonian"].roots
        return gradient(energy, self.dim)

    @cached_property
    def velocity_scale(self) -> Function | None:
        """C with q'_i = c_i p_i, dof outputs; ``None`` where the system is not separable."""
        dof = self.dim // 2
        return _velocity_scale(self._slope.part(dof, 2 * dof), dof)

    @cached_property
    def _push(self) -> Function:
        """-dH/dq, whatever it depends on."""
        return -self._slope.part(0, self.dim // 2)

    @cached_property
    def force(self) -> Function | None:
        """-dH/dq from positions alone, dof outputs; ``None`` where the system is not separable."""
        return self._push.named("force") if self.separable else None

    @cached_property
    def field(self) -> Function:
        """The right-hand side: q' = dH/dp, then p' = -dH/dq."""
        dof, scale, push = self.dim // 2, self.velocity_scale, self._push
        velocity = self._slope.part(dof, 2 * dof) if scale is None else _times_momentum(scale, dof)
        return stacked([velocity, push], "field")

    def _derivatives(self, scalar: Function, name: str) -> Function:
        if scalar is self.invariants.get("energy"):
            return _energy_gradient(self.field, self.dim // 2).named(name)
        return super()._derivatives(scalar, name)


def _velocity_scale(velocity: Function, dof: int) -> Function | None:
    """Return c with dH/dp_i = c_i p_i and c_i a function of parameters, or ``None``.

    Found from the structure of dH/dp: products and quotients of p_i with
    parameters and constants, and sums of these.
    """
    outputs: list[tuple[Term, ...]] = []
    for i, terms in enumerate(velocity.outputs):
        total: Node | None = None
        for term in terms:
            scale = _coefficient(term.node, ("y", dof + i))
            if scale is None:
                return None
            total = scale if total is None else total + scale
        outputs.append(() if total is None else (Term(total, terms[0].key),))
    loops: list[tuple[Loop, tuple[LoopTerm, ...]]] = []
    for loop, entries in velocity.loops:
        scaled: list[LoopTerm] = []
        for entry in entries:
            scale = _coefficient(entry.node, ("y", entry.index.shifted(dof)))
            if scale is None:
                return None
            scaled.append(LoopTerm(entry.index, scale))
        loops.append((loop, tuple(scaled)))
    return Function(velocity.graph, tuple(outputs), tuple(loops), "velocity_scale")


def _coefficient(node: Node, momentum: tuple[str, object]) -> Node | None:
    """Return c, free of state and time, with ``node = c * momentum``; ``None`` if it has not this form."""
    graph = node.graph
    if node.op == "symbol":
        return graph.const(1.0) if node.data == momentum else None
    if node.op == "neg":
        inner = _coefficient(node.args[0], momentum)
        return None if inner is None else -inner
    if node.op in ("add", "sub"):
        a, b = (_coefficient(arg, momentum) for arg in node.args)
        return None if a is None or b is None else graph.apply(node, (a, b))
    if node.op in ("mul", "div"):
        a, b = node.args
        if not b.flags & ~PAR:
            inner = _coefficient(a, momentum)
            return None if inner is None else graph.apply(node, (inner, b))
        if node.op == "mul" and not a.flags & ~PAR:
            inner = _coefficient(b, momentum)
            return None if inner is None else a * inner
    return None


def _times_momentum(scale: Function, dof: int) -> Function:
    """Return c_i p_i from c."""
    graph = scale.graph
    outputs = tuple(
        tuple(Term(term.node * graph.symbol("y", dof + i, flags=P), term.key) for term in terms)
        for i, terms in enumerate(scale.outputs)
    )
    loops = tuple(
        (
            loop,
            tuple(
                LoopTerm(e.index, e.node * graph.symbol("y", e.index.shifted(dof), flags=P, loop=loop))
                for e in entries
            ),
        )
        for loop, entries in scale.loops
    )
    return Function(graph, outputs, loops)


def _energy_gradient(field: Function, dof: int) -> Function:
    """Return grad H from the field (dH/dp, -dH/dq), with the same roundings."""
    velocity, slope = field.part(0, dof), -field.part(dof, 2 * dof)
    loops = joined([(dof, velocity.loops), (0, slope.loops)])
    return Function(field.graph, slope.outputs + velocity.outputs, loops)


def _checked_bodies(bodies: Any, parameters: Mapping[str, Value], dof: int) -> Bodies:
    if not isinstance(bodies, Bodies):
        raise InputError(f'bodies={shown(bodies)} must be a problems.Bodies, as in Bodies(masses="m").')
    for name in [bodies.masses, *([bodies.G] if isinstance(bodies.G, str) else [])]:
        if name not in parameters:
            raise unknown("parameter in bodies", name, parameters)
    masses = parameters[bodies.masses]
    if not isinstance(masses, tuple) or len(masses) * bodies.dimension != dof:
        raise InputError(
            f"{bodies} does not fit dof={dof} and {bodies.masses}={shown(masses)}; "
            f"it needs a list of masses, and dof = {bodies.dimension} times their number."
        )
    return bodies
