"""Base class of all systems: a traced graph, parameters, invariants and symmetry guards."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any, ClassVar, overload

import numpy as np
from numpy.typing import NDArray

from problems import limits
from problems.checks import NOTHING, Named, checked, number, numbers
from problems.derive.forward import forward
from problems.derive.function import (
    Function,
    Loops,
    LoopTerm,
    Term,
    array,
    function_of,
    joined,
    stacked,
)
from problems.derive.gradient import gradient
from problems.derive.jacobian import Jacobian, jacobian
from problems.derive.reverse import Variables, reverse
from problems.errors import InputError, shown, unknown
from problems.graph import arguments
from problems.graph.each import Each, components, length
from problems.graph.nodes import Graph, Node, T
from problems.graph.packed import packed, unpacked
from problems.quantities import refuse_more_than_numbers
from problems.systems.stored import check_system

Value = float | Sequence[Any]
_NAMED = ("field", "hamiltonian", "force", "velocity_scale")


@dataclass(frozen=True)
class Bodies:
    """Description of a system of N gravitating bodies, for N-body integrators.

    Attributes
    ----------
    masses : str
        Name of the vector parameter with the N masses.
    G : float or str
        The gravitational constant, or the name of its parameter.
    dimension : int
        Coordinates per body; the state consists of all positions body by body, then all momenta.

    Examples
    --------
    >>> import problems
    >>> problems.load("outer_solar_system").system.bodies.dimension
    3
    """

    masses: str = "m"
    G: float | str = 1.0
    dimension: int = 3


class System:
    """A first-order system; the base class of `Hamiltonian` and `VectorField`.

    Attributes
    ----------
    kind : {"hamiltonian", "vector_field", "poisson"}
        What the system is.
    traced : bool
        Whether the vector field is a graph that can be emitted; see `problems.systems.opaque`.
    dim : int
        Length of the state.
    dof : int or None
        Degrees of freedom; ``None`` if the state does not consist of positions and momenta.
    name : str
        Name for messages and generated code.
    parameters : mapping of str to float or tuple of float
        Names and default values; the values are run-time arguments.
    bodies : Bodies or None
        Description of an N-body system.
    invariants : mapping of str to Function
        The conserved quantities by name, the energy first; a list of numbers is one function.
    on_manifold : frozenset of str
        Invariants that are conserved on a manifold only, such as where constraints hold.
    derived : frozenset of str
        Invariants that follow from how the field is derived, and need no check.
    independent : frozenset of str
        Invariants whose components have linearly independent gradients wherever a problem may start.
    guards : mapping of str to Function
        Quantities that are exactly 0 by a symmetry.

    Examples
    --------
    >>> import problems
    >>> system = problems.load("kepler").system
    >>> system.kind, system.dof, tuple(system.invariants)
    ('hamiltonian', 2, ('energy', 'angular_momentum', 'lenz'))
    >>> system.force.name, problems.load("rigid_body").system.force
    ('force', None)
    """

    kind: ClassVar[str]
    traced: ClassVar[bool] = True
    on_manifold: ClassVar[frozenset[str]] = frozenset()
    derived: ClassVar[frozenset[str]] = frozenset()
    independent: ClassVar[frozenset[str]] = frozenset()

    def __init__(
        self,
        function: Callable[..., Any],
        dim: int,
        dof: int | None,
        parameters: Mapping[str, Value],
        invariants: Mapping[str, Callable[..., Any]],
        guards: Mapping[str, Callable[..., Any]],
        name: str | None,
    ) -> None:
        if dim > limits.limit("COMPONENTS"):  # what was asked for is written only where it is refused
            asked = f"dim={shown(dim)}" if dof is None else f"dof={shown(dof)}"
            limits.check(f"a system with {asked}", "COMPONENTS", dim)
        if self.kind != "vector_field" and "energy" in invariants:
            raise InputError("the invariant 'energy' is H itself; give the others only.")
        self.dim = dim
        self.dof = dof
        called = getattr(function, "__name__", "")
        self.name = name or (called if called.isidentifier() else "system")
        self.bodies: Bodies | None = None
        self.parameters: Mapping[str, Value] = MappingProxyType(
            {key: _parameter(key, value) for key, value in parameters.items()}
        )
        self._layout, self.n_par = _layout(self.parameters)
        self._graph = Graph(dof)
        self._written: dict[str, Function] = {}  # what the user wrote and is not derived
        self._vectors: set[str] = set()  # invariants that are lists
        self._start_memories()

    def _start_memories(self) -> None:
        self._jacobians: dict[str, Jacobian | None] = {}
        self._gradients: dict[Function, Function] = {}
        self._tangents: dict[tuple[str, int, bool, bool], Function] = {}
        self._products: dict[Variables, Function] = {}
        self._together: dict[tuple[Function, ...], Function] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Return what was traced, without the functions that it was traced from, as JSON can keep it."""
        bodies = self.bodies and [self.bodies.masses, self.bodies.G, self.bodies.dimension]
        return {
            "name": self.name,
            "dim": self.dim,
            "dof": self.dof,
            "parameters": {key: np.array(value).tolist() for key, value in self.parameters.items()},
            "invariants": list(self.invariants),
            "guards": list(self.guards),
            "vectors": sorted(self._vectors),
            "bodies": bodies,
            "graph": packed(self._graph, self.n_par),
            "functions": {name: function.plain() for name, function in self._written.items()},
        }

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        functions = check_system(state, [kind.__name__ for kind in type(self).__mro__])
        self.name, self.dim, self.dof = state["name"], state["dim"], state["dof"]
        self.bodies = state["bodies"] and Bodies(*state["bodies"])
        self.parameters = MappingProxyType(
            {key: _parameter(key, value) for key, value in state["parameters"].items()}
        )
        self._layout, self.n_par = _layout(self.parameters)
        self._graph = unpacked(state["graph"])
        self._written = {
            name: Function.of_plain(self._graph, plain, name) for name, plain in functions.items()
        }
        self._vectors = set(state["vectors"])
        self._start_memories()
        self._list(state["invariants"], state["guards"])

    def _write(self, name: str, nodes: Iterable[Node]) -> None:
        self._written[name] = function_of(self._graph, nodes, name)

    def _list(self, invariants: Iterable[str], guards: Iterable[str]) -> None:
        """List the invariants and guards that have been written, under their names."""
        self.invariants: Mapping[str, Function] = MappingProxyType(
            {name: self._written[f"invariant:{name}"] for name in invariants}
        )
        self.guards: Mapping[str, Function] = MappingProxyType(
            {name: self._written[f"guard:{name}"] for name in guards}
        )

    def _write_energy(self, energy: Node) -> None:
        self._write("hamiltonian", [energy])
        if not energy.flags & T:  # with explicit time it is not conserved
            self._write("invariant:energy", [energy])

    def _trace_declared(
        self, invariants: Mapping[str, Callable[..., Any]], guards: Mapping[str, Callable[..., Any]]
    ) -> None:
        for key, function in invariants.items():
            label = f"invariant {key!r}"
            value = self._call(function, label)
            if arguments.is_list(value):
                self._vectors.add(key)
            else:
                value = [value]
            nodes = [self._node(v, function, label) for v in value]
            if not nodes:
                raise InputError(f"{label} returns an empty list; return a number or a list of numbers.")
            self._write(f"invariant:{key}", nodes)
        for key, function in guards.items():
            self._write(f"guard:{key}", [self._scalar(function, f"guard {key!r}")])
        energy = ["energy"] if self.kind != "vector_field" and "invariant:energy" in self._written else []
        self._list([*energy, *invariants], guards)

    def _call(self, function: Callable[..., Any], label: str) -> Any:
        return arguments.call(function, graph=self._graph, dim=self.dim, layout=self._layout, label=label)

    def _node(self, value: Any, function: Callable[..., Any], label: str) -> Node:
        return arguments.scalar(value, graph=self._graph, function=function, label=label)

    def _listed(self, value: Any, function: Callable[..., Any], label: str) -> Function:
        """Return the function of a list of numbers, and of arrays that loops fill."""
        outputs: list[tuple[Term, ...]] = [()] * length(value)
        loops: list[tuple[int, Loops]] = []
        for at, part in components(value):
            if not isinstance(part, Each):
                node = self._node(part, function, f"{label}'s component {at}")
                outputs[at] = (Term(node, node.id),)
                continue
            for place, node in part.terms:
                outputs[at + place] = (*outputs[at + place], Term(node, node.id))
            terms = (tuple(LoopTerm(place, node) for place, node in entries) for _, entries in part.loops)
            loops.append((at, tuple(zip((loop for loop, _ in part.loops), terms, strict=True))))
        return Function(self._graph, tuple(outputs), joined(loops))

    def _scalar(self, function: Callable[..., Any], label: str) -> Node:
        return self._node(self._call(function, label), function, label)

    def trace(
        self,
        function: Callable[..., Any],
        label: str,
        *,
        data: tuple[int, ...] | None = None,
    ) -> Function:
        """Trace a function of the same arguments; the system is not changed.

        Parameters
        ----------
        function : callable
            Returns one number; its arguments are among ``t, q, p, y, par, m``, and ``multipliers`` where
            there are some.
        label : str
            Description for messages.
        data : tuple of int, optional
            The shape, () or (n,), of a further argument ``data``, whose numbers come after the parameters.

        Raises
        ------
        problems.errors.InputError
            For anything that cannot be traced, with the line.
        """
        graph = Graph(self.dof)
        more = self._offered(graph)
        if data is not None:
            more["data"] = lambda: arguments.further(graph, "data", self.n_par, data)
        value = arguments.call(
            function, graph=graph, dim=self.dim, layout=self._layout, label=label, more=more
        )
        return function_of(graph, [arguments.scalar(value, graph=graph, function=function, label=label)])

    def _offered(self, graph: Graph) -> dict[str, Callable[[], Any]]:
        """Return further arguments of such functions, by name, and what makes them on a graph."""
        return {}

    def trace_change(self, function: Callable[..., Any], label: str) -> Function:
        """Trace a function of the same arguments that returns another state, and perhaps other parameters.

        Parameters
        ----------
        function : callable
            Returns the new state, or a tuple of that and of parameters by name; see `changed`.
        label : str
            What it is, for messages.

        Returns
        -------
        Function
            dim outputs; or dim + n_par, where parameters are among what it returns.

        Raises
        ------
        problems.errors.InputError
            For anything that cannot be traced, with the line, and what is no state.
        """
        graph = Graph(self.dof)
        value = arguments.call(function, graph=graph, dim=self.dim, layout=self._layout, label=label)
        state = arguments.Vector(graph, "y", "y", 0, self.dim)
        par = arguments.Vector(graph, "par", "par", 0, self.n_par)
        values, parameters = self.changed(value, state, par, label)
        values += parameters if is_change(value) else []
        return function_of(
            graph, [arguments.scalar(x, graph=graph, function=function, label=label) for x in values]
        )

    def changed(
        self, value: Any, state: Iterable[Any], par: Iterable[Any], label: str
    ) -> tuple[list[Any], list[Any]]:
        """Return the state and the parameters that a function has made of the present ones.

        Parameters
        ----------
        value : list, or tuple of list and mapping
            What it has returned: the new state, or that and what parameters become, by name. The state is
            ``None`` where it stays.
        state, par : iterable
            The present ones, of any kind of numbers.
        label : str
            What the function is, for messages.

        Raises
        ------
        problems.errors.InputError
            For a state of another length, a parameter that there is none of, or one of another length.
        """
        new: Any = value
        changes: Mapping[str, Any] = {}
        if is_change(value):
            new, changes = value
            new = list(state) if new is None else new
        if not _is_list(new) or len(new) != self.dim:
            raise InputError(
                f"{label} must return a list of {self.dim} numbers, the new state, or a tuple of that and a "
                "dict of parameters."
            )
        parameters = list(par)
        for name, given in changes.items():
            if name not in self._layout:
                raise unknown(f"parameter of {self.name}", name, self._layout)
            offset, shape = self._layout[name]
            numbers_given = list(given) if _is_list(given) else [given]
            if shape[1:] or _is_list(given) != bool(shape) or len(numbers_given) != math.prod(shape):
                wanted = "one number" if not shape else f"a list of {shape[0]} numbers"
                wanted = "no value" if shape[1:] else wanted
                raise InputError(f"{label} must return {wanted} for the parameter {name!r}.")
            parameters[offset : offset + len(numbers_given)] = numbers_given
        return list(new), parameters

    @property
    def separable(self) -> bool:
        """Whether H = sum of c_i(par) p_i^2/2 + V(q, t), found from the traced graph."""
        return self.velocity_scale is not None

    @property
    def energy(self) -> Function | None:
        """H, one output; ``None`` where there is none."""
        return self._written.get("hamiltonian")

    @cached_property
    def field(self) -> Function | None:
        """The right-hand side, dim outputs: q' then p' where there are both; ``None`` if it is not traced."""
        return self._written.get("field")

    @cached_property
    def force(self) -> Function | None:
        """-dH/dq from positions alone, dof outputs; ``None`` where the system is not separable."""
        return None

    @cached_property
    def velocity_scale(self) -> Function | None:
        """C with q'_i = c_i p_i, dof outputs; ``None`` where the system is not separable."""
        return None

    @property
    def functions(self) -> tuple[Function, ...]:
        """All of them: field, energy, force, velocity scale, invariants, guards; without those it has not."""
        first = (self.field, self.energy, self.force, self.velocity_scale)
        known = (function for function in first if function is not None)
        return (*known, *self.invariants.values(), *self.guards.values())

    def function(self, name: str) -> Function:
        """Return one of ``field``, ``hamiltonian``, ``force`` and ``velocity_scale`` by its name.

        Raises
        ------
        problems.errors.InputError
            If the system has no such function.
        """
        attribute = "energy" if name == "hamiltonian" else name
        stored = getattr(self, attribute) if name in _NAMED else None
        if stored is None:
            raise unknown(f"function of {self.name}", name, [function.name for function in self.functions])
        return stored

    @cached_property
    def _components(self) -> Mapping[str, Mapping[str, Function]]:
        components: dict[str, Mapping[str, Function]] = {}
        for name, whole in self.invariants.items():
            n = len(whole.outputs)
            parts = {f"{name}[{i}]": _component(whole, i) for i in range(n)}
            components |= {part: {part: function} for part, function in parts.items()}
            components[name] = parts if n > 1 else {name: whole}
        return components

    def components(self, invariant: str) -> Mapping[str, Function]:
        """Return the scalars that an invariant consists of.

        Parameters
        ----------
        invariant : str
            Its name, or ``name[i]`` for one component of a list.

        Returns
        -------
        mapping of str to Function
            The invariant itself, or ``name[0]``, ``name[1]``, ...

        Raises
        ------
        problems.errors.InputError
            If the system has no such invariant.
        """
        if invariant not in self._components:
            raise unknown(f"invariant of {self.name}", invariant, self.invariants)
        return self._components[invariant]

    @overload
    def gradient(self, invariant: Function) -> Function: ...
    @overload
    def gradient(self, invariant: str) -> Function | None: ...
    def gradient(self, invariant: str | Function) -> Function | None:
        """Return the derivatives of an invariant with respect to the state.

        Parameters
        ----------
        invariant : str or Function
            An invariant or one of its `components`, or the name of one.

        Returns
        -------
        Function or None
            dim outputs for each output of the invariant; ``None`` where there is none of this name.
        """
        if isinstance(invariant, Function):
            scalar = invariant
        else:
            scalar = self.invariants.get(invariant) or self._components.get(invariant, {}).get(invariant)
        if scalar is None:
            return None
        if scalar not in self._gradients:
            name = scalar.name.replace("invariant:", "gradient:", 1)
            self._gradients[scalar] = self._derivatives(scalar, name)
        return self._gradients[scalar]

    def slopes(self, invariant: str) -> Jacobian:
        """Return the derivatives of an invariant that are not identically 0, entry by entry.

        Parameters
        ----------
        invariant : str
            The name of an invariant, or of one of its `components`, one row for each of which there is.
        """
        parts: list[Function] = []
        rows: list[int] = []
        columns: list[int] = []
        for row, scalar in enumerate(self.components(invariant).values()):
            whole = self.gradient(scalar)
            own = [d for d in range(self.dim) if whole.loops or whole.outputs[d]]
            parts.append(whole if len(own) == self.dim else stacked([whole.part(d, d + 1) for d in own]))
            rows += [row] * len(own)
            columns += own
        shape = len(parts), self.dim
        return Jacobian(stacked(parts), np.array(rows, int), np.array(columns, int), shape)

    def _derivatives(self, scalar: Function, name: str) -> Function:
        return stacked([gradient(node, self.dim) for node in scalar.roots], name)

    def together(self, *functions: Function) -> Function:
        """Return one function with all outputs of several; common subexpressions are computed once."""
        if functions not in self._together:
            self._together[functions] = stacked(functions)
        return self._together[functions]

    def jacobian(self, function: str = "field") -> Jacobian | None:
        """Return the Jacobian of the field, or of the force, or ``None`` if there is no formula.

        Parameters
        ----------
        function : {"field", "force"}
            The field with respect to the state, or (separable systems) the force with
            respect to the positions.

        Returns
        -------
        Jacobian or None
            ``None`` for a system that is not traced, and where the list of entries would
            be too long; the derivatives must then be taken by differences.

        Raises
        ------
        problems.errors.InputError
            For another name, or a system that has no such function.
        """
        if function not in ("field", "force"):
            raise unknown("Jacobian", function, ("field", "force"))
        if function not in self._jacobians:
            name = "jacobian" if function == "field" else f"jacobian_{function}"
            self._jacobians[function] = jacobian(self.function(function), name) if self.traced else None
        return self._jacobians[function]

    @property
    def sparsity(self) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
        """Rows and columns of what is not zero in a Jacobian without a formula; ``None`` if not known."""
        return None

    def tangent(
        self, name: str, directions: int, *, parameters: bool = False, beside: bool = False
    ) -> Function:
        """Return the derivatives of a function along directions; see `problems.derive.forward`.

        Parameters
        ----------
        name : {"field", "force", "velocity_scale"}
            The function.
        directions : int
            Their number, n >= 1.
        parameters : bool
            Whether directions have a part in the parameters too.
        beside : bool
            Whether the function itself is to follow its derivatives.

        Raises
        ------
        problems.errors.InputError
            For another name, or a system that has no such function.
        """
        key = name, directions, parameters, beside
        if key not in self._tangents:
            function = self.function(name)
            self._tangents[key] = forward(
                function, size={"field": self.dim, "force": len(function.outputs)}.get(name, 0),
                directions=directions, parameters=self.n_par if parameters else None,
                name=f"{name}_along_{directions}", beside=beside,
            )  # fmt: skip
        return self._tangents[key]

    def product(self, variables: Variables) -> Function:
        """Return the products of weights with the field's derivatives; see `problems.derive.reverse`.

        Parameters
        ----------
        variables : {"state", "parameters"}
            What the field is differentiated with respect to.
        """
        if variables not in self._products:
            self._products[variables] = reverse(
                self.function("field"), variables=variables, name=f"field_by_{variables}",
                count=self.dim if variables == "state" else self.n_par,
            )  # fmt: skip
        return self._products[variables]

    def is_vector(self, invariant: str) -> bool:
        """Whether an invariant is a list of numbers."""
        return invariant in self._vectors

    def pack(self, values: Mapping[str, Value] = NOTHING) -> NDArray[np.float64]:
        """Return the flat parameter vector, defaults filled in.

        Parameters
        ----------
        values : mapping of str to float or sequence of float
            Values by name; names left out keep their defaults.

        Returns
        -------
        ndarray, shape (n_par,)

        Raises
        ------
        problems.errors.InputError
            For an unknown name, a wrong length or a value that is not finite.
        """
        par = np.empty(self.n_par)
        for key in checked(self.name, "parameters", values, Named[Value]):
            if key not in self._layout:
                raise unknown(f"parameter of {self.name}", key, self._layout)
        for key, (offset, shape) in self._layout.items():
            value = _parameter(key, values[key]) if key in values else self.parameters[key]
            if not shape and isinstance(value, tuple):
                raise InputError(f"parameter {key!r} of {self.name} is one number, not {len(value)}.")
            if np.shape(value) != shape:
                needed = f"{shape[0]} numbers" if len(shape) == 1 else f"numbers of shape {shape}"
                raise InputError(f"parameter {key!r} of {self.name} needs {needed}, not {shown(value)}.")
            par[offset : offset + math.prod(shape)] = np.ravel(value)
        return par

    def unpack(self, par: NDArray[np.float64]) -> dict[str, float | NDArray[np.float64]]:
        """Return the parameters by name from the flat vector that `pack` makes; sequences as arrays."""
        return {
            key: par[offset : offset + math.prod(shape)].reshape(shape).copy()
            if shape
            else float(par[offset])
            for key, (offset, shape) in self._layout.items()
        }


