"""The compiled steps in this process, called with addresses."""

import ctypes
from functools import lru_cache
from typing import Any

from integrators.kernel.native import binary as native
from integrators.kernel.native import store

# The modules whose code is in the kernel: an edit of any of them makes another kernel.
SOURCES = ("simd", "native", "step", "line")


def kernel() -> native.Native:
    """Return the compiled steps: `loops.entry`, compiled, loaded, or loaded before."""

    def make() -> tuple[str, bytes]:
        from integrators.kernel.line import loops  # imports numba

        return " ", loops.build()

    return native.obtain(store.key("line", native.sources(*SOURCES)), make)


@lru_cache(maxsize=1)
def entry() -> Any:
    """Return `loops.entry` as a function of Python numbers; the interpreter's lock is released meanwhile."""
    return ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * 10, ctypes.c_double)(kernel().address)
