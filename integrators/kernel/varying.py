"""A trajectory with adaptive step size."""

import math
import sys
from typing import Any

import numpy as np

from integrators.kernel.context import (
    ANEW,
    ATTEMPT,
    BUDGET,
    DENSE,
    DONE,
    NOISY,
    PARTIAL,
    SLIDING,
    STOP,
    TAKE,
    UNDERFLOW,
    UNSCALED,
    UNSOLVED,
    Context,
)
from integrators.kernel.engines import steps
from integrators.kernel.noise import LENGTHS, Noise
from integrators.kernel.parts.discontinuities import MOST_RECORDED, NOTHING, START
from integrators.kernel.parts.estimate import TOO_NOISY
from integrators.kernel.step.rule import FIRST_AT_REST, RESTART, SCALE_LASTS
from integrators.kernel.stepper import Ended, HBVMStepper, Program
from integrators.options import SHORTEST, SMALLEST
from integrators.protocol import Array, Samples, Status
from integrators.refusals import one_thread
from integrators.running.watchdog import stall_detector

LATEST = sys.float_info.max  # a time beyond all
LOOK_AHEAD = 2000  # steps of the look ahead, at most
MOST_COMPARED = 20000  # of each of the trajectories that tell how errors grow: longer ones tell nothing
LOOK_AGAIN = 2  # times as many steps that were rejected or shortened, and noise is looked for again
LARGER = 1e3  # times as large as a block is, at least, what it will reach is worth knowing
NOISE = 1e-12  # part of what it will reach, for what its growth leaves, that a field's rounding may come to


