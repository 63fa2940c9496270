"""The compiled record of steps, and their adjoints, in this process."""

from typing import Any

from integrators.kernel.native.engine import Engine
from integrators.kernel.step.engine import SOURCES


def _record() -> Any:
    from integrators.kernel.adjoint.entry import record  # imports numba

    return record


def _pull() -> Any:
    from integrators.kernel.adjoint.entry import pull

    return pull


record = Engine(_record, "event ctx tape", *SOURCES, "adjoint")
"""``record(event, ctx, tape)``: see `integrators.kernel.adjoint.entry`; the steps call its address."""
pull = Engine(_pull, "ctx pullback", *SOURCES, "adjoint")
"""``pull(ctx, pullback)``: see `integrators.kernel.adjoint.entry`."""