def _component(whole: Function, i: int) -> Function:
    """Return one output; where loops fill the outputs, as a value of an array."""
    alone = function_of(whole.graph, [array(whole)[i]]) if whole.loops else whole.part(i, i + 1)
    return alone.named(f"{whole.name}[{i}]")


def is_change(value: Any) -> bool:
    """Whether a function has returned a state and parameters, not a state alone."""
    return isinstance(value, tuple) and len(value) == 2 and isinstance(value[1], Mapping)


def _is_list(value: Any) -> bool:
    return arguments.is_list(value) or len(getattr(value, "shape", ())) == 1


def _layout(parameters: Mapping[str, Value]) -> tuple[dict[str, tuple[int, tuple[int, ...]]], int]:
    """Return where each parameter lies in the flat vector, its shape, and the length of that."""
    layout: dict[str, tuple[int, tuple[int, ...]]] = {}
    offset = 0
    for key, value in parameters.items():
        layout[key] = (offset, np.shape(value))
        offset += np.size(value)
    return layout, offset


def _parameter(name: str, value: Any) -> Value:
    if not name.isidentifier() or name.startswith("__"):
        raise InputError(f"the parameter name {name!r} must be an identifier, such as 'mass'.")
    refuse_more_than_numbers(f"parameter {name!r}", value)
    result = number(value)
    result = _nested(value) if result is None else result
    if result is None or np.size(result) == 0:
        raise InputError(
            f"parameter {name!r} is {shown(value)}; give one finite number, a list or an array of them."
        )
    return result


def _nested(value: Any) -> Any:
    """Return numbers of one or more dimensions as tuples; ``None`` for anything else."""
    flat = numbers(value)
    if flat is not None or not isinstance(value, list | tuple | np.ndarray):
        return flat
    rows = [_nested(row) for row in value]
    same = None not in rows and len({np.shape(row) for row in rows}) == 1
    return tuple(rows) if rows and same else None
