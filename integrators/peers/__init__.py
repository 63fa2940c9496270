"""Established integrators of other libraries behind the stepper protocol.

heyoka, REBOUND, diffrax, SciPy, SUNDIALS, pyhamsys and pynamicalsys.

The modules are named after the libraries; each imports its library by `load`, only when a
method is compiled, so importing a module here costs nothing and needs nothing installed.
"""

import sys
from importlib import import_module
from platform import machine
from types import ModuleType

from problems.errors import MissingLibraryError

UNTRACED = "it needs the field as a formula, not as a function; write it as a VectorField or Hamiltonian."
"""Why libraries that take expressions refuse an `problems.Opaque`."""

WHEELS = {"heyoka": "Linux only", "scikit-sundae": "x86-64 only, and for macOS"}
"""Of libraries without wheels for some systems, for which there are some, as the extra ``peers`` says too."""

APART = ("pynamicalsys",)
"""Libraries that the extra ``peers`` does not install."""


def without_wheels() -> list[str]:
    """Return the libraries that have no wheels for this system."""
    there = {
        "heyoka": sys.platform == "linux",
        "scikit-sundae": sys.platform != "linux" or machine() == "x86_64",
    }
    return [library for library in WHEELS if not there[library]]


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
        imported = [import_module(name) for name in modules or (library,)]
    except ImportError as error:
        if library in without_wheels():
            fix = f"it has wheels for {WHEELS[library]}; on this system it must be built from its sources."
        elif library in APART:
            fix = f"install it with pip install {library}."
        else:
            fix = 'install the peers with pip install "hbvm-bench[peers]".'
        raise MissingLibraryError(f"{library} is not installed ({error}); {fix}") from error
    return imported[0]
