"""The compiled steps of varying length in this process, called with addresses."""

import ctypes
from functools import lru_cache
from typing import Any

from integrators.kernel import native, store
from integrators.kernel.engine import SOURCES as KERNEL
from integrators.kernel.foreign import raise_error

# The modules whose code is in it: an edit of any of them makes another one.
SOURCES = (
    *KERNEL,
    "control",
    "line/views",
    *(f"adaptive/{name}" for name in ("estimate", "kinks", "steps", "loops")),
)

# What the entry can do; `loops` has the same numbers.
RESET, VARY, WALK = range(3)


def code() -> native.Native:
    """Return the compiled `loops.entry`, compiled, loaded, or loaded before."""

    def make() -> tuple[str, bytes]:
        from integrators.kernel.adaptive import loops  # imports numba

        return " ", loops.build()

    return native.obtain(store.key("adaptive", native.sources(*SOURCES)), make)


@lru_cache(maxsize=1)
def _function() -> Any:
    return ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * 9)(code().address)


def call(
    what: int, ctx: int, *, side: int = 0, between: int = 0, count: int = 0, times: int = 0,
    first: int = 0, out: int = 0, budget: int = 0,
) -> int:  # fmt: skip
    """Call the entry, as `integrators.kernel.engine.call` does the kernel's."""
    outcome = _function()(what, ctx, side, between, count, times, first, out, budget)
    raise_error()
    return outcome
