"""The compiled steps of varying length in this process, called with addresses."""

import ctypes
from functools import lru_cache
from typing import Any

from integrators.kernel.native import binary as native
from integrators.kernel.native import store
from integrators.kernel.native.engine import SOURCES
from integrators.kernel.native.foreign import raise_error

# What the entry can do; `loops` has the same numbers.
RESET, VARY, WALK = range(3)


def code() -> native.Native:
    """Return the compiled `loops.entry`, compiled, loaded, or loaded before."""

    def make() -> tuple[str, bytes]:
        from integrators.kernel.step import entry_own as loops  # imports numba

        return " ", loops.build()

    return native.obtain(store.key("adaptive", native.sources(*SOURCES)), make)


@lru_cache(maxsize=1)
def _function() -> Any:
    return ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * 9)(code().address)


def call(
    what: int, ctx: int, *, side: int = 0, between: int = 0, count: int = 0, times: int = 0,
    first: int = 0, out: int = 0, budget: int = 0,
) -> int:  # fmt: skip
    """Call the entry, as `integrators.kernel.native.engine.call` does the kernel's."""
    outcome = _function()(what, ctx, side, between, count, times, first, out, budget)
    raise_error()
    return outcome
