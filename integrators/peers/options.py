"""Checks of the options that peers' methods take: one sentence that names the value and the fix."""

import math
import operator
from collections.abc import Collection, Iterable
from importlib import import_module
from types import ModuleType

import numpy as np

from problems.errors import InputError, MissingLibraryError, shown, unknown

UNTRACED = "it needs the field as a formula, not as a function; write it as a VectorField or Hamiltonian."
"""Why libraries that take expressions refuse a `problems.Foreign`."""


def load(library: str, *modules: str) -> ModuleType:
    """Import an optional library, or say how to install it.

    Parameters
    ----------
    library : str
        The package, as its users call it.
    *modules : str
        The modules to import (default: the library itself); the first is returned.

    Raises
    ------
    problems.errors.MissingLibraryError
        If one of them is not installed.
    """
    try:
        found = [import_module(name) for name in modules or (library,)]
    except ImportError as error:
        raise MissingLibraryError(
            f'{library} is not installed ({error}); install the peers with pip install "hbvm-bench[peers]".'
        ) from error
    return found[0]


def number(
    method: object, name: str, *, least: float = 0.0, strict: bool = True, below: float = math.inf
) -> None:
    """Make the option ``name`` of a frozen method a float above (or at) ``least`` and below ``below``.

    Raises
    ------
    problems.errors.InputError
        If it is no such number.
    """
    value = getattr(method, name)
    try:
        given = math.nan if isinstance(value, (bool, str)) else float(value)
    except (TypeError, ValueError, OverflowError):
        given = math.nan
    if not least <= given < below or (strict and given == least):
        bounds = f"{least:g} {'<' if strict else '<='} {name} < {below:g}"
        raise InputError(f"{type(method).__name__} needs a number {bounds}, not {name}={shown(value)}.")
    object.__setattr__(method, name, given)


def flag(method: object, *names: str) -> None:
    """Make the options ``names`` of a frozen method True or False, or refuse them."""
    for name in names:
        value = getattr(method, name)
        if not isinstance(value, bool | np.bool_) and not (isinstance(value, int) and value in (0, 1)):
            raise InputError(
                f"{type(method).__name__} needs {name}=True or {name}=False, not {name}={shown(value)}."
            )
        object.__setattr__(method, name, bool(value))


def choice(method: object, name: str, known: Collection[str]) -> None:
    """Require the option ``name`` of a method to be one of ``known``; the nearest are named otherwise."""
    value = getattr(method, name)
    if not isinstance(value, str) or value not in known:
        raise unknown(f"{name} of {type(method).__name__}", value, known)


def whole_choice(method: object, name: str, known: Iterable[int]) -> None:
    """Make the option ``name`` of a frozen method one of the whole numbers ``known``, or refuse it."""
    value = getattr(method, name)
    try:
        given = None if isinstance(value, bool) else operator.index(value)
    except TypeError:
        given = None
    if given not in (allowed := tuple(known)):
        raise InputError(
            f"{type(method).__name__} offers {name} in {', '.join(map(str, allowed))}, "
            f"not {name}={shown(value)}."
        )
    object.__setattr__(method, name, given)
