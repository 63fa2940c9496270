"""Systems written once in ordinary Python arithmetic: `Hamiltonian`, `VectorField`."""

from collections.abc import Callable, Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Any

from problems.calculus import functions
from problems.calculus.functions import Function
from problems.calculus.gradient import Gradient, gradient
from problems.calls import checked
from problems.errors import InputError, shown, unknown
from problems.systems.base import Bodies, System, Value, check_count, check_names, name_of
from problems.trace import arguments
from problems.trace.graph import T
from problems.trace.lines import line_of_function


class Hamiltonian(System):
    """A canonical system: y = (q, p), q' = dH/dp, p' = -dH/dq.

    Parameters
    ----------
    H : callable
        The energy, in ordinary arithmetic; names the arguments it needs among
        ``t, q, p, y, par, m``. It is run once, on symbols.
    dof : int
        Degrees of freedom.
    parameters : mapping of str to float or sequence of float
        Names, shapes and default values of the parameters.
    invariants : mapping of str to callable
        Quantities kept by the flow besides the energy; each a number or a list.
    guards : mapping of str to callable
        Quantities that stay exactly 0 by symmetry.
    bodies : Bodies, optional
        What makes it an N-body system.
    domain : callable, optional
        A number that is positive wherever H is defined.
    name : str, optional
        A name for messages; the function's own by default.

    Examples
    --------
    >>> def H(q, p, m):
    ...     return p[0]**2/2 - m.cos(q[0])
    >>> Hamiltonian(H, dof=1).separable
    True
    """

    kind = "hamiltonian"

    @checked
    def __init__(
        self,
        H: Callable[..., Any],
        *,
        dof: int,
        parameters: Mapping[str, Value] = MappingProxyType({}),
        invariants: Mapping[str, Callable[..., Any]] = MappingProxyType({}),
        guards: Mapping[str, Callable[..., Any]] = MappingProxyType({}),
        bodies: Bodies | None = None,
        domain: Callable[..., Any] | None = None,
        name: str | None = None,
    ) -> None:
        dof = check_count("dof", dof)
        if "energy" in check_names("invariants", invariants):
            raise InputError("the invariant 'energy' is H itself; give the others only.")
        super().__init__(
            dim=2 * dof,
            dof=dof,
            parameters=parameters,
            invariants=invariants,
            guards=guards,
            name=name or name_of(H),
        )
        if bodies is not None:
            bodies = _checked_bodies(bodies, self.parameters)
        self.bodies = bodies
        self._energy = self._scalar(H, "H")
        self._functions["hamiltonian"] = functions.plain(self._graph, [self._energy])
        if not self._energy.flags & T:  # with explicit time the energy is not kept
            self._functions["invariant:energy"] = self._functions["hamiltonian"]
            self.invariant_names = ("energy", *self.invariant_names)
        self._trace_declared()
        if domain is not None:
            self._functions["domain"] = functions.plain(self._graph, [self._scalar(domain, "domain")])

    def __repr__(self) -> str:
        return f"Hamiltonian({self.name}, dof={self.dof})"

    @cached_property
    def _gradient(self) -> Gradient:
        return gradient(self._energy)

    @property
    def separable(self) -> bool:
        """Whether H = sum of c_i(par) p_i^2/2 + V(q, t), found from the traced graph."""
        return self._known("velocity_scale")

    def _build(self, what: str) -> Function | None:
        dof = self.dim // 2
        if what == "velocity_scale":
            return functions.velocity_scale(self._graph, self._gradient, dof)
        scale = self._functions.get("velocity_scale") if self.separable else None
        if what == "field":
            return functions.hamiltonian_field(self._graph, self._gradient, dof, scale)
        if what == "force" and scale is not None:
            return functions.force(self._graph, self._gradient, dof)
        return None


def _checked_bodies(bodies: Any, parameters: Mapping[str, Value]) -> Bodies:
    if not isinstance(bodies, Bodies):
        raise InputError(f'bodies={shown(bodies)} must be a problems.Bodies, as in Bodies(masses="m").')
    for name in [bodies.masses, *([bodies.G] if isinstance(bodies.G, str) else [])]:
        if name not in parameters:
            raise unknown("parameter in bodies", name, parameters)
    return bodies


class VectorField(System):
    """Any first-order system y' = f(t, y).

    Parameters
    ----------
    f : callable
        Returns the list of derivatives; names the arguments it needs among ``t, y, par, m``.
    dim : int
        Length of the state.
    parameters, invariants, guards, name
        As for `Hamiltonian`; there is no energy unless it is given as an invariant.
    """

    kind = "vector_field"

    @checked
    def __init__(
        self,
        f: Callable[..., Any],
        *,
        dim: int,
        parameters: Mapping[str, Value] = MappingProxyType({}),
        invariants: Mapping[str, Callable[..., Any]] = MappingProxyType({}),
        guards: Mapping[str, Callable[..., Any]] = MappingProxyType({}),
        name: str | None = None,
    ) -> None:
        dim = check_count("dim", dim)
        super().__init__(
            dim=dim,
            dof=None,
            parameters=parameters,
            invariants=invariants,
            guards=guards,
            name=name or name_of(f),
        )
        value = self._call(f, "f")
        if not isinstance(value, list | tuple | arguments.Vector) or len(value) != dim:
            got = f"{len(value)} values" if hasattr(value, "__len__") else "one value"
            raise InputError(
                f"{line_of_function(f)}: f returns {got}, not a list of dim={dim}; "
                "return one derivative for each component of y."
            )
        nodes = [
            arguments.scalar(v, graph=self._graph, function=f, what=f"f's component {i}")
            for i, v in enumerate(value)
        ]
        self._functions["field"] = functions.plain(self._graph, nodes)
        self._trace_declared()

    def __repr__(self) -> str:
        return f"VectorField({self.name}, dim={self.dim})"

    def _build(self, what: str) -> Function | None:
        return None


__all__ = ["Bodies", "Hamiltonian", "System", "Value", "VectorField"]
