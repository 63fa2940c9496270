"""The compiled derivatives of steps in this process."""

from typing import Any

from integrators.kernel.native.engine import Engine
from integrators.kernel.step.engine import SOURCES


def _entry() -> Any:
    from integrators.kernel.tangent.entry import entry  # imports numba

    return entry


follow = Engine(_entry, "operation ctx memory", *SOURCES, "tangent")
"""``follow(what, ctx, tangents)``: see `integrators.kernel.tangent.entry`; the steps call its address."""
