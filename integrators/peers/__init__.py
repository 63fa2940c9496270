"""Established integrators of other libraries behind the stepper protocol: heyoka, REBOUND, diffrax, SciPy.

The modules are named after the libraries; each imports its library by `load`, only when a
method is compiled, so importing a module here costs nothing and needs nothing installed.
"""

import sys
from importlib import import_module
from types import ModuleType

from problems.errors import MissingLibraryError

UNTRACED = "it needs the field as a formula, not as a function; write it as a VectorField or Hamiltonian."
"""Why libraries that take expressions refuse a `problems.Foreign`."""

ONLY_LINUX = ("heyoka",)
"""Libraries without wheels for other systems, as the extra ``peers`` says too."""


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
        if library in ONLY_LINUX and sys.platform != "linux":
            fix = "it has wheels for Linux only; on this system it must be built from its sources."
        else:
            fix = 'install the peers with pip install "hbvm-bench[peers]".'
        raise MissingLibraryError(f"{library} is not installed ({error}); {fix}") from error
    return found[0]
