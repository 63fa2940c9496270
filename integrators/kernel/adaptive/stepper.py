"""One trajectory of HBVM(k, s) with steps of varying length."""

import math
import sys
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from integrators.crawl import Crawl
from integrators.kernel import layout
from integrators.kernel.adaptive import engine
from integrators.kernel.stepper import WORDS, Checkpoint, HBVMStepper, failure
from integrators.protocol import SAMPLINGS, Array, Samples, Stats, Status, check_times
from problems.errors import unknown

if TYPE_CHECKING:
    from integrators.kernel.adaptive.program import AdaptiveProgram

CHUNK = 1 << 12  # steps between two looks at Ctrl-C

# What a checkpoint holds besides that of steps of one length.
MORE_WORDS = (
    layout.TIME_LOW, layout.NEXT_LENGTH, layout.LENGTH_AFTER, layout.LENGTH_BEHIND,
    layout.ERROR_BEHIND, layout.ERROR_AHEAD, layout.DEFECT_BEHIND, layout.DEFECT_AHEAD,
    layout.LENGTH_LIMIT, layout.LOG_RATE,
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class AdaptiveCheckpoint(Checkpoint):
    """All that the continuation of an `AdaptiveStepper` depends on."""

    ahead: tuple[Array, Array]


class AdaptiveStepper(HBVMStepper):
    """A trajectory whose steps vary; satisfies `integrators.protocol.Stepper`.

    The present time is a sum of two doubles. ``advance`` offers every sampling of
    `HBVMStepper`, with the same meaning. The step that would pass a time asked for
    is solved and kept; after a time reached with ``"land"`` a step of the same
    length is tried again from there.
    """

    _program: "AdaptiveProgram"

    def _begin(self, y: Array, t0: float) -> None:
        """Put the trajectory at its start."""
        reals = self._context.reals
        reals[layout.T0] = reals[layout.DOUBT_END] = t0
        reals[layout.NEXT_LENGTH] = self._program.first or 0.0
        engine.call(engine.RESET, self._context.address, out=y.ctypes.data)

    @property
    def t(self) -> float:
        """Time of the last own step."""
        return float(self._context.reals[layout.T0])

    @property
    def stats(self) -> Stats:
        """Counters of the work done, as `HBVMStepper.stats`; ``extra`` has the method's k and s too."""
        stats, c = super().stats, self._program.constants
        return replace(
            stats,
            rejections=int(self._context.words[layout.REJECTIONS]),
            extra={**stats.extra, "k": c.k, "s": c.s},
        )

    def step(self) -> Status:
        """Take one step; after a failure, do nothing."""
        if not self._status.failed:
            self.take(1)
        return self._status

    def take(self, count: int) -> Samples:
        """Take ``count`` own steps and return them."""
        ahead = self._context.reals[layout.NEXT_LENGTH] > 0.0
        return self.walk(sys.float_info.max if ahead else -sys.float_info.max, limit=count)

    def advance(self, times: ArrayLike, *, sample: str | None = None) -> Samples:
        """Integrate to ``times[-1]``; see `HBVMStepper` for the samplings and the protocol for the rest."""
        if sample is not None and sample not in SAMPLINGS:
            raise unknown("sampling", str(sample), SAMPLINGS)
        grid = check_times(times, self.t)
        if self._status.failed:
            return Samples(grid[:0], np.empty((0, self._dim)), self._status, self._reason)
        if sample == "steps":
            return self.walk(float(grid[-1]), present=bool(grid[0] == self.t))
        self._face(float(grid[-1]))
        between = {"land": layout.LAND, "dense": layout.DENSE}.get(sample or "side", layout.SIDE)
        return self._to(grid, between)

    def checkpoint(self) -> AdaptiveCheckpoint:
        """Return a copy of all that the continuation depends on."""
        context = self._context
        base = vars(super().checkpoint())
        base["words"] = context.words[[*WORDS, *MORE_WORDS]]
        ahead = tuple(context.array(slot).copy() for slot in (layout.NEXT_STATE, layout.NEXT_ERROR))
        return AdaptiveCheckpoint(**base, ahead=(ahead[0], ahead[1]))

    def restore(self, checkpoint: Checkpoint) -> None:
        """Go back to a checkpoint of the same program; as `HBVMStepper.restore`."""
        own = len(WORDS)
        super().restore(replace(checkpoint, words=checkpoint.words[:own]))
        assert isinstance(checkpoint, AdaptiveCheckpoint)
        context = self._context
        context.words[list(MORE_WORDS)] = checkpoint.words[own:]
        for slot, kept in zip((layout.NEXT_STATE, layout.NEXT_ERROR), checkpoint.ahead, strict=True):
            context.array(slot)[:] = kept

    @property
    def _identity(self) -> Any:
        return *super()._identity, self._program.tol, self._program.defect

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
        """Make the samples, in chunks so that Ctrl-C is heard between them."""
        grid, out = np.ascontiguousarray(times), np.empty((times.size, self._dim))
        outcome, made, crawl = layout.BUDGET, 0, ""
        watch, words = Crawl(self.t, float(grid[-1])), self._context.words
        while outcome == layout.BUDGET and not crawl:
            before = int(words[layout.STEPS])
            outcome = self._call(
                engine.VARY, between=between, count=grid.size, times=grid.ctypes.data, first=made,
                out=out.ctypes.data, budget=CHUNK,
            )  # fmt: skip
            made = int(words[layout.MADE])
            if outcome == layout.BUDGET:
                crawl = watch.sees(self.t, int(words[layout.STEPS]) - before)
        return self._samples(grid[:made], out[:made], outcome, crawl)

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
        outcome, steps, crawl, reals = layout.BUDGET, 0, "", self._context.reals
        watch = Crawl(self.t, end)
        while outcome == layout.BUDGET and (limit is None or steps < limit) and not crawl:
            n = CHUNK if limit is None else limit - steps  # fewer come where the implicit solver is made
            if longest < math.inf:
                n = 1
                reals[layout.NEXT_LENGTH] = np.clip(reals[layout.NEXT_LENGTH], -longest, longest)
            times, out = np.full(n, end), np.empty((n, self._dim))
            outcome = self._call(engine.WALK, times=times.ctypes.data, out=out.ctypes.data, budget=n)
            made = int(self._context.words[layout.MADE])
            steps += made
            pieces.append((times[:made], out[:made]))
            if outcome == layout.BUDGET and limit is None:
                crawl = watch.sees(self.t, made)
        t, y = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
        return self._samples(t, y, layout.DONE if outcome == layout.BUDGET else outcome, crawl)

    def _call(self, what: int, **arguments: int) -> int:
        """Call the kernel once; put the implicit solver to work where it is wanted."""
        if self._context.words[layout.WANTED]:
            self._take_implicit()
        outcome = engine.call(what, self._context.address, side=self._side.address, **arguments)
        for workspace in self._implicit or ():
            workspace.raise_what_is_no_failure()
        return outcome

    def _samples(self, t: Array, y: Array, outcome: int, crawl: str) -> Samples:
        status = Status.FINISHED
        if crawl:
            status, self._reason = Status.STALLED, crawl
            self._status = status
        elif outcome != layout.DONE:
            status, self._reason = self._failure(outcome)
            self._status = status
        return Samples(t, y, status, self._reason)

    def _failure(self, outcome: int) -> tuple[Status, str]:
        """Return the status that an outcome stands for, and the reason as a sentence."""
        if outcome == layout.UNDERFLOW:
            return Status.STEP_UNDERFLOW, (
                f"no step from t = {self.t!r} is short enough for tol={self._program.tol!r}; "
                "the solution may end or be singular here."
            )
        return failure(outcome, self.t, self._context.reals, self._solver)