class AdaptiveStepper(HBVMStepper):
    """A trajectory whose steps vary; satisfies `integrators.protocol.Stepper`.

    The present time is a sum of two doubles. ``advance`` offers every sampling of
    `HBVMStepper`, with the same meaning. The step that would pass a time asked for
    is solved and kept; after a time reached with ``"stop"`` a step of the same
    length is tried again from there.
    """

    _given: Array | None = None  # sizes to take where they are asked for, of one that looks ahead
    _reached: Array | None = None  # times and sizes that it has seen

    def __init__(self, program: Program, y: Array, par: Array, t0: float):
        assert program.adaptive is not None
        self._adaptive, self._breakpoints = program.adaptive, program.adaptive.breakpoints(par)
        self._max_steps = program.plan.max_steps
        self._origin = self._goal = t0
        self._in_vain = 1
        self._known: Noise | None = None
        self._known_at = -1
        self._begins = self._breakpoints.any
        super().__init__(program, y, par, t0)

    def _begin_at_breakpoint(self) -> None:
        """Let the step ahead begin with the values beyond a breakpoint, if one is here."""
        here = self.t
        for point in self._breakpoints.around(here, self._expected_way()):
            if self._is_at(point, here):
                self._begin_beyond(point)

    def _begin_beyond(self, point: float) -> None:
        """Let the step ahead begin where the field may jump."""
        discontinuities = self._context.discontinuities
        discontinuities.boundary, discontinuities.resolution = START, self._breakpoints.resolution(point)

    def _extra(self) -> dict[str, Any]:
        c, context = self._program.constants, self._context
        extra = {**super()._extra(), "k": c.k, "s": c.s}
        if discontinuities := context.discontinuities.count:
            kept = context.discontinuities.records.reshape(-1, 2)[: min(discontinuities, MOST_RECORDED)]
            extra["kinks"] = [(float(t), float(h)) for t, h in kept]
        return extra

    def _one_step(self) -> bool:
        stop = self._context.controller.numbers.stop
        if (
            self._breakpoints.any
            or self._max_steps is not None
            or (math.isfinite(stop) and self._is_at(stop, self.t))
        ):
            return False
        ends, call, _ = self._for_one_step
        ends[0] = LATEST if self._context.controller.next_length > 0.0 else -LATEST
        return self._is_one(self._enter(call), BUDGET)

    def _one_step_call(self, numbers: int, out: int) -> tuple[int | Context, ...]:
        own, partial = self._context, self._partial
        return TAKE, own, partial, PARTIAL, 2, numbers, 0, 0, 0, out, 1

    @one_thread
    def take(self, count: int) -> Samples:
        """Take ``count`` steps and return them."""
        ahead = self._context.controller.next_length > 0.0
        return self.take_steps(LATEST if ahead else -LATEST, limit=count)

    def march(self, end: float, most: int) -> Samples:
        """Take steps, ``most`` at most and none beyond the time ``end``; return them."""
        return self.take_steps(end, limit=most)

    def _advance(self, grid: Array, sample: str) -> Samples:
        if sample == "steps":
            return self.take_steps(float(grid[-1]), present=bool(grid[0] == self.t))
        self._face(float(grid[-1]))
        return self._to(grid, {"stop": STOP, "dense": DENSE}.get(sample, PARTIAL))

    def _stop(self) -> float:
        """Return the next breakpoint ahead, or infinity, and have no step pass it or the end."""
        controller, points, end = self._context.controller.numbers, self._breakpoints, self.destination
        sign, here = 1.0 if controller.next_length > 0.0 else -1.0, self.t
        infinity = stop = sign * math.inf
        if end is None or (end - here) * sign <= 0.0 or self._is_at(end, here):
            end = infinity
        if self._begins:  # how far it is to go is known now, and with it where to look
            self._begins = False
            self._begin_at_breakpoint()
        if points.any:
            ahead = points.ahead(here, end, self._expected_way())
            stop = next((point for point in ahead if not self._is_at(point, here)), infinity)
        breaks = math.isfinite(stop)
        if (end - stop) * sign < 0.0:
            controller.stop, controller.breaks = end, 0
        else:
            controller.stop, controller.breaks = stop, int(breaks)
            controller.resolution = points.resolution(stop)
        return stop

    def _expected_way(self) -> float:
        """Return how far the trajectory is to go, as far as that is known."""
        ahead = math.copysign(1.0, self._context.controller.next_length)
        return ahead * max(ahead * (self._goal - self.t), abs(self._context.controller.next_length)) or ahead

    def _is_at(self, t: float, here: float) -> bool:
        """Whether a time is reached at the present, ``here``; as `kernel.trajectory.vary.remaining`."""
        ctx = self._context
        time_left = (t - here) - ctx.time_low
        return abs(time_left) <= SHORTEST * max(abs(t), abs(here), abs(ctx.controller.previous_length))

    def _renew(self, par: Array) -> None:
        super()._renew(par)
        if self._breakpoints.moved_by(par):
            self._breakpoints = self._adaptive.breakpoints(par)
            self._stop()

    def _restart(self, t: float) -> None:
        """Begin anew at a breakpoint: what is known from before it says nothing about what follows."""
        ctx = self._context
        ctx.t0, ctx.time_low = t, 0.0
        ctx.length = ctx.controller.previous_length = 0.0
        # The step that ended here may have been too short to be followed by one of its length.
        length = ctx.controller.next_length
        ctx.controller.next_length = math.copysign(max(abs(length), RESTART * abs(t)), length)
        ctx.solved = ctx.blocks.age = 0
        self._begin_beyond(t)

    def _take_implicit(self) -> None:
        """Put the implicit solver to work; what the fixed-point iteration allowed does not bind it."""
        super()._take_implicit()
        self._context.implicit.held = 0
        self._context.controller.length_limit = np.inf

    def _face(self, end: float) -> None:
        """Turn towards a time; what lay ahead is forgotten where it lies behind then."""
        ctx = self._context
        if abs(end) < LATEST:
            self._goal = end if self.destination is None else self.destination
            controller = ctx.controller.numbers
            controller.interval = max(
                controller.interval, abs(self._goal - self._origin), abs(end - self._origin)
            )
            self._adaptive.limit(ctx, controller.interval)
        here = self.t
        way = (self._goal if end == here else end) - here
        if way == 0.0 or not math.copysign(1.0, way) * ctx.controller.next_length < 0.0:
            return
        ctx.controller.next_length *= -1.0
        if ctx.pace.code:  # the previous step comes again
            ctx.pace.log_density, ctx.pace.previous_log_density = (
                ctx.pace.previous_log_density,
                ctx.pace.log_density,
            )
            ctx.pace.epsilon *= -1.0
            ctx.controller.next_length = ctx.pace.epsilon * math.exp(-ctx.pace.log_density)
        ctx.discontinuities.boundary = NOTHING
        self._forget()

    def _to(self, times: Array, between: int) -> Samples:
        """Make the samples, piece by piece from one breakpoint to the next."""
        self._watch = stall_detector(self, self.t, float(times[-1]))
        self._stop()
        if not self._breakpoints.any and not self._context.events.act:
            states, outcome, reason = self._fill(between, times)
            return self._samples(times[: len(states)], states, outcome, reason)
        out = np.empty((times.size, self._dim))
        count, outcome, reason = 0, ANEW, None
        while count < times.size and outcome in (DONE, ANEW) and reason is None:
            stop = self._stop()
            beyond = np.flatnonzero((times - stop) * self._context.controller.next_length > 0.0)
            last = int(beyond[0]) if beyond.size and beyond[0] >= count else times.size
            piece = times[count:last]
            meets = last < times.size or times[-1] == stop
            grid = np.append(piece, stop) if meets and (not piece.size or piece[-1] != stop) else piece
            states, outcome, reason = self._fill(between, grid)
            n = min(len(states), piece.size)
            out[count : count + n] = states[:n]
            count += n
            if meets and outcome == DONE and reason is None:
                self._restart(stop)
        return self._samples(times[:count], out[:count], outcome, reason)

    def _handled(self, outcome: int) -> int:
        breakpoints = self._breakpoints
        outcome = super()._handled(outcome)
        if self._breakpoints is not breakpoints:  # an event has moved them
            self._begin_at_breakpoint()
            return ANEW if outcome == BUDGET else outcome
        if outcome == NOISY:
            return self._look_for_noise()
        if outcome != UNSCALED:
            return outcome
        self._look_ahead()
        return BUDGET

    def _look_for_noise(self) -> int:
        """Measure the noise of a field that is called, which may be what keeps steps short; the outcome.

        The run is over where it is known, from here, and more than the tolerance allows.
        """
        ctx = self._context
        estimate, shape = ctx.estimate, ctx.shape
        if estimate.noisy == TOO_NOISY and self._known_at == ctx.counters.steps:
            return NOISY
        self._known = known = self._noise(LENGTHS)
        self._known_at = ctx.counters.steps
        estimate.next_look = LOOK_AGAIN * estimate.troubles
        if not known.values.any():
            estimate.noisy = 0
            outcome = self._enter(steps.prepared(ATTEMPT, ctx))
            return self._handled(BUDGET if outcome == DONE else outcome)
        ctx.solved, ctx.length = UNSOLVED, 0.0
        rows, blocks = slice(-shape.rows, None), ctx.blocks
        estimate.noise[:] = 0.0
        np.maximum.at(estimate.noise, shape.block, known.values[rows] / math.sqrt(ctx.k))
        moved = np.maximum(np.abs(self.y), abs(ctx.h) * np.abs(known.slope))[rows]
        np.maximum.at(estimate.largest, shape.group[shape.block], moved * blocks.speed[shape.block])
        estimate.spacing = math.sqrt(known.relative)
        if not estimate.noisy:  # it was noise that looked like some, and the length was not to blame
            ctx.discontinuities.count = 0
            ctx.controller.next_length, ctx.controller.length_limit = ctx.h, math.inf
        estimate.noisy = 1
        return BUDGET

    def _look_ahead(self) -> None:
        """Let errors be relative to what the blocks will reach, or to their own sizes if that is no more.

        A second trajectory tells it, whose steps only the iteration, the interval and the breakpoints limit.
        Where errors grow, as in y' = y + f(t), what is allowed is less by as much.
        """
        ctx = self._context
        ahead = math.copysign(1.0, ctx.controller.next_length)
        expected = self._expected(ahead) if self._given is None else self._given
        if not (expected > LARGER * ctx.estimate.scale).any():
            ctx.estimate.expected[:] = 0.0
            self._in_vain *= 2
            ctx.estimate.asks = -self._in_vain
            return
        ctx.estimate.expected[:] = expected
        ctx.estimate.rescaled, ctx.blocks.age = SCALE_LASTS, 0
        ctx.controller.next_length = ahead * max(
            FIRST_AT_REST * ctx.controller.interval, abs(ctx.controller.next_length)
        )
        recorded = ctx.discontinuities.records.reshape(-1, 2)[
            : min(ctx.discontinuities.count, MOST_RECORDED), 0
        ]
        if len(recorded) and ahead * (recorded[-1] - self.t) > -FIRST_AT_REST * ctx.controller.interval:
            # By a block's own size; if it is one by this size, it is found again
            ctx.discontinuities.count -= 1

    def _expected(self, ahead: float) -> Array:
        """Return the sizes that errors of the blocks may be relative to."""
        reached = np.empty((0, 1 + self._dim)) if self._reached is None else self._reached
        known = reached[ahead * (reached[:, 0] - self.t) >= 0.0]
        if not len(known) and ahead * (self._goal - self.t) > 0.0:
            scout = self._scout(self.y)
            scout.only_looks()
            known = self._reached = self._seen(scout)
            self._charge(scout)
        sizes = known[:, 1:].max(axis=0, initial=0.0)
        expected = self._of_blocks(sizes)
        if (expected > LARGER * self._context.estimate.scale).any():
            growth = self._growth(known[-1, 0], sizes, expected)
            expected *= min(1.0, max(1.0, NOISE / self._adaptive.tol) / growth)
        return expected

    def _scout(self, y: Array) -> "AdaptiveStepper":
        """Return a trajectory from a state now."""
        scout = AdaptiveStepper(self._program, y, self._context.par.copy(), self.t)
        scout.destination = self._goal
        return scout

    def _seen(self, scout: "AdaptiveStepper") -> Array:
        """Return times and sizes on a trajectory to the goal: its first steps, and the end."""
        pieces = [scout.take_steps(self._goal, limit=LOOK_AHEAD)]
        if not scout.status.failed and scout.stats.steps < LOOK_AHEAD:
            pieces.append(scout.advance([self._goal]))
        return np.concatenate([np.column_stack([samples.t, np.abs(samples.y)]) for samples in pieces])

    def _charge(self, scout: "AdaptiveStepper") -> None:
        """Count the work of a trajectory that looks ahead as this one's."""
        counters, work = self._context.counters, scout.stats
        counters.evaluations += work.evaluations or 0
        counters.iterations += work.iterations or 0
        counters.partial_evaluations += work.extra["partial_evaluations"]
        counters.partial_iterations += work.extra["partial_iterations"]

    def _of_blocks(self, sizes: Array) -> Array:
        """Return the largest of the sizes of components in each block."""
        shape = self._context.shape
        largest = np.zeros(shape.group.size)
        np.maximum.at(largest, shape.block, sizes[-shape.rows :])
        return largest

    def _growth(self, end: float, sizes: Array, expected: Array) -> float:
        """Return how many times as large a small error becomes by ``end``, at most, beside what is reached.

        Two trajectories tell it whose errors are relative to that, one of them from a state that is moved.
        """
        nudge = math.sqrt(max(self._adaptive.tol, SMALLEST))
        moved = np.random.default_rng(0).choice([-1.0, 1.0], sizes.size)
        times = np.linspace(self.t, end, 65)[1:]
        states = []
        for shift in (0.0, nudge):
            scout = self._scout(self.y + shift * moved * sizes)
            scout._given = scout._context.estimate.expected[:] = expected
            scout._context.estimate.rescaled = SCALE_LASTS
            scout._max_steps = min(MOST_COMPARED, self._max_steps or MOST_COMPARED)
            samples = scout.advance(times)
            self._charge(scout)
            states.append(samples.y)
        count = min(map(len, states))
        if count < len(times):
            return math.inf
        apart = np.abs(states[0] - states[1]) / np.where(sizes > 0.0, sizes, math.inf)
        largest = np.maximum(np.append(nudge, apart.max(axis=1)), nudge**1.5)
        return float((largest / np.minimum.accumulate(largest)).max())

    def only_looks(self) -> None:
        """Take steps whatever their errors are."""
        ctx = self._context
        ctx.controller.allowed_error = ctx.controller.allowed_quadrature_error = ctx.controller.error_aim = (
            ctx.discontinuities.doubt
        ) = math.inf
        ctx.estimate.asks = 0

    def _budget(self, most: int | None = None) -> int:
        """Return how many of ``most`` steps the kernel may take at a time, and of those left."""
        most = min(self._watch.steps_to_next_look if most is None else most, self._pace.steps)
        if self._max_steps is None:
            return most
        return max(0, min(most, self._max_steps - self._taken))

    def _ended(self, steps: int) -> Ended | None:
        most = self._max_steps
        if most is not None and self._taken >= most and not self._wants_solver:
            return Status.MAX_STEPS, (
                f"max_steps={most} steps came to t = {self.t!r} only; give more, or a looser tol."
            )
        reason = self._watch.update(self.t, steps, float(np.abs(self.y).max()))
        return (Status.STALLED, reason) if reason else None

    @one_thread
    def take_steps(
        self, end: float, *, limit: int | None = None, longest: float = math.inf, present: bool = False
    ) -> Samples:
        """Take steps, none beyond the time ``end``, and return them.

        Parameters
        ----------
        end : float
            The time to integrate to; the step that would pass it is solved, kept and not taken.
        limit : int, optional
            The largest number of steps.
        longest : float
            Length that no step exceeds, > 0. A finite one costs a call of the kernel for each step.
        present : bool
            Whether the present state is to come first.
        """
        pieces = [(np.array([self.t]), self.y[np.newaxis])] if present else []
        if present and self._vectors:
            self._vectors.note_now(self.t)
        self._face(end)
        outcome, steps, reason, ctx = BUDGET, 0, None, self._context
        self._watch = stall_detector(self, self.t, end)
        while outcome == BUDGET and (limit is None or steps < limit) and reason is None:
            # fewer come where the implicit solver is made
            n = self._budget(None if limit is None else limit - steps)
            if longest < math.inf:
                n = min(n, 1)
                ctx.controller.next_length = np.clip(ctx.controller.next_length, -longest, longest)
            stop = self._stop()
            passes = (end - stop) * ctx.controller.next_length >= 0.0
            times, out = np.full(n + 1, stop if passes else end), np.empty((n + 1, self._dim))
            if self._vectors:
                self._vectors.room(n + 1)
            outcome = self._call(TAKE, PARTIAL, times, out, 0, n)
            outcome = BUDGET if outcome == ANEW else outcome
            count = self._context.samples_written
            steps += count
            pieces.append((times[:count], out[:count]))
            if math.isfinite(stop) and self._is_at(stop, self.t):
                if outcome == DONE and stop != end:
                    outcome = BUDGET
                times[count - 1 : count] = stop
                self._restart(stop)
            elif outcome == BUDGET and (n == 0 or (limit is None and self._budget(1))):
                reason = self._ended(count)
            if self._vectors:
                self._vectors.note(times[:count])
        t, y = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
        return self._samples(t, y, DONE if outcome == BUDGET else outcome, reason)

    def _failure(self, outcome: int) -> tuple[Status, str]:
        """Return the status that an outcome stands for, and the reason as a sentence."""
        longest = self._program.plan.max_step
        if outcome == UNDERFLOW and longest is not None and longest <= SHORTEST * abs(self.t):
            return Status.STEP_UNDERFLOW, (
                f"a step of max_step={longest!r} from t = {self.t!r} cannot be told from none; give more."
            )
        ahead = self._context.controller.next_length
        if outcome == UNDERFLOW and self._context.pace.code and (ahead == 0.0 or not math.isfinite(ahead)):
            return Status.STEP_UNDERFLOW, (
                "steps='reversible' follow the time scale of the field, and this one has none at "
                f"t = {self.t!r}; leave it out."
            )
        if outcome == UNDERFLOW:
            return Status.STEP_UNDERFLOW, (
                f"no step from t = {self.t!r} is short enough for tol={self._adaptive.tol!r}; "
                "the solution may end or be singular here."
            )
        if outcome == NOISY:
            assert self._known is not None
            return self._known.ends(self.t, self._context.h)
        if outcome == SLIDING:
            return Status.SLIDING, (
                f"on both sides of the switching surface that is reached at t = {self.t!r} the field points "
                "to it: the trajectory slides along it or sticks there, as by dry friction, and the formulas "
                "do not say how it goes on."
            )
        return super()._failure(outcome)
