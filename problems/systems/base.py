"""What all systems have in common: a traced graph, parameters, invariants, guards."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from problems import limits
from problems.calculus.function import Function, function_of, stacked
from problems.calculus.gradient import gradient
from problems.calculus.jacobian import Jacobian, jacobian
from problems.checks import NOTHING, Named, checked, number, numbers
from problems.errors import InputError, shown, unknown
from problems.systems.stored import check_system
from problems.trace import arguments
from problems.trace.graph import Graph, Node, T

Value = float | Sequence[float]

_DECLARED = ("hamiltonian", "momentum", "domain")  # functions that users write, with invariants and guards

_COMPONENT = re.compile(r"(?P<kind>invariant|gradient):(?P<name>.*)\[(?P<place>\d+)\]")


@dataclass(frozen=True)
class Bodies:
    """What makes a system N gravitating bodies, for engines that know bodies.

    Attributes
    ----------
    masses : str
        Name of the vector parameter with the N masses.
    G : float or str
        The gravitational constant, or the parameter that holds it.
    dimension : int
        Coordinates per body; the state holds all positions body by body, then all momenta.

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
    """A first-order system traced once; the base of `Hamiltonian` and `VectorField`.

    Attributes
    ----------
    kind : {"hamiltonian", "vector_field", "poisson"}
        What the system is.
    traced : bool
        Whether the vector field is a graph that can be emitted; see `problems.systems.untraced`.
    dim : int
        Length of the state.
    dof : int or None
        Degrees of freedom; ``None`` where the state is not positions and momenta.
    name : str
        A name for messages and generated code.
    parameters : mapping of str to float or tuple of float
        Names and default values; the values are run-time arguments.
    bodies : Bodies or None
        What makes it an N-body system.

    Examples
    --------
    >>> import problems
    >>> system = problems.load("kepler").system
    >>> system.kind, system.dof, system.invariant_names
    ('hamiltonian', 2, ('energy', 'angular_momentum', 'lenz'))
    """

    kind: ClassVar[str]
    traced: ClassVar[bool] = True

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
        self._functions: dict[str, Function | None] = {}  # None: it has none of this name
        self._jacobians: dict[str, Jacobian | None] = {}
        self._vectors: set[str] = set()  # invariants that are lists
        self.invariant_names: tuple[str, ...] = tuple(invariants)
        self.guard_names: tuple[str, ...] = tuple(guards)

    def __getstate__(self) -> dict[str, Any]:
        """Return what was traced, without the functions that it was traced from, as JSON can keep it."""
        own = {*_DECLARED, *(f"invariant:{n}" for n in self.invariant_names)}
        own |= {f"guard:{n}" for n in self.guard_names}
        declared = {
            name: function.plain()
            for name, function in self._functions.items()
            if function is not None and (name in own or self._writes(name))
        }
        bodies = self.bodies and [self.bodies.masses, self.bodies.G, self.bodies.dimension]
        return {
            "name": self.name,
            "dim": self.dim,
            "dof": self.dof,
            "parameters": {key: np.array(value).tolist() for key, value in self.parameters.items()},
            "invariants": list(self.invariant_names),
            "guards": list(self.guard_names),
            "vectors": sorted(self._vectors),
            "bodies": bodies,
            "graph": self._graph.__getstate__(),
            "functions": declared,
        }

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        functions = check_system(state, [kind.__name__ for kind in type(self).__mro__])
        self.name, self.dim, self.dof = state["name"], state["dim"], state["dof"]
        self.bodies = state["bodies"] and Bodies(*state["bodies"])
        self.parameters = MappingProxyType(
            {key: _parameter(key, value) for key, value in state["parameters"].items()}
        )
        self._layout, self.n_par = _layout(self.parameters)
        self._graph = Graph.__new__(Graph)
        self._graph.__setstate__(state["graph"])
        self._functions = {name: Function.of_plain(self._graph, plain) for name, plain in functions.items()}
        self._jacobians = {}
        self._vectors = set(state["vectors"])
        self.invariant_names, self.guard_names = tuple(state["invariants"]), tuple(state["guards"])

    def _writes(self, name: str) -> bool:
        """Whether a function is written by the user and not derived, besides those that all systems have."""
        return name in ("field", "gradient", "structure")

    def _set_energy(self, energy: Node) -> None:
        self._functions["hamiltonian"] = function_of(self._graph, [energy])
        if not energy.flags & T:  # with explicit time it is not kept
            self._functions["invariant:energy"] = self._functions["hamiltonian"]
            self.invariant_names = ("energy", *self.invariant_names)

    def _trace_declared(
        self, invariants: Mapping[str, Callable[..., Any]], guards: Mapping[str, Callable[..., Any]]
    ) -> None:
        for key, function in invariants.items():
            what = f"invariant {key!r}"
            value = self._call(function, what)
            if arguments.is_list(value):
                self._vectors.add(key)
            else:
                value = [value]
            nodes = [self._node(v, function, what) for v in value]
            if not nodes:
                raise InputError(f"{what} returns an empty list; return a number or a list of numbers.")
            self._functions[f"invariant:{key}"] = function_of(self._graph, nodes)
        for key, function in guards.items():
            self._functions[f"guard:{key}"] = function_of(
                self._graph, [self._scalar(function, f"guard {key!r}")]
            )

    def _call(self, function: Callable[..., Any], what: str) -> Any:
        return arguments.call(function, graph=self._graph, dim=self.dim, layout=self._layout, what=what)

    def _node(self, value: Any, function: Callable[..., Any], what: str) -> Node:
        return arguments.scalar(value, graph=self._graph, function=function, what=what)

    def _scalar(self, function: Callable[..., Any], what: str) -> Node:
        return self._node(self._call(function, what), function, what)

    def trace(self, function: Callable[..., Any], what: str) -> Function:
        """Trace a function of the same arguments, on a graph of its own: nothing of the system changes.

        Parameters
        ----------
        function : callable
            Returns one number; its arguments are among ``t, q, p, y, par, m``.
        what : str
            What it is, for messages.

        Raises
        ------
        problems.errors.InputError
            For anything that cannot be traced, with the line.
        """
        graph = Graph(self.dof)
        value = arguments.call(function, graph=graph, dim=self.dim, layout=self._layout, what=what)
        return function_of(graph, [arguments.scalar(value, graph=graph, function=function, what=what)])

    @property
    def separable(self) -> bool:
        """Whether H = sum of c_i(par) p_i^2/2 + V(q, t), found from the traced graph."""
        return False

    def function(self, what: str) -> Function:
        """Return a function of the system as a graph, for the emitters.

        Parameters
        ----------
        what : str
            ``"field"``, ``"force"``, ``"velocity_scale"``, ``"hamiltonian"``,
            ``"invariant:<name>"``, ``"guard:<name>"``; ``"gradient:<invariant>"`` (dim
            outputs for each component of the invariant); ``"invariant:<name>[i]"`` and
            ``"gradient:<name>[i]"`` for one component; for Poisson systems ``"gradient"``
            (of H) and ``"structure"`` (B row by row). Several, separated by ``", "``, are
            one function with all their outputs: what they share is computed once.

        Raises
        ------
        problems.errors.InputError
            If the system has no such function.
        """
        if not self._has(what):
            raise unknown(f"function of {self.name}", what, self.offered())
        found = self._functions[what]
        assert found is not None
        return found

    def _has(self, what: str) -> bool:
        if not isinstance(what, str):
            return False
        if what not in self._functions:
            self._functions[what] = self._derived(what)
        return self._functions[what] is not None

    def _derived(self, what: str) -> Function | None:
        """Return a function made of others: several as one, a gradient, a single component."""
        if ", " in what:
            return stacked([self.function(part) for part in what.split(", ")])
        if (part := _COMPONENT.fullmatch(what)) is not None:
            place, whole = int(part["place"]), self._functions.get(f"invariant:{part['name']}")
            if whole is None or place >= len(whole.outputs):
                return None
            one = whole.part(place, place + 1)
            return one if part["kind"] == "invariant" else self._gradients(one)
        kind, _, name = what.partition(":")
        whole = self._functions.get(f"invariant:{name}") if kind == "gradient" else None
        return None if whole is None else self._gradients(whole)

    def _gradients(self, scalars: Function) -> Function:
        """Return the gradients of scalars with respect to the state, one after another."""
        return stacked([gradient(node, self.dim) for node in scalars.roots])

    def offered(self) -> list[str]:
        """Return the names that `function` knows, but for gradients and components."""
        known = [name for name in ("field", "hamiltonian", "force", "velocity_scale") if self._has(name)]
        invariants = [f"invariant:{name}" for name in self.invariant_names]
        return known + invariants + [f"guard:{name}" for name in self.guard_names]

    def jacobian(self, what: str = "field") -> Jacobian | None:
        """Return the Jacobian of the field, or of the force, or ``None`` where none is written down.

        Parameters
        ----------
        what : {"field", "force"}
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
        if what not in ("field", "force"):
            raise unknown("Jacobian", what, ("field", "force"))
        if what not in self._jacobians:
            name = "jacobian" if what == "field" else f"jacobian_{what}"
            self._jacobians[what] = jacobian(self.function(what), name) if self.traced else None
        return self._jacobians[what]

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
        for key, (offset, size) in self._layout.items():
            value = _parameter(key, values[key]) if key in values else self.parameters[key]
            if size is None and isinstance(value, tuple):
                raise InputError(f"parameter {key!r} of {self.name} is one number, not {len(value)}.")
            if size is not None and (not isinstance(value, tuple) or len(value) != size):
                raise InputError(
                    f"parameter {key!r} of {self.name} needs {size} numbers, not {shown(value)}."
                )
            par[offset : offset + (size or 1)] = value
        return par

    def unpack(self, par: NDArray[np.float64]) -> dict[str, float | NDArray[np.float64]]:
        """Return the parameters by name from the flat vector that `pack` makes; sequences as arrays."""
        return {
            key: float(par[offset]) if size is None else par[offset : offset + size].copy()
            for key, (offset, size) in self._layout.items()
        }


def _layout(parameters: Mapping[str, Value]) -> tuple[dict[str, tuple[int, int | None]], int]:
    """Return where each parameter lies in the flat vector, and the length of that."""
    layout: dict[str, tuple[int, int | None]] = {}
    offset = 0
    for key, value in parameters.items():
        size = len(value) if isinstance(value, tuple) else None
        layout[key] = (offset, size)
        offset += 1 if size is None else size
    return layout, offset


def _parameter(name: str, value: Any) -> Value:
    if not name.isidentifier() or name.startswith("__"):
        raise InputError(f"the parameter name {name!r} must be an identifier, such as 'mass'.")
    found = number(value)
    found = numbers(value) if found is None else found
    if found is None or found == ():
        raise InputError(
            f"parameter {name!r} is {shown(value)}; give one finite number or a flat list of them."
        )
    return found
