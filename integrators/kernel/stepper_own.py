"""One trajectory of HBVM(k, s) with steps of varying length."""

import math
import sys
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from integrators.kernel import layout
from integrators.kernel.native import engine_own as engine
from integrators.kernel.stepper import WORDS, Checkpoint, HBVMStepper
from integrators.one_thread import one_thread
from integrators.options import SHORTEST
from integrators.protocol import SAMPLINGS, Array, Samples, Stats, Status, UserError, check_times
from integrators.watchdog import Crawl
from problems.errors import unknown

if TYPE_CHECKING:
    from integrators.kernel.program_own import AdaptiveProgram

RESTART = 256 * SHORTEST  # of the time: a step after a breakpoint is tried with this length at least

Ended = tuple[Status, str]  # how a run is over before its end, and the reason as a sentence

# What a checkpoint holds besides that of steps of one length.
MORE_WORDS = (
    layout.TIME_LOW, layout.NEXT_LENGTH, layout.LENGTH_AFTER, layout.LENGTH_BEHIND,
    layout.ERROR_BEHIND, layout.ERROR_AHEAD, layout.DEFECT_BEHIND, layout.DEFECT_AHEAD,
    layout.LENGTH_LIMIT, layout.LOG_RATE, layout.KINKS, layout.KINK_END, layout.DOUBT_END,
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class AdaptiveCheckpoint(Checkpoint):
    """All that the continuation of an `AdaptiveStepper` depends on."""

    ahead: tuple[Array, Array]
    places: Array  # of kinks
    taken: int  # steps since the trajectory's start


class AdaptiveStepper(HBVMStepper):
    """A trajectory whose steps vary; satisfies `integrators.protocol.Stepper`.

    The present time is a sum of two doubles. ``advance`` offers every sampling of
    `HBVMStepper`, with the same meaning. The step that would pass a time asked for
    is solved and kept; after a time reached with ``"land"`` a step of the same
    length is tried again from there.
    """

    _program: "AdaptiveProgram"
    _kind = AdaptiveCheckpoint

    def _begin(self, y: Array, t0: float) -> None:
        """Put the trajectory at its start."""
        reals = self._context.reals
        self._uncounted = int(self._context.words[layout.STEPS])  # steps that are not of this trajectory
        reals[layout.T0] = reals[layout.DOUBT_END] = t0
        reals[layout.NEXT_LENGTH] = self._program.first or 0.0
        engine.call(engine.RESET, self._context.address, out=y.ctypes.data)

    @property
    def t(self) -> float:
        """Time of the last own step."""
        return float(self._context.reals[layout.T0])

    @property
    def stats(self) -> Stats:
        """Counters of the work done, as `HBVMStepper.stats`; ``extra`` has the method's k and s too.

        And, where the field jumps or has a kink, ``"kinks"``: pairs (t, h), the place that a
        step had to be cut for and the length at which it was found, of the first 64 places.
        """
        stats, c, context = super().stats, self._program.constants, self._context
        extra = {**stats.extra, "k": c.k, "s": c.s}
        if found := int(context.words[layout.KINKS]):
            kept = context["KINK_PLACES"].reshape(-1, 2)[: min(found, layout.KINKS_KEPT)]
            extra["kinks"] = [(float(t), float(h)) for t, h in kept]
        return replace(stats, rejections=int(context.words[layout.REJECTIONS]), extra=extra)

    @one_thread
    def step(self) -> Status:
        """Take one step; after a failure, do nothing."""
        if not self._status.failed:
            self.take(1)
        return self._status

    @one_thread
    def take(self, count: int) -> Samples:
        """Take ``count`` own steps and return them."""
        ahead = self._context.reals[layout.NEXT_LENGTH] > 0.0
        return self.walk(sys.float_info.max if ahead else -sys.float_info.max, limit=count)

    @one_thread
    def advance(self, times: ArrayLike, *, sample: str | None = None) -> Samples:
        """Integrate to ``times[-1]``; see `HBVMStepper` for the samplings and the protocol for the rest."""
        if sample is not None and (not isinstance(sample, str) or sample not in SAMPLINGS):
            raise unknown("sampling", sample, SAMPLINGS)
        grid = check_times(times, self.t)
        if self._status.failed:
            return Samples(grid[:0], np.empty((0, self._dim)), self._status, self._reason)
        if sample == "steps":
            return self.walk(float(grid[-1]), present=bool(grid[0] == self.t))
        self._face(float(grid[-1]))
        between = {"land": layout.LAND, "dense": layout.DENSE}.get(sample or "side", layout.SIDE)
        return self._to(grid, between)

    def _stop(self) -> float:
        """Return the next breakpoint ahead, which no step passes; infinitely far if there is none."""
        reals, points = self._context.reals, self._program.breakpoints
        ahead = reals[layout.NEXT_LENGTH] > 0.0
        points = points[[not self._is_at(point) for point in points.tolist()]] if points.size else points
        found = points[points > self.t] if ahead else points[points < self.t][::-1]
        stop = float(found[0]) if found.size else math.inf if ahead else -math.inf
        reals[layout.STOP] = stop
        return stop

    def _is_at(self, t: float) -> bool:
        """Whether a breakpoint is reached; as `integrators.kernel.step.vary.remaining`."""
        reals = self._context.reals
        rest = (t - self.t) - float(reals[layout.TIME_LOW])
        return abs(rest) <= SHORTEST * max(abs(t), abs(self.t), abs(float(reals[layout.LENGTH_BEHIND])))

    def _restart(self, t: float) -> None:
        """Begin anew at a breakpoint: what is known from before it says nothing about what follows."""
        words, reals = self._context.words, self._context.reals
        reals[layout.T0], reals[layout.TIME_LOW] = t, 0.0
        reals[layout.LENGTH] = reals[layout.LENGTH_BEHIND] = 0.0
        # The step that ended here may have been too short to be followed by one of its length.
        length = float(reals[layout.NEXT_LENGTH])
        reals[layout.NEXT_LENGTH] = math.copysign(max(abs(length), RESTART * abs(t)), length)
        words[layout.SOLVED] = words[layout.AGE] = 0

    @one_thread
    def checkpoint(self) -> AdaptiveCheckpoint:
        """Return a copy of all that the continuation depends on."""
        context = self._context
        base = vars(super().checkpoint())
        base["words"] = context.words[[*WORDS, *MORE_WORDS]]
        ahead = tuple(context.array(slot).copy() for slot in (layout.NEXT_STATE, layout.NEXT_ERROR))
        return AdaptiveCheckpoint(
            **base, ahead=(ahead[0], ahead[1]), places=context["KINK_PLACES"].copy(), taken=self._taken
        )

    @one_thread
    def restore(self, checkpoint: Checkpoint) -> None:
        """Go back to a checkpoint of the same program; as `HBVMStepper.restore`."""
        self._identity.check(checkpoint, self._kind)
        own = len(WORDS)
        super().restore(replace(checkpoint, words=checkpoint.words[:own]))
        assert isinstance(checkpoint, AdaptiveCheckpoint)
        context = self._context
        context.words[list(MORE_WORDS)] = checkpoint.words[own:]
        for slot, kept in zip((layout.NEXT_STATE, layout.NEXT_ERROR), checkpoint.ahead, strict=True):
            context.array(slot)[:] = kept
        context["KINK_PLACES"][:] = checkpoint.places
        self._uncounted = int(context.words[layout.STEPS]) - checkpoint.taken

    @property
    def _taken(self) -> int:
        """Steps from the trajectory's start to the present; the counters keep counting after a `restore`."""
        return int(self._context.words[layout.STEPS]) - self._uncounted

    def _set_step(self, h: float) -> None:
        self._context.set_factors(h)

    def _take_implicit(self) -> None:
        """Put the implicit solver to work; what the fixed-point iteration allowed does not bind it."""
        super()._take_implicit()
        self._context.words[layout.HELD] = 0
        self._context.reals[layout.LENGTH_LIMIT] = np.inf

    def _face(self, end: float) -> None:
        """Turn towards a time; what lay ahead is forgotten where it lies behind then."""
        words, reals = self._context.words, self._context.reals
        if not np.sign(end - self.t) * reals[layout.NEXT_LENGTH] < 0.0:
            return
        reals[layout.NEXT_LENGTH] *= -1.0
        if words[layout.SOLVED]:
            words[layout.SOLVED], reals[layout.LENGTH] = 0, 0.0

    def _to(self, times: Array, between: int) -> Samples:
        """Make the samples, piece by piece from one breakpoint to the next."""
        watch = Crawl(self.t, float(times[-1]))
        if not self._program.breakpoints.size:
            states, outcome, why = self._piece(np.ascontiguousarray(times), between, watch)
            return self._samples(times[: len(states)], states, outcome, why)
        out = np.empty((times.size, self._dim))
        made, outcome, why = 0, layout.DONE, None
        while made < times.size and outcome == layout.DONE and why is None:
            stop = self._stop()
            beyond = np.flatnonzero((times - stop) * self._context.reals[layout.NEXT_LENGTH] > 0.0)
            last = int(beyond[0]) if beyond.size and beyond[0] >= made else times.size
            piece = times[made:last]
            meets = last < times.size or times[-1] == stop
            grid = np.append(piece, stop) if meets and (not piece.size or piece[-1] != stop) else piece
            states, outcome, why = self._piece(np.ascontiguousarray(grid), between, watch)
            n = min(len(states), piece.size)
            out[made : made + n] = states[:n]
            made += n
            if meets and outcome == layout.DONE and why is None:
                self._restart(stop)
        return self._samples(times[:made], out[:made], outcome, why)

    def _piece(self, grid: Array, between: int, watch: Crawl) -> tuple[Array, int, "Ended | None"]:
        """Make samples before the next breakpoint, in chunks so that Ctrl-C is heard between them."""
        out, made, why = np.empty((grid.size, self._dim)), 0, None
        outcome, words = layout.BUDGET, self._context.words
        while outcome == layout.BUDGET and why is None:
            before = int(words[layout.STEPS])
            outcome = self._call(
                engine.VARY, between=between, count=grid.size, times=grid.ctypes.data, first=made,
                out=out.ctypes.data, budget=self._budget(watch.patience),
            )  # fmt: skip
            made = int(words[layout.MADE])
            if outcome == layout.BUDGET:
                why = self._ended(watch, int(words[layout.STEPS]) - before)
        return out[:made], outcome, why

    def _budget(self, most: int) -> int:
        """Return how many of ``most`` steps the kernel may take at a time, and of those left."""
        most = min(most, self._pace.steps)
        if self._program.max_steps is None:
            return most
        return max(0, min(most, self._program.max_steps - self._taken))

    def _ended(self, watch: Crawl, steps: int) -> "Ended | None":
        """Return why the run is over after ``steps`` steps that the kernel took, if it is."""
        words, most = self._context.words, self._program.max_steps
        if most is not None and self._taken >= most and not words[layout.WANTED]:
            return Status.MAX_STEPS, (
                f"max_steps={most} steps came to t = {self.t!r} only; give more, or a looser tol."
            )
        crawl = watch.sees(self.t, steps, float(np.abs(self.y).max()))
        return (Status.STALLED, crawl) if crawl else None

    @one_thread
    def walk(
        self, end: float, *, limit: int | None = None, longest: float = math.inf, present: bool = False
    ) -> Samples:
        """Take own steps, none beyond the time ``end``, and return them.

        Parameters
        ----------
        end : float
            The time to walk to; the step that would pass it is solved, kept and not taken.
        limit : int, optional
            The largest number of steps.
        longest : float
            Length that no step exceeds, > 0. A finite one costs a call of the kernel for each step.
        present : bool
            Whether the present state is to come first.
        """
        pieces = [(np.array([self.t]), self.y[np.newaxis])] if present else []
        self._face(end)
        outcome, steps, why, reals = layout.BUDGET, 0, None, self._context.reals
        watch = Crawl(self.t, end)
        while outcome == layout.BUDGET and (limit is None or steps < limit) and why is None:
            # fewer come where the implicit solver is made
            n = self._budget(watch.patience if limit is None else limit - steps)
            if longest < math.inf:
                n = min(n, 1)
                reals[layout.NEXT_LENGTH] = np.clip(reals[layout.NEXT_LENGTH], -longest, longest)
            stop = self._stop()
            passes = (end - stop) * reals[layout.NEXT_LENGTH] >= 0.0
            times, out = np.full(n + 1, stop if passes else end), np.empty((n + 1, self._dim))
            outcome = self._call(engine.WALK, times=times.ctypes.data, out=out.ctypes.data, budget=n)
            made = int(self._context.words[layout.MADE])
            steps += made
            pieces.append((times[:made], out[:made]))
            if math.isfinite(stop) and self._is_at(stop):
                if outcome == layout.DONE and stop != end:
                    outcome = layout.BUDGET
                times[made - 1 : made] = stop
                self._restart(stop)
            elif outcome == layout.BUDGET and (n == 0 or (limit is None and self._budget(1))):
                why = self._ended(watch, made)
        t, y = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
        return self._samples(t, y, layout.DONE if outcome == layout.BUDGET else outcome, why)

    def _call(self, what: int, **arguments: int) -> int:
        """Call the kernel once; put the implicit solver to work where it is wanted."""
        if self._context.words[layout.WANTED]:
            self._take_implicit()
        try:
            with self._pace:
                outcome = engine.call(what, self._context.address, side=self._side.address, **arguments)
        except UserError as raised:
            outcome, self.error = layout.NOT_FINITE, raised.error
        self._heed_stop()
        for workspace in self._implicit or ():
            workspace.raise_what_is_no_failure()
        return outcome

    def _samples(self, t: Array, y: Array, outcome: int, why: "Ended | None") -> Samples:
        status = Status.FINISHED
        if why is not None:
            status, self._reason = why
            self._status = status
        elif outcome != layout.DONE:
            status, self._reason = self._failure(outcome)
            self._status = status
        return Samples(t, y, status, self._reason)

    def _failure(self, outcome: int) -> tuple[Status, str]:
        """Return the status that an outcome stands for, and the reason as a sentence."""
        longest = self._program.max_step
        if outcome == layout.UNDERFLOW and longest is not None and longest <= SHORTEST * abs(self.t):
            return Status.STEP_UNDERFLOW, (
                f"a step of max_step={longest!r} from t = {self.t!r} cannot be told from none; give more."
            )
        if outcome == layout.UNDERFLOW:
            return Status.STEP_UNDERFLOW, (
                f"no step from t = {self.t!r} is short enough for tol={self._program.tol!r}; "
                "the solution may end or be singular here."
            )
        return super()._failure(outcome)
