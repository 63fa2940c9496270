"""The compiled steps of line integral methods in this process."""

from typing import Any

from integrators.kernel.native.engine import ENTRY, Engine
from integrators.kernel.step.engine import SOURCES


def _entry() -> Any:
    from integrators.kernel.line.loops import entry  # imports numba

    return entry


steps = Engine(_entry, ENTRY, *SOURCES, "line")
"""``steps(what, ctx, ...)``, as `integrators.kernel.step.engine.steps`."""
