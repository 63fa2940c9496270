"""Find methods by name: our own and the peers' by a table, third parties' by their entry points.

A third party registers its class under the entry point group ``hbvm_bench.integrators``;
nothing is imported until its name is asked for.
"""

from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

from integrators.protocol import MethodBase
from problems.errors import InputError, unknown

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

GROUP = "hbvm_bench.integrators"

BUILT_IN = {
    "integrators.methods.hbvm": ("HBVM",),
    "integrators.methods.gauss": ("Gauss",),
    "integrators.methods.line_integral": ("LineIntegral",),
    "integrators.peers.heyoka.taylor": ("Taylor",),
    "integrators.peers.rebound": (
        "BS", "EOS", "IAS15", "JANUS", "Leapfrog", "MERCURIUS", "SABA", "TRACE", "WHFast", "WHFast512",
    ),
    "integrators.peers.diffrax.methods": (
        "Dopri8", "Kvaerno5", "LeapfrogMidpoint", "ReversibleHeun", "SemiImplicitEuler", "Tsit5",
    ),
    "integrators.peers.pyhamsys": ("Composition",),
    "integrators.peers.pynamicalsys": ("ImplicitMidpoint", "Yoshida4"),
    "integrators.peers.sundials": ("CVODE",),
    "integrators.peers.scipy": ("BDF", "DOP853", "LSODA", "Radau"),
}  # fmt: skip
"""Modules and the methods in them; written down here, because looking into a module would import it."""


def names() -> list[str]:
    """Return the names of all methods, sorted."""
    return sorted(_entries())


def get(name: str) -> type[MethodBase]:
    """Return the class of the method called ``name``.

    Raises
    ------
    problems.errors.UnknownNameError
        If there is none; the message gives the nearest names.
    problems.errors.InputError
        If two packages offer one of this name.
    """
    entries = _entries()
    if not isinstance(name, str) or name not in entries:
        raise unknown("method", name, entries)
    entry, *others = entries[name]
    if others:
        raise InputError(
            f"two packages offer a method {name!r}: {entry.value} and {others[0].value}; "
            "uninstall one of them, or rename one."
        )
    return entry.load()


def libraries() -> dict[str, type[MethodBase]]:
    """Return the libraries whose methods come with this package, each with one of these."""
    methods = (getattr(import_module(module), own[0]) for module, own in BUILT_IN.items())
    return {method.library: method for method in methods}


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
def _entries() -> "dict[str, list[EntryPoint]]":
    """Return what offers each name: one entry point, or several that clash, which only this name minds."""
    from importlib.metadata import EntryPoint, entry_points  # a tenth of what importing us would take

    by_name = {
        name: [EntryPoint(name, f"{module}:{name}", GROUP)]
        for module, own in BUILT_IN.items()
        for name in own
    }
    for entry in entry_points(group=GROUP):
        same = by_name.setdefault(entry.name, [])
        if entry.value not in [other.value for other in same]:
            same.append(entry)
    return by_name
