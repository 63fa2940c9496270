"""Systems as files hold them, checked as `problems.graph.stored` checks their graphs."""

from collections.abc import Iterable, Mapping
from typing import Any

from problems import limits
from problems.errors import shown
from problems.graph.stored import Shape, StoredGraph, integer, items, refuse

_PARTS = {
    "name", "dim", "dof", "parameters", "invariants", "guards", "vectors", "bodies", "graph", "functions",
}  # fmt: skip
_WRITTEN = {
    "Hamiltonian": ["hamiltonian"],
    "Lagrangian": ["hamiltonian", "momentum"],
    "Constrained": ["hamiltonian", "field", "multipliers"],
    "VectorField": ["field"],
    "Opaque": [],  # its field is code
    "Poisson": ["hamiltonian", "field", "gradient", "structure"],
}
"""What systems of each kind are made of."""


def check_system(state: Mapping[str, Any], classes: Iterable[str]) -> dict[str, Any]:
    """Check what ``System.__getstate__`` returns; return the functions in it that are the system's own.

    Parameters
    ----------
    state : mapping
        What was stored.
    classes : iterable of str
        The system's class and those that it is derived from.

    Raises
    ------
    problems.errors.InputError
        For anything that no system of this kind has.
    """
    if not isinstance(state, Mapping) or not set(state) >= _PARTS:
        refuse("it lacks a part of its system")
    if not isinstance(state["name"], str):
        refuse("its name is no text")
    dim, dof = integer(state["dim"], 1, 2**53, "its dimension"), state["dof"]
    limits.check("a stored system", "COMPONENTS", dim)
    kind = next((name for name in classes if name in _WRITTEN), "Opaque")
    canonical = kind in ("Hamiltonian", "Lagrangian", "Constrained")
    if (dof is not None) != canonical or (dof is not None and 2 * integer(dof, 1, dim + 1, "dof") != dim):
        refuse(f"a {kind} has dim={dim} and dof={shown(dof)}")
    parameters = state["parameters"]
    if not isinstance(parameters, Mapping) or not all(isinstance(name, str) for name in parameters):
        refuse("its parameters are no dictionary by name")
    n_par = sum(_count(value) for value in parameters.values())
    invariants, guards = _names(state["invariants"]), _names(state["guards"])
    vectors = _names(state["vectors"])
    if not set(vectors) <= set(invariants):
        refuse("a list is none of its invariants")
    if state["bodies"] is not None:
        masses, G, dimension = items(state["bodies"], "its bodies", 3)
        each = integer(dimension, 1, 4, "the dimension of its bodies")
        if not isinstance(masses, str) or not isinstance(parameters.get(masses), list | tuple):
            refuse("its bodies have no masses")
        if len(parameters[masses]) * each != dof or not isinstance(G, str | float | int):
            refuse("its bodies are not as many as its positions")
        if isinstance(G, str) and G not in parameters:
            refuse("its bodies have no constant of gravitation")
    needed = [
        *_WRITTEN[kind],
        *(f"invariant:{n}" for n in invariants),
        *(f"guard:{n}" for n in guards),
    ]
    sizes = {"field": dim, "gradient": dim, "structure": dim * dim, "momentum": dim // 2}
    scalars = {"hamiltonian", "domain"}
    scalars |= {name for name in needed if ":" in name and name.partition(":")[2] not in vectors}
    sizes |= dict.fromkeys(scalars, 1)
    graph, functions = StoredGraph(state["graph"], Shape(dim, dof, n_par)), state["functions"]
    if not isinstance(functions, Mapping) or not set(needed) <= set(functions):
        refuse("it lacks a function")
    own = {name: functions[name] for name in functions if name in needed or name in ("domain", "momentum")}
    for name, plain in own.items():
        graph.check_function(plain, name, sizes.get(name))
        if name in scalars and (len(plain[0][0]) != 1 or plain[1]):
            refuse(f"{name} is not one number")
    return own


def _count(value: Any) -> int:
    return sum(map(_count, value)) if isinstance(value, list | tuple) else 1


def _names(value: Any) -> list[str]:
    names = items(value, "a list of names")
    if not all(isinstance(name, str) for name in names) or len(set(names)) != len(names):
        refuse("a list of names has other things in it, or one twice")
    return names
