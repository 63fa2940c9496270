"""Values as JSON and arrays, which a file can keep without pickle, and back again bit for bit."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators import registry
from integrators.protocol import MethodBase
from problems.errors import InputError, shown
from problems.graph.stored import items, refuse
from problems.problem import Problem
from problems.systems.base import System
from problems.systems.constrained import Constrained
from problems.systems.hamiltonian import Hamiltonian
from problems.systems.lagrangian import Lagrangian
from problems.systems.poisson import Poisson
from problems.systems.vector_field import VectorField

_SYSTEMS = {kind.__name__: kind for kind in (Constrained, Hamiltonian, Lagrangian, Poisson, VectorField)}


def packed(value: Any, arrays: dict[str, NDArray[Any]]) -> Any:
    """Return a value for JSON; arrays go into ``arrays``, under names of their own.

    Raises
    ------
    problems.errors.InputError
        For anything but numbers, texts, arrays, and lists, tuples and dictionaries of them.
    """
    match value:
        case None | bool() | int() | float() | str():
            return value if type(value) in (bool, int, float, type(None)) else _number_or_text(value)
        case np.generic():
            return packed(value.item(), arrays)
        case np.ndarray() if not value.dtype.hasobject:
            name = f"array_{len(arrays)}"
            arrays[name] = value
            return {"array": name}
        case list():
            return [packed(item, arrays) for item in value]
        case tuple():
            return {"tuple": [packed(item, arrays) for item in value]}
        case Mapping():
            return {
                "dict": [[packed(key, arrays), packed(item, arrays)] for key, item in dict(value).items()]
            }
    raise InputError(f"{shown(value)} cannot be kept in a file; only numbers, texts and arrays can.")


def _number_or_text(value: Any) -> Any:
    return next(kind(value) for kind in (int, float, str) if isinstance(value, kind))


def unpacked(plain: Any, arrays: Mapping[str, NDArray[Any]]) -> Any:
    """Return the value that `packed` was given."""
    if isinstance(plain, list):
        return [unpacked(item, arrays) for item in plain]
    if not isinstance(plain, dict):
        return plain
    [(kind, content)] = plain.items()
    if kind == "array":
        if content not in arrays:
            refuse(f"there is no array {shown(content)}")
        return arrays[content]
    items = unpacked(content, arrays)
    return tuple(items) if kind == "tuple" else dict(items)


def packed_problem(problem: Problem, arrays: dict[str, NDArray[Any]]) -> Any:
    """Return a problem for JSON, its traced graph included; no system for a field that is not traced."""
    kind, state = type(problem.system).__name__, problem.__getstate__()
    del state["system"]
    system = problem.system.__getstate__() if kind in _SYSTEMS else None
    return {"kind": kind, "system": system, "state": packed(state, arrays)}


def unpacked_problem(plain: Any, arrays: Mapping[str, NDArray[Any]]) -> Problem | None:
    """Return the problem that `packed_problem` was given; ``None`` where its field is not traced."""
    if plain["system"] is None:
        return None
    if plain["kind"] not in _SYSTEMS:
        refuse(f"it has no system of the kind {shown(plain['kind'])}")
    kind = _SYSTEMS[plain["kind"]]
    system = kind.__new__(kind)
    system.__setstate__(plain["system"])
    state = unpacked(plain["state"], arrays)
    if not isinstance(state, dict):
        refuse("a problem has no parts")
    problem = Problem.__new__(Problem)
    problem.__setstate__({**_checked(state, system), "system": system})
    return problem


_TEXTS = ("title", "notes", "_made_with")


def _checked(state: dict[Any, Any], system: System) -> dict[str, Any]:
    """Return the parts of a problem, each of the type and shape that compiled code takes for granted."""
    parts = {"y0", "par", "times", "t0", "t_end", "name", "arguments", "references", *_TEXTS}
    if set(state) - {"bodies", "moved"} != parts:  # of bodies with names, and of a start that was moved
        refuse("a problem has other parts")
    n_times = None if state["times"] is None else np.size(state["times"])
    sizes = {"y0": system.dim, "par": system.n_par, "times": n_times, "moved": system.dim}
    for key, size in sizes.items():
        if key in state and size is not None:
            state[key] = doubles(state[key], (size,), key)
            if not np.isfinite(state[key]).all():
                refuse(f"{key} is not finite")
    for key in ("t0", "t_end"):
        if type(state[key]) not in (int, float) or not math.isfinite(state[key]):
            refuse(f"{key} is {shown(state[key])}")
        state[key] = float(state[key])
    references, arguments = state["references"], state["arguments"]
    texts = [*(state[key] for key in _TEXTS), *items(references, "the list of references")]
    texts += items(state.get("bodies", ()), "the list of bodies")
    texts += [] if state["name"] is None else [state["name"]]
    texts += list(arguments) if isinstance(arguments, dict) else [None]
    if not all(isinstance(text, str) for text in texts):
        refuse("the words of a problem are no texts")
    return state


def doubles(value: Any, shape: tuple[int, ...], name: str) -> NDArray[np.float64]:
    """Return stored numbers as an array of doubles in C order, or refuse what has another type or shape.

    Raises
    ------
    problems.errors.InputError
        For anything else.
    """
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiu" or value.shape != shape:
        refuse(f"{name} is no array of {shape} numbers")
    return np.array(value, dtype=np.float64, order="C")


def packed_method(method: MethodBase, arrays: dict[str, NDArray[Any]]) -> Any:
    """Return a method for JSON, as its registered name and its options.

    Raises
    ------
    problems.errors.InputError
        For a method that is not registered: nobody could make it again from its name.
    """
    name = type(method).__name__
    if name not in registry.names() or registry.get(name) is not type(method):
        raise InputError(
            f"{name} is not registered, so that no file can name it; register it as an entry point of "
            f"{registry.GROUP}, or pickle the solution."
        )
    return [name, packed(method.options(), arrays)]


def unpacked_method(plain: Any, arrays: Mapping[str, NDArray[Any]]) -> MethodBase:
    """Return the method that `packed_method` was given."""
    name, options = items(plain, "the method", 2)
    options = unpacked(options, arrays)
    if not isinstance(name, str) or not isinstance(options, dict):
        refuse("the method has no name and options")
    return registry.create(name, **options)
