"""Problems by name: the files of `problems.catalogue`, and third parties' entry points.

A file ``problems/catalogue/NAME.py`` with a function ``NAME`` is a built-in problem;
other packages name theirs under the entry point group ``hbvm_bench.problems``.
Nothing is imported until its name is asked for.
"""

import functools
import inspect
import pkgutil
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from problems import catalogue
from problems.checks import Arguments
from problems.entry import Entry
from problems.errors import InputError, shown, unknown
from problems.problem import Problem

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "hbvm_bench.problems"


@functools.cache
def _entries() -> "dict[str, list[EntryPoint]]":
    """Return what is offered under each name, different things only."""
    from importlib.metadata import EntryPoint, entry_points  # which takes long to import

    own = [EntryPoint(name, f"{catalogue.__name__}.{name}:{name}", GROUP) for name in built_in()]
    points_of: dict[str, list[EntryPoint]] = {}
    for point in (*own, *entry_points(group=GROUP)):
        offered = points_of.setdefault(point.name, [])
        if all(point.value != other.value for other in offered):
            offered.append(point)
    return points_of


def built_in() -> list[str]:
    """Return the names of the catalogue's own problems, sorted."""
    files = pkgutil.iter_modules(catalogue.__path__)
    return sorted(file.name for file in files if not file.name.startswith("_"))


def names() -> list[str]:
    """Return the names of all installed problems, sorted.

    Examples
    --------
    >>> import problems
    >>> "sitnikov" in problems.names()
    True
    """
    return sorted(_entries())


def factory(name: str) -> Callable[..., Problem]:
    """Return the function that makes a problem.

    Raises
    ------
    problems.errors.UnknownNameError
        For a name that is not installed, with the nearest ones.
    problems.errors.InputError
        For a name under which two distributions offer different problems, or one that
        cannot be imported.
    """
    offered = _entries().get(name) if isinstance(name, str) else None
    if offered is None:
        raise unknown("problem", name, _entries())
    if len(offered) > 1:
        who = " and ".join(f"{at.dist.name if at.dist else 'hbvm-bench'} ({at.value})" for at in offered)
        raise InputError(f"the problem {name!r} is offered by {who}; uninstall one of them, or rename one.")
    [point] = offered
    try:
        make: Callable[..., Problem] = point.load()
    except InputError:
        raise
    except Exception as error:  # whatever a package does when it is imported
        raise InputError(
            f"the problem {name!r} cannot be imported from {point.value}, {type(error).__name__}: {error}; "
            "mend or uninstall the package that offers it."
        ) from error
    if not callable(make):
        raise InputError(f"the problem {name!r} is {shown(make)} at {point.value}, not a function.")
    return make


def entry(name: str) -> Entry | None:
    """Return what a problem's decorator says; ``None`` for a function without one. Raises as `factory`."""
    return getattr(factory(name), "entry", None)


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

    Examples
    --------
    >>> import problems
    >>> problems.load("kepler", e=0.6)
    kepler(e=0.6)
    """
    make = factory(name)
    if entry(name) is None:  # the others check their own
        Arguments(name, inspect.signature(make)).check_names((), arguments)
    # NumPy's numbers and arrays become Python's, which print as the call that is typed
    plain = {
        key: value.tolist() if isinstance(value, np.generic | np.ndarray) else value
        for key, value in arguments.items()
    }
    return make(**plain)
