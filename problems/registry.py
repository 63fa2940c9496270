"""Problems by name: entry points ``hbvm_bench.problems``, built-ins and third parties alike."""

import functools
import inspect
from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points
from typing import Any

import numpy as np

from problems import calls
from problems.errors import InputError, unknown
from problems.problem import Problem

GROUP = "hbvm_bench.problems"


@functools.cache
def _entries() -> dict[str, list[EntryPoint]]:
    """Return what is offered under each name, different things only."""
    found: dict[str, list[EntryPoint]] = {}
    for entry in entry_points(group=GROUP):
        offered = found.setdefault(entry.name, [])
        if all(entry.value != other.value for other in offered):
            offered.append(entry)
    return found


def names() -> list[str]:
    """Return the names of all installed problems, sorted."""
    return sorted(_entries())


def factory(name: str) -> Callable[..., Problem]:
    """Return the function that makes a problem.

    Raises
    ------
    problems.errors.UnknownNameError
        For a name that is not installed, with the nearest ones.
    problems.errors.InputError
        For a name under which two distributions offer different problems.
    """
    offered = _entries().get(name) if isinstance(name, str) else None
    if offered is None:
        raise unknown("problem", name, _entries())
    if len(offered) > 1:
        who = " and ".join(f"{entry.dist.name if entry.dist else '?'} ({entry.value})" for entry in offered)
        raise InputError(f"the problem {name!r} is offered by {who}; uninstall one of them, or rename one.")
    return offered[0].load()


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
