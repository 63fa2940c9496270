"""The compiled loop over groups in this process."""

from typing import Any

from integrators.kernel.native.engine import Engine

SOURCES = ("simd", "native", "ensemble")


def _run() -> Any:
    from integrators.kernel.ensemble.loop import run  # imports numba

    return run


run = Engine(_run, "group side budget", *SOURCES)
"""``run(group, side, budget)``: see `integrators.kernel.ensemble.loop`."""
