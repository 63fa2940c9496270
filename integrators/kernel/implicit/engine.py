"""The compiled implicit solver in this process."""

from typing import Any

from integrators.kernel.native.engine import Engine
from integrators.kernel.step.engine import SOURCES


def _entry() -> Any:
    from integrators.kernel.implicit.entry import entry  # imports numba

    return entry


solver = Engine(_entry, "ctx memory started", *SOURCES, "implicit")
"""Its address is what `integrators.kernel.step.solver_switch` calls."""
