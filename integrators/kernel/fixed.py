"""A trajectory with fixed step size."""

import numpy as np
from numpy.typing import ArrayLike

from integrators.kernel.context import DENSE, DONE, PARTIAL, STOP
from integrators.kernel.native import engine
from integrators.kernel.stepper import HBVMStepper
from integrators.protocol import Array, Samples, Status
from integrators.refusals import check_state, one_thread
from integrators.running.times import Counts, plan


class FixedStepper(HBVMStepper):
    """A trajectory of HBVM(k, s) with fixed step size; see `HBVMStepper`.

    The present time is ``t0 + n h`` with an integer n, never an accumulated sum.
    """

    @one_thread
    def single(self, y: ArrayLike, t0: float, t: float) -> Samples:
        """Begin anew at (t0, y) and return the state at ``t``, made by a single step of that length.

        The counters keep counting.

        Raises
        ------
        problems.errors.InputError
            If ``y`` is not finite or not of the system's length.
        """
        start = check_state(y, self._dim)
        if self._context.h != self._program.h:
            self._set_step(self._program.h)
        self._begin(start, t0)
        self._status, self._reason, self.error = Status.RUNNING, "", None
        return self._make(STOP, np.array([t]), np.zeros(1, dtype=np.int64), np.array([t - t0]))

    def _one_step(self) -> bool:
        (numbers, _, place, out), ctx = self._room, self._context
        target = numbers.view(np.int64)[:1]
        target[0] = ctx.n + 1
        # its time and the part of a step beyond it are of no account: 0.0
        own, partial = ctx.address, self._partial.address
        outcome = self._enter(
            engine.ADVANCE, own, partial, PARTIAL, 1, place + 8, place, place + 8, 0, out, 1
        )
        return self._is_one(outcome, DONE)

    @one_thread
    def take(self, count: int) -> Samples:
        """Take ``count`` steps and return them."""
        ctx = self._context
        targets = ctx.n + np.arange(1, count + 1)
        times = np.asarray(ctx.t0 + targets * ctx.h, dtype=np.float64)
        return self._make(PARTIAL, times, targets, np.zeros(count))

    @one_thread
    def march(self, end: float, most: int) -> Samples:
        """Take steps, ``most`` at most and none beyond the time ``end``; return them."""
        ctx = self._context
        if (end - self.t) * ctx.h < 0.0:
            self._turn(self.t)
        targets, _ = plan(np.array([end]), np.array([ctx.t0]), ctx.h)
        return self.take(min(most, int(targets[0]) - ctx.n))

    def _advance(self, grid: Array, sample: str) -> Samples:
        ctx = self._context
        t0, n, h = ctx.t0, ctx.n, ctx.h
        turn = (grid[-1] - self.t) * h < 0.0
        if turn:  # steps are counted from here
            t0, n, h = self.t, 0, -h
        between = {"stop": STOP, "dense": DENSE}.get(sample, PARTIAL)
        bases = np.full(grid.size, t0)
        if sample == "stop":
            bases[1:] = grid[:-1]
        targets, parts = plan(grid, bases, h)
        if sample == "steps":
            targets = np.arange(n + (grid[0] != self.t), targets[-1] + 1)
            grid, parts = t0 + targets * h, np.zeros(targets.size)
        if turn:
            self._turn(t0)
        return self._make(between, grid, targets, parts)

    def _turn(self, t0: float) -> None:
        """Reverse the direction, here, at time ``t0``; what lay ahead lies behind and is forgotten."""
        ctx = self._context
        ctx.t0, ctx.n = t0, 0
        self._set_step(-ctx.h)
        self._forget()

    def _make(self, between: int, times: Array, targets: Counts, parts: Array) -> Samples:
        """Make the samples that are ``parts`` beyond the steps number ``targets``."""
        states, outcome, why = self._fill(between, times, targets, parts)
        return self._samples(times[: len(states)], states, outcome, why)
