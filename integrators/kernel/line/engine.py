"""The compiled line integrals in this process."""

from typing import Any

from integrators.kernel.native.engine import Engine
from integrators.kernel.step.engine import SOURCES


def _entry() -> Any:
    from integrators.kernel.line.entry import entry  # imports numba

    return entry


line = Engine(_entry, "operation ctx", *SOURCES, "line")
"""Its address is what the steps call where there is a `integrators.kernel.context.Context.line`."""
