"""The compiled steps in this process."""

from typing import Any

from integrators.kernel.native.engine import ENTRY, Engine

SOURCES = ("simd", "native", "parts", "context", "tables", "step")


def _entry() -> Any:
    from integrators.kernel.step.entry import entry  # imports numba

    return entry


steps = Engine(_entry, ENTRY, *SOURCES)
"""``steps(what, ctx, ...)``: see `integrators.kernel.step.entry`."""
