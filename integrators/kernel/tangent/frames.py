"""Tangent vectors that are made orthonormal after each round of steps, as Python sees them."""

import math
from typing import Any

import numpy as np

from integrators.kernel.context import ANEW, BUDGET, DONE
from integrators.kernel.engines import orthonormal, steps
from integrators.kernel.tangent.memory import TOO_FAR_APART, TOO_LONG, Frame
from integrators.protocol import Array, Status
from integrators.running.times import plan
from integrators.running.watchdog import stall_detector

FIRST = 16  # steps of the first round
ROUNDS = 64  # from one checkpoint to the next, at most: one takes the time of a short round
ALL = 1 << 40


class Frames:
    """Rounds of steps of a trajectory, whose tangent vectors are made orthonormal after each.

    Parameters
    ----------
    stepper : HBVMStepper
        At the trajectory's start; the vectors follow it already, and its step goes to the last mark.
    frame : ndarray, shape (dim, n)
        These vectors.
    marks : ndarray, shape (m,)
        Times, ascending; no round goes beyond the next of them.
    divergence : bool
        Whether the divergence is integrated too: of as many vectors as components, of systems that are not
        canonical.

    Attributes
    ----------
    ends : ndarray, shape (m,)
        The end of the last step in each of the intervals up to the marks; NaN where there is none.
    states : ndarray, shape (m, dim)
        The trajectory's states there.
    growth : ndarray, shape (m, n)
        The logarithms of the diagonal of R, added up in each of them.
    divergence : ndarray, shape (m,)
        The integral of the field's divergence over each of them, where it was asked for.
    rounds : int
        How many there were.
    """

    def __init__(self, stepper: Any, frame: Array, marks: Array, *, divergence: bool):
        self._stepper, self._context, self._passed = stepper, stepper._context, -math.inf
        self._marks = np.ascontiguousarray(marks)
        ctx, (dim, count) = self._context, frame.shape
        if ctx.varying:
            stepper._face(float(marks[-1]))
        self.ends, self.growth = np.full(marks.size, np.nan), np.zeros((marks.size, count))
        self.states = np.empty((marks.size, dim))
        self._sums = [self.growth, np.zeros_like(self.growth), np.zeros(marks.size), np.zeros(marks.size)]
        self.divergence = self._sums[2]
        targets = marks if ctx.varying else plan(marks, np.full(marks.size, ctx.t0), ctx.h, ctx.time_low)[0]
        memory = self._memory = Frame(
            {
                "dim": dim,
                "count": count, "intervals": marks.size, "stop": math.inf, "has_divergence": int(divergence),
                "wanted": FIRST, "most": ALL, "longest": ctx.controller.longest,
            },
            {
                "marks": self._marks, "ends": self.ends, "end_states": self.states, "growth": self.growth,
                "growth_low": self._sums[1], "divergence": self._sums[2], "divergence_low": self._sums[3],
                **({} if ctx.varying else {"targets": np.ascontiguousarray(targets, dtype=np.int64)}),
            },
        )  # fmt: skip
        memory.trajectory, memory.partial, memory.tangents = ctx, stepper._partial, stepper._vectors.memory
        memory.steps = steps.code()
        memory.times, memory.states = np.zeros(2), np.zeros((2, dim))
        memory.step_targets, memory.parts = np.zeros(1, dtype=np.int64), np.zeros(1)

    @property
    def rounds(self) -> int:
        """How many there were."""
        return self._memory.rounds

    def go_on(self) -> tuple[Status, str]:
        """Take rounds to the last mark; return how that ended. After Ctrl-C, what was computed is kept."""
        stepper, memory, ctx = self._stepper, self._memory, self._context
        saved, apart = self._saved(), ROUNDS
        stepper._watch = stall_detector(stepper, stepper.t, float(self._marks[-1]))
        while memory.interval < memory.intervals:
            if stepper.t > self._passed:
                memory.most = ALL
            if memory.taken == 0 and memory.rounds >= saved[1][1] + apart:
                saved, apart = self._saved(), min(2 * apart, ROUNDS)
            memory.rounds_left = max(saved[1][1] + apart - memory.rounds, 1)
            before = ctx.counters.steps
            outcome = self._call()
            if outcome in (TOO_FAR_APART, TOO_LONG):
                if outcome == TOO_FAR_APART:
                    if memory.taken == 1:
                        where = f"in the step to t = {stepper.t!r}"
                        return Status.NOT_FINITE, f"{where} vectors grow too differently; take shorter steps."
                    memory.most = min(memory.most, memory.taken // 2)
                    self._passed = max(self._passed, stepper.t)
                # where rounds are often repeated, the rounds since the last checkpoint cost more than it
                apart = max(apart // 4, 1)
                self._back_to(saved)
                if outcome == TOO_LONG:
                    stepper._forget()  # the step ahead, which may be solved there
            elif outcome not in (DONE, BUDGET):
                return stepper._failure(outcome)
            elif (ended := stepper._ended(ctx.counters.steps - before)) is not None:
                return ended
        return Status.FINISHED, ""

    def _call(self) -> int:
        """Call the kernel once."""
        memory, stepper = self._memory, self._stepper
        memory.stop = stepper._stop() if self._context.varying else math.inf
        memory.budget = max(stepper._budget(), 1)
        if stepper._wants_solver:
            stepper._provide_solver()
        with stepper._pace:
            outcome = orthonormal(memory)
        if outcome in (TOO_FAR_APART, TOO_LONG):
            return outcome
        outcome = stepper._handled(outcome)
        if outcome == ANEW:
            stepper._restart(memory.stop)
            return BUDGET
        return outcome

    def _saved(self) -> tuple[Any, tuple[int, ...], float, list[Array]]:
        """Return what `_back_to` needs."""
        memory, i = self._memory, self._memory.interval
        numbers = i, memory.rounds, memory.wanted
        return (
            self._stepper.checkpoint(),
            numbers,
            float(self.ends[i]),
            [part[i].copy() for part in self._sums],
        )

    def _back_to(self, saved: tuple[Any, tuple[int, ...], float, list[Array]]) -> None:
        """Go back to a checkpoint."""
        memory = self._memory
        checkpoint, (i, memory.rounds, memory.wanted), end, sums = saved
        memory.interval, memory.taken = i, 0
        self._stepper.restore(checkpoint)
        self.ends[i:] = np.nan
        self.ends[i] = end
        for part, kept in zip(self._sums, sums, strict=True):
            part[i:] = 0.0
            part[i] = kept
