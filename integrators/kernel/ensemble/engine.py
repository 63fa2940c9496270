"""The compiled loops over groups in this process."""

from typing import Any

from integrators.kernel.native.engine import Engine

SOURCES = ("simd", "native", "ensemble")


def _run() -> Any:
    from integrators.kernel.ensemble.loop import run  # imports numba

    return run


run = Engine(_run, "group partial budget", *SOURCES, "step/rule", "step/sums")
"""``run(group, partial, budget)``: see `integrators.kernel.ensemble.loop`."""


def _run_own() -> Any:
    from integrators.kernel.ensemble.own import run

    return run


run_own = Engine(
    _run_own, "group budget", *SOURCES, "parts", "context", "tables", "step", "events", "../running/watchdog"
)
"""``run_own(group, budget)``: see `integrators.kernel.ensemble.own`."""
