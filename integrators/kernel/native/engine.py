"""The compiled kernel in this process, called with addresses."""

import ctypes
from functools import lru_cache
from typing import Any

from integrators.kernel.native import binary as native
from integrators.kernel.native import store
from integrators.kernel.native.foreign import raise_error

# Whose code is in the kernel: an edit of any of them makes another kernel.
SOURCES = ("simd", "native", "layout", "step")

# What the entry can do; `loops` has the same numbers.
ADVANCE, ADVANCE_BATCH, RESET = range(3)


def kernel() -> native.Native:
    """Return the kernel, ``int64(int64, ... eleven in all)``, compiled, loaded, or loaded before."""

    def make() -> tuple[str, bytes]:
        from integrators.kernel.step import advance as loops  # imports numba

        return " ", loops.build()

    return native.obtain(store.key("kernel", native.sources(*SOURCES)), make)


@lru_cache(maxsize=1)
def _function() -> Any:
    return ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * 11)(kernel().address)


def call(what: int, *arguments: int) -> int:
    """Call the kernel; missing arguments are 0. The interpreter's lock is released meanwhile.

    What a field in Python raised is raised here, as a `UserError`; the memory holds what was made before.
    """
    outcome = _function()(what, *arguments, *[0] * (10 - len(arguments)))
    raise_error()
    return outcome
