"""Find methods by name: our own, the peers' and third parties' by one path.

A method registers its class under the entry point group
``hbvm_bench.integrators``; nothing is imported until its name is asked for.
"""

from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from integrators.protocol import MethodBase
from problems.errors import InputError, unknown

GROUP = "hbvm_bench.integrators"


def names() -> list[str]:
    """Return the names of all registered methods, sorted."""
    return sorted(_entries())


def get(name: str) -> type[MethodBase]:
    """Return the class of the method called ``name``.

    Raises
    ------
    problems.errors.UnknownNameError
        If there is none; the message gives the nearest names.
    """
    entries = _entries()
    if not isinstance(name, str) or name not in entries:
        raise unknown("method", name, entries)
    return entries[name].load()


def create(name: str, **options: Any) -> MethodBase:
    """Make the method ``name`` with the given options.

    Raises
    ------
    problems.errors.UnknownNameError
        For a method or an option that does not exist, with the nearest names.
    problems.errors.InputError
        For a missing option or a value that the method refuses.
    """
    return get(name)(**options)


@cache
def _entries() -> dict[str, EntryPoint]:
    found: dict[str, EntryPoint] = {}
    for entry in entry_points(group=GROUP):
        other = found.setdefault(entry.name, entry)
        if other.value != entry.value:
            raise InputError(
                f"two installed packages register a method {entry.name!r}: {other.value} and {entry.value}; "
                "uninstall one of them."
            )
    return found
