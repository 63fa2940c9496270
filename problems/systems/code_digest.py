"""What a Python function is, as a hash: its code and all that it takes from around it."""

import dis
import hashlib
import pickle
import sys
import sysconfig
from contextlib import suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np


def code_digest(f: Any, dim: int, name: str) -> str:
    """Return the SHA-256 of a system's function; the values of its parameters are no part of it."""
    digest = hashlib.sha256(f"foreign {dim} {name}\n".encode())
    _feed(digest, f, {})
    return digest.hexdigest()


def _feed(digest: Any, value: Any, seen: dict[int, tuple[int, Any]]) -> None:
    """Add to a digest what a value is, the same from process to process.

    Of a function that is its code and all that it takes from around it: defaults, variables of
    functions around it, globals, the functions among these likewise, and what it names of modules and
    classes that are no library's; of a bound method also the
    object, of an object that can be called what is run then. ``seen`` numbers what may contain itself,
    by id, and keeps it: an id names a value only while that lives.
    """
    value = getattr(value, "py_func", value)
    if isinstance(value, int | float | complex | str | bytes | np.generic | None):
        digest.update(f"{value!r};".encode())
        return
    digest.update(f"{type(value).__module__}.{type(value).__qualname__}:".encode())
    if not isinstance(value, np.ndarray | CodeType | tuple | set | frozenset):
        if id(value) in seen:
            digest.update(f"{seen[id(value)][0]};".encode())
            return
        seen[id(value)] = (len(seen), value)
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        digest.update(f"{value.dtype} {value.shape}".encode() + value.tobytes())
    elif isinstance(value, CodeType):
        digest.update(value.co_code + repr((value.co_names, value.co_varnames, value.co_freevars)).encode())
        _feed(digest, value.co_consts, seen)
    elif isinstance(value, FunctionType):
        names = _names(value.__code__)
        cells = [_used(cell.cell_contents, names) for cell in value.__closure__ or ()]
        around = _imported(value.__code__) | value.__globals__
        named = {name: _used(around[name], names) for name in names if name in around}
        _feed(digest, (value.__code__, value.__defaults__, value.__kwdefaults__, tuple(cells), named), seen)
    elif isinstance(value, MethodType):
        _feed(digest, (value.__func__, value.__self__), seen)
    elif isinstance(value, partial):
        _feed(digest, (value.func, value.args, value.keywords), seen)
    elif isinstance(value, dict):
        for key, item in value.items():
            _feed(digest, key, seen)
            _feed(digest, item, seen)
    elif isinstance(value, set | frozenset):  # whose own order is that of hashes: another in each process
        _feed(digest, tuple(sorted(repr(item) for item in value)), seen)
    elif isinstance(value, list | tuple):
        for item in value:
            _feed(digest, item, seen)
    elif isinstance(value, ModuleType | type) or (callable(value) and hasattr(value, "__qualname__")):
        digest.update(getattr(value, "__qualname__", value.__name__).encode())
    else:
        run = type(value).__call__ if callable(value) else None
        _feed(digest, (_held(value), run if isinstance(run, FunctionType) else None), seen)


def _used(value: Any, names: list[str], within: tuple[Any, ...] = ()) -> Any:
    """Return what code that looks up ``names`` takes from a value: of a user's module or class, attributes.

    A library's modules and classes count as what their names say.
    """
    own = isinstance(value, ModuleType | type) and not _of_a_library(value)
    if not own or any(value is outer for outer in within):
        return value
    wanted = [*names, "__init__", "__call__"] if isinstance(value, type) else names
    held = {name: vars(value)[name] for name in wanted if name in vars(value)}
    return value, {name: _used(item, names, (*within, value)) for name, item in held.items()}


def _imported(code: CodeType) -> dict[str, Any]:
    """Return the modules that code imports itself, by name; what cannot be imported is left out."""
    modules = {}
    for step in dis.get_instructions(code):
        if step.opname == "IMPORT_NAME":
            with suppress(Exception):  # whatever the module raises; the function will, too
                modules[step.argval] = import_module(step.argval)
    return modules


def _of_a_library(value: ModuleType | type) -> bool:
    """Whether a module, or that of a class, is Python's own or an installed one."""
    module = value if isinstance(value, ModuleType) else sys.modules.get(value.__module__)
    file = getattr(module, "__file__", None)
    if file is None:  # built in, but for the program's own
        return getattr(module, "__name__", "") != "__main__"
    return any(Path(file).is_relative_to(folder) for folder in _LIBRARIES)


_LIBRARIES = {sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")}


def _held(value: Any) -> Any:
    """Return what an object holds: its attributes, those in slots too, or else its pickled form."""
    slots = [getattr(kind, "__slots__", ()) for kind in type(value).__mro__]
    names = [name for group in slots for name in ((group,) if isinstance(group, str) else group)]
    held = {name: getattr(value, name) for name in names if name != "__dict__" and hasattr(value, name)}
    held |= getattr(value, "__dict__", {})
    if held:
        return held
    try:
        return pickle.dumps(value, 4)
    except Exception:  # whatever a library raises for what it does not pickle
        return None


def _names(code: CodeType) -> list[str]:
    """Return the names that code may look up, that of functions within it too."""
    within = [name for inner in code.co_consts if isinstance(inner, CodeType) for name in _names(inner)]
    return sorted({*code.co_names, *within})
