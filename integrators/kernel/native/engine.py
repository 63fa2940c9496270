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
    arguments : int
        Integers that it takes.
    *sources : str
        Folders and modules of the kernel whose code is in it: an edit of any makes another one.
    """

    def __init__(self, module: str, arguments: int, *sources: str):
        self._module, self._arguments, self._sources = module, arguments, sources

    def code(self) -> binary.Native:
        """Return the machine code."""

        def make() -> tuple[str, bytes]:
            from numba import types

            entry = import_module(self._module).entry
            return " ", binary.build(entry, [(types.int64, "i64")] * self._arguments, "i64")

        return binary.obtain(store.key(self._module, binary.sources(*self._sources)), make)

    @cached_property
    def _function(self) -> Any:
        return ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * self._arguments)(self.code().address)

    def __call__(self, *arguments: int) -> int:
        """Call it; missing arguments are 0. The interpreter's lock is released meanwhile.

        What a field in Python raised is raised here, as a `UserError`; the memory holds what was made before.
        """
        outcome = self._function(*arguments, *[0] * (self._arguments - len(arguments)))
        raise_error()
        return outcome


STEPS = ("simd", "native", "context", "tables", "step")

kernel = Engine("integrators.kernel.step.entry", 11, *STEPS)
implicit = Engine("integrators.kernel.implicit.entry", 3, *STEPS, "implicit")
line = Engine("integrators.kernel.line.loops", 11, *STEPS, "line")

# What `kernel` and, but for batches, `line` can do; see `integrators.kernel.step.entry`.
RESET, ADVANCE, ADVANCE_BATCH, WALK = range(4)
