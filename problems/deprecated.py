"""Modules that have moved and values that were renamed: valid for one minor version, with a warning."""

import sys
import warnings
from collections.abc import Mapping
from importlib import import_module
from types import ModuleType
from typing import Any

_places: dict[str, str] = {}  # of modules, by their former names


class _Moved(ModuleType):
    """Stands in `sys.modules` under a former name; gives what the module at its new place has."""

    def __init__(self, former: str, present: str, removed_in: str):
        super().__init__(former, f"Moved to {present}; this name goes with version {removed_in}.")
        self._present, self._removed_in = present, removed_in

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # what the import system and inspect ask of every module
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
        value = getattr(import_module(self._present), name)
        warnings.warn(
            f"{self.__name__} has moved to {self._present}; "
            f"the former name goes with version {self._removed_in}.",
            DeprecationWarning,
            stacklevel=2,
        )
        return value


def moved(package: str, modules: Mapping[str, str], *, removed_in: str) -> None:
    """Let modules be imported under their former names too.

    Parameters
    ----------
    package : str
        The package that all of them are in.
    modules : mapping
        Present names by former names, both within the package.
    removed_in : str
        The version that knows the former names no more.
    """
    for former, present in modules.items():
        path = f"{package}.{former}"
        _places[path] = f"{package}.{present}"
        sys.modules[path] = _Moved(path, _places[path], removed_in)


def place(module: str) -> str:
    """Return the present name of a module, as files of an earlier version need it."""
    return _places.get(module, module)


def renamed(kind: str, value: Any, names: Mapping[str, str], *, removed_in: str) -> Any:
    """Return the present name of a value that is given by name; anything else is returned as it is.

    Parameters
    ----------
    kind : str
        What the value is, for the warning.
    value : object
        The argument as it was given.
    names : mapping
        Present names by former names.
    removed_in : str
        The version that knows the former names no more.
    """
    present = names.get(value) if isinstance(value, str) else None
    if present is None:
        return value
    warnings.warn(
        f"the {kind} {value!r} is now called {present!r}; the former name goes with version {removed_in}.",
        DeprecationWarning,
        stacklevel=3,
    )
    return present
