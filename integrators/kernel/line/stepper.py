"""One trajectory of a line integral method, by steps of one length or of varying length: a `Stepper`."""

from typing import Any, ClassVar

from integrators.kernel.context import SIDE
from integrators.kernel.line.engine import steps
from integrators.kernel.line.memory import NOT_KEPT, Trajectory
from integrators.kernel.native.engine import Engine
from integrators.kernel.stepper import AdaptiveStepper, HBVMStepper
from integrators.protocol import Array, Samples, Stats, Status
from integrators.times import Counts


class _OfLine(HBVMStepper):
    """What trajectories of line integral methods have of their own."""

    _program: Any
    _context: Trajectory
    _engine: ClassVar[Engine] = steps
    _state = ("y", "e")
    _arrays = ("previous", "reference", "active")
    _words = (
        "t0", "time_low", "n", "h", "length", "next_length", "length_after", "error_behind", "error_ahead",
        "length_limit", "accepted", "last", "defect",
    )  # fmt: skip

    def _memories(self, y: Array, par: Array, t0: float) -> tuple[Trajectory, Trajectory]:
        made = self._program.memory(y, par, t0)
        return made, made

    @property
    def _wants_solver(self) -> bool:
        return False

    def _set_step(self, h: float) -> None:
        self._context.h = h
        self._context.solved = 0

    def _forget(self) -> None:
        self._context.solved = self._context.accepted = 0

    @property
    def stats(self) -> Stats:
        """Counters of the work done.

        ``extra`` holds: partial steps made; restarts from a bad extrapolation. With
        several invariants also ``"lost"``, how often one had moved in a step by more
        than rounding accounts for (k is then too small), and ``"left_out"``, the names
        of those that follow from others.
        """
        m = self._context
        extra: dict[str, Any] = {"partial_steps": m.partial, "restarts": m.restarts}
        if names := self._program.components:
            extra["lost"] = m.lost
            extra["left_out"] = [n for n, on in zip(names, m.active, strict=True) if not on]
        return Stats(
            steps=m.steps,
            rejections=m.rejections,
            evaluations=m.evaluations,
            iterations=m.iterations,
            solver="fixed point",
            extra=extra,
        )

    def _failure(self, outcome: int) -> tuple[Status, str]:
        if outcome != NOT_KEPT:
            return super()._failure(outcome)
        name = self._program.components[self._context.culprit]
        return Status.NOT_INVARIANT, (
            f"{name} is not an invariant: in the step from t = {self.t!r} the terms of its rate of change "
            f"do not cancel, but leave {self._context.defect:.1e} of their size; leave it out."
        )


class LineStepper(_OfLine):
    """A trajectory of a line integral method, by steps of one length; see `HBVMStepper`.

    Samples made by ``"side"``, partial steps, keep the invariants as own steps do; those of the
    step's polynomial, ``"dense"``, do not. Unlike there a partial step uses the memory of the own
    steps, so that it may change the rounding of those that follow: by up to 4.5e-14 on two bodies
    (``tests/integrators/kernel/line/test_conformance.py``).
    """

    def _run(self, between: int, times: Array, targets: Counts, parts: Array) -> Samples:
        samples = super()._run(between, times, targets, parts)
        if not samples.status.failed or between != SIDE:
            return samples
        # Near a singularity a part of the step that failed may have a solution, far from the trajectory.
        made = samples.t.size
        inside = (targets[:made] == self._context.n) & (parts[:made] != 0.0)
        made -= int(inside.sum())
        return Samples(samples.t[:made], samples.y[:made], samples.status, samples.reason)


class VaryingLineStepper(_OfLine, AdaptiveStepper):
    """A trajectory of a line integral method, by steps of varying length; see `AdaptiveStepper`."""

    def _first_length(self, t0: float) -> None:
        self._context.next_length = self._program.first or 0.0
