"""Compiled entries in this process, called with integers and addresses."""

import ctypes
from functools import cached_property
from importlib import import_module
from typing import Any

from integrators.kernel.native import binary, store
from integrators.kernel.native.foreign import raise_error


class Engine:
    """The function ``entry`` of a module: compiled, loaded, or loaded before, when it is first needed.

    Parameters
    ----------
    module : str
        Its full name; it is imported, and numba with it, only to be compiled.
    arguments : str
        Names of the integers that it takes.
    *sources : str
        Folders and modules of the kernel whose code is in it: an edit of any makes another one.
    """

    def __init__(self, module: str, arguments: str, *sources: str):
        self._module, self._arguments, self._sources = module, arguments.split(), sources

    def code(self) -> binary.Native:
        """Return the machine code."""

        def make() -> tuple[str, bytes]:
            from numba import types

            entry = import_module(self._module).entry
            return " ", binary.build(entry, [(types.int64, "i64")] * len(self._arguments), "i64")

        return binary.obtain(store.key(self._module, binary.sources(*self._sources)), make)

    @cached_property
    def _function(self) -> Any:
        return ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * len(self._arguments))(self.code().address)

    def __call__(self, *arguments: int, **named: int) -> int:
        """Call it; missing arguments are 0. The interpreter's lock is released meanwhile.

        What a field in Python raised is raised here, as a `UserError`; the memory holds what was made before.
        """
        rest = [named.get(name, 0) for name in self._arguments[len(arguments) :]]
        outcome = self._function(*arguments, *rest)
        raise_error()
        return outcome


STEPS = ("simd", "native", "context", "tables", "step")

ENTRY = "what ctx side between count times targets parts first out budget"

kernel = Engine("integrators.kernel.step.entry", ENTRY, *STEPS)
implicit = Engine("integrators.kernel.implicit.entry", "ctx place started", *STEPS, "implicit")
line = Engine("integrators.kernel.line.loops", ENTRY, *STEPS, "line")

# What `kernel` and, but for batches, `line` can do; see `integrators.kernel.step.entry`.
RESET, ADVANCE, ADVANCE_BATCH, WALK = range(4)
