"""Problems by name: entry points ``hbvm_bench.problems``, built-ins and third parties alike."""

import functools
import inspect
from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points
from typing import Any

import numpy as np

from problems import calls
from problems.errors import unknown
from problems.problem import Problem

GROUP = "hbvm_bench.problems"


@functools.cache
def _entries() -> dict[str, EntryPoint]:
    return {entry.name: entry for entry in entry_points(group=GROUP)}


def names() -> list[str]:
    """Return the names of all installed problems, sorted."""
    return sorted(_entries())


def factory(name: str) -> Callable[..., Problem]:
    """Return the function that makes a problem.

    Raises
    ------
    problems.errors.UnknownNameError
        For a name that is not installed, with the nearest ones.
    """
    if not isinstance(name, str) or name not in _entries():
        raise unknown("problem", name, _entries())
    return _entries()[name].load()


def load(name: str, **arguments: Any) -> Problem:
    """Return a problem by name.

    Parameters
    ----------
    name : str
        One of `names`.
    **arguments
        What the problem's function takes, by name: ``load("sitnikov", e=0.6)``.

    Raises
    ------
    problems.errors.InputError
        For an unknown name or argument, with the nearest ones, or a value out of range.
    """
    make = factory(name)
    calls.check(name, inspect.signature(make), (), arguments, "argument")
    # NumPy's numbers and arrays become Python's, which print as the call that is typed
    plain = {
        key: value.tolist() if isinstance(value, np.generic | np.ndarray) else value
        for key, value in arguments.items()
    }
    return make(**plain)


def changed(make: Callable[..., Problem], **values: Any) -> dict[str, Any]:
    """Return those arguments that differ from the defaults of a problem's function."""
    known = inspect.signature(make).parameters
    return {key: value for key, value in values.items() if value != known[key].default}
