"""A trajectory with fixed step size."""

import math
from time import perf_counter
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from integrators.kernel.context import ADVANCE, ANEW, BUDGET, DENSE, DONE, PARTIAL, STOP, Context
from integrators.kernel.stepper import Ended, HBVMStepper
from integrators.protocol import Array, Samples, Status
from integrators.refusals import check_state, one_thread
from integrators.running.times import plan, rest

MOST = 1 << 60  # steps or samples
ROUNDINGS = 4  # units in the last place of time by which a step may seem to pass the end
FEW, GROWTH = 64, 4  # of them that are planned at a time after an event, and how these become more


class FixedStepper(HBVMStepper):
    """A trajectory of HBVM(k, s) with fixed step size; see `HBVMStepper`.

    The present time is ``t0 + n h`` with an integer n, never an accumulated sum; where steps of another
    length begin, ``t0`` is a sum of two doubles. An event that changes the state is where the steps are
    counted from: ``t0`` is its time.
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
        times = np.array([t])
        states, outcome, reason = self._fill(STOP, times, np.zeros(1, dtype=np.int64), times - t0)
        return self._samples(times[: len(states)], states, outcome, reason)

    def _one_step(self) -> bool:
        if abs(self._context.h) != self._program.h:
            return False
        numbers, call, _ = self._for_one_step
        numbers.view(np.int64)[0] = self._context.n + 1
        return self._is_one(self._enter(call), DONE)

    def _one_step_call(self, numbers: int, out: int) -> tuple[int | Context, ...]:
        own, partial = self._context, self._partial
        # The time and the part of a step beyond it are of no account: 0.0.
        return ADVANCE, own, partial, PARTIAL, 1, numbers + 8, numbers, numbers + 8, 0, out, 1

    @one_thread
    def take(self, count: int) -> Samples:
        """Take ``count`` steps and return them."""
        self._restore_length()
        return self._steps(self._context.n + 1, None, count)

    @one_thread
    def march(self, end: float, most: int) -> Samples:
        """Take steps, ``most`` at most and none beyond the time ``end``; return them."""
        self._restore_length()
        if (end - self.t) * self._context.h < 0.0:
            self._turn()
        return self._steps(self._context.n + 1, end, most)

    def _advance(self, grid: Array, sample: str) -> Samples:
        self._restore_length()
        t = self.t
        goal = self.destination if self.destination is not None and grid[-1] == t else grid[-1]
        if (goal - t) * self._context.h < 0.0:
            self._turn()
        if sample == "steps":
            return self._steps(self._context.n + int(grid[0] != self.t), float(grid[-1]))
        return self._to(grid, {"stop": STOP, "dense": DENSE}.get(sample, PARTIAL))

    def _to(self, grid: Array, between: int) -> Samples:
        """Make the samples at some times; steps are counted from each event that changes the state."""
        ctx, pieces, done, outcome, reason = self._context, [], 0, ANEW, None
        size, late = self._first_piece, perf_counter() + self.time_limit
        while outcome == ANEW or (outcome == DONE and done < grid.size):
            if done and perf_counter() > late:
                outcome = BUDGET
                break
            piece = grid[done : done + size]
            bases, low = np.full(piece.size, ctx.t0), np.full(piece.size, ctx.time_low)
            if between == STOP:
                bases[1:], low[1:] = piece[:-1], 0.0
            steps, parts = plan(piece, bases, ctx.h, low)
            if between != STOP and parts[-1] and self._passes_end(steps[-1] + 1):
                whole = int(
                    np.searchsorted(steps, steps[-1]) + np.count_nonzero(parts[steps == steps[-1]] == 0.0)
                )
                if not whole:
                    outcome, reason = self._shorten(int(steps[-1]))
                    continue
                piece, steps, parts = piece[:whole], steps[:whole], parts[:whole]
            states, outcome, reason = self._fill(between, piece, steps, parts)
            pieces.append(states)
            done += len(states)
            size = FEW if outcome == ANEW else GROWTH * size
        states = pieces[0] if len(pieces) == 1 else np.concatenate([np.empty((0, self._dim)), *pieces])
        return self._samples(grid[:done], states, outcome, reason)

    def _passes_end(self, step: int) -> bool:
        """Whether a step of a certain number ends beyond the end of the whole integration."""
        ctx, end = self._context, self.destination
        if end is None or (end - self.t) * ctx.h <= 0.0:
            return False
        last = ctx.t0 + step * ctx.h
        return (last - end) * ctx.h > 0.0 and abs(last - end) > ROUNDINGS * math.ulp(
            max(abs(last), abs(ctx.t0))
        )

    def _shorten(self, last: int) -> tuple[int, Ended | None]:
        """Go to step number ``last``, and let the next one end at the end; return how that went."""
        ctx, outcome, reason = self._context, ANEW, None
        if ctx.n < last:
            _, outcome, reason = self._fill(
                PARTIAL, np.array([ctx.t0 + last * ctx.h]), np.array([last]), np.zeros(1)
            )
            if outcome != DONE or reason is not None:
                return outcome, reason
        assert self.destination is not None
        self._count_from_here()
        self._set_step(self._time_left(self.destination))
        return ANEW, reason

    def _restore_length(self) -> None:
        """Go on with steps of the usual length if the last one was shortened."""
        ctx, end = self._context, self.destination
        if abs(ctx.h) != self._program.h and (ctx.n or end is None or self._time_left(end) != ctx.h):
            self._count_from_here()
            self._set_step(math.copysign(self._program.h, ctx.h))

    def _time_left(self, end: float) -> float:
        """Return the time from the present to a later one, rounded once."""
        ctx = self._context
        return rest(end, ctx.t0, ctx.n, ctx.h, ctx.time_low)

    def _count_from_here(self) -> None:
        """Count steps from the present on; what lay ahead is forgotten, since others will come."""
        ctx, t = self._context, self.t
        ctx.t0, ctx.time_low, ctx.n = t, -self._time_left(t), 0
        self._forget()

    def _steps(self, first: int, end: float | None, most: int = MOST) -> Samples:
        """Take steps from number ``first`` on, ``most`` at most and none beyond ``end``; return them.

        An event that changes the state ends a step; the next has the number 1.
        """
        ctx, times, states = self._context, [], []
        size, outcome, reason, over = self._first_piece, DONE, None, False
        while not over:
            final, last_part = first + most - 1, 0.0
            if end is not None:
                (count,), (part,) = plan(np.array([end]), np.array([ctx.t0]), ctx.h, ctx.time_low)
                final, last_part = (int(count), part) if count < final else (final, 0.0)
            last = min(final, first + size - 1)
            targets = np.arange(first, last + 1)
            t: Array = np.asarray(ctx.t0 + targets * ctx.h, dtype=np.float64)
            parts = np.zeros(targets.size)
            between, at = PARTIAL, t
            # What is left of the time is looked at for events that change the state; the sample is none.
            rest = end is not None and bool(ctx.events.act and last_part and last == final)
            shorter = rest and self._passes_end(last + 1)
            if rest and not shorter:
                between, at = DENSE, np.append(t, cast("float", end))
                targets, parts = np.append(targets, last), np.append(parts, last_part)
            new, outcome, reason = self._fill(between, at, targets, parts)
            if shorter and outcome == DONE and reason is None:
                outcome, reason = self._look_at_rest(cast("float", end))
            times.append(t[: len(new)])
            states.append(new[: t.size])
            most -= len(states[-1])
            if outcome == ANEW:
                times.append(np.array([ctx.t0]))
                states.append(ctx.read()[np.newaxis])
                first, most, size = 1, most - 1, FEW
            else:
                first, size, over = last + 1, GROWTH * size, outcome != DONE or last == final
        if len(times) == 1:
            return self._samples(times[0], states[0], outcome, reason)
        return self._samples(np.concatenate(times), np.concatenate(states), outcome, reason)

    @property
    def _first_piece(self) -> int:
        """How many samples or steps are planned at first: few where an event may change the plan."""
        return FEW if self._context.events.act else MOST

    def _look_at_rest(self, end: float) -> tuple[int, Ended | None]:
        """Look for events that change the state in a step to the end, which stays ahead if there is none."""
        h = self._context.h
        self._count_from_here()
        self._set_step(self._time_left(end))
        part = np.array([self._context.h])
        _, outcome, reason = self._fill(DENSE, np.array([end]), np.zeros(1, dtype=np.int64), part)
        if outcome == ANEW:
            self._set_step(h)
        return outcome, reason

    def _turn(self) -> None:
        """Reverse the direction, here."""
        ctx = self._context
        self._count_from_here()
        self._set_step(-math.copysign(self._program.h, ctx.h))
        ctx.events.acted = -math.copysign(math.inf, ctx.h)  # the same event may happen on the way back
