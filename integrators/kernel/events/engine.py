"""The compiled search for events in this process."""

from typing import Any

from integrators.kernel.native.engine import Engine
from integrators.kernel.step.engine import SOURCES


def _entry() -> Any:
    from integrators.kernel.events.entry import entry  # imports numba

    return entry


look = Engine(_entry, "ctx search", *SOURCES, "events")
"""``look(ctx, search)``: see `integrators.kernel.events.entry`; the steps call its address too."""
