"""One trajectory of a line integral method: a `Stepper` over the compiled steps."""

import threading
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from integrators.checkpoints import Identity
from integrators.kernel.context import BUDGET, DENSE, DONE, LAND, NOT_FINITE, SIDE, UNDERFLOW
from integrators.kernel.line.memory import ADVANCE, NOT_KEPT, RESET, VARY, WALK, Trajectory
from integrators.kernel.native import engine
from integrators.one_thread import one_thread
from integrators.pace import Pace
from integrators.protocol import SAMPLINGS, Array, Samples, Stats, Status, check_times
from integrators.times import Counts, plan
from integrators.watchdog import Crawl
from problems.errors import unknown
from problems.problem import System

CHUNK = 1 << 12  # steps between two looks at Ctrl-C, at most

# What a checkpoint holds.
STATE = ("y", "e", "previous", "reference", "active")
WORDS = (
    "t0", "low", "n", "h", "length", "next", "length_after", "behind", "ahead", "limit", "accepted",
    "change", "defect",
)  # fmt: skip
PLACES = [Trajectory.slots[name].place for name in WORDS]


class Program(Protocol):
    """What a stepper asks of its program; see `integrators.kernel.line.program`."""

    system: System
    h: float | None
    tol: float | None
    components: list[str]

    @property
    def description(self) -> str: ...
    def memory(self, y: Array, par: Array, t0: float) -> Trajectory: ...


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """All that the continuation of a `LineStepper` depends on."""

    identity: Identity
    arrays: tuple[Array, ...]
    words: Counts
    status: Status
    reason: str


class LineStepper:
    """A trajectory of a line integral method; satisfies `integrators.protocol.Stepper`.

    With steps of one length the present time is ``t0 + n h`` with an integer n; with
    steps of varying length it is a sum of two doubles. ``advance`` offers every sampling:

    ``"side"`` (default)
        A throw-away step of the missing length from the last own step: order 2s,
        invariants as at the own steps, and the own steps are untouched.
    ``"steps"``
        The own steps themselves, up to the last time (and the present state, if
        the first time is the present).
    ``"land"``
        The last step before each time is shortened onto it and the next begins there.
    ``"dense"``
        The polynomial of the step: free, but of order s + 1 only, and it does not
        keep the invariants.
    """

    def __init__(self, program: Program, y: Array, par: Array, t0: float):
        self._at_work = threading.RLock()
        self._program = program
        self._m = program.memory(y, par, t0)
        if program.tol is None:
            assert program.h is not None
            self._m.h = program.h
        else:
            self._m.tolerance = program.tol
            self._m.next = program.h or 0.0
            self._m.limit = np.inf
        self._status, self._reason = Status.RUNNING, ""
        self._pace = Pace(CHUNK, y.size)
        self._call(RESET)

    @property
    def t(self) -> float:
        """Time of the last own step."""
        return float(self._m.t0 + (self._m.low if self._varying else self._m.n * self._m.h))

    @property
    @one_thread
    def y(self) -> Array:
        """A copy of the state at the last own step."""
        return self._m.y.copy()

    @property
    def status(self) -> Status:
        """How the integration stands."""
        return self._status

    @property
    def reason(self) -> str:
        """One sentence on a failure; empty otherwise."""
        return self._reason

    @property
    def stats(self) -> Stats:
        """Counters of the work done.

        ``extra`` holds: partial steps made; restarts from a bad extrapolation. With
        several invariants also ``"lost"``, how often one had moved in a step by more
        than rounding accounts for (k is then too small), and ``"left_out"``, the names
        of those that follow from others.
        """
        m = self._m
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

    @property
    def _varying(self) -> bool:
        return self._program.tol is not None

    @one_thread
    def step(self) -> Status:
        """Take one step; after a failure, do nothing."""
        if not self._status.failed:
            self.take(1)
        return self._status

    @one_thread
    def take(self, count: int) -> Samples:
        """Take ``count`` own steps and return them."""
        if self._varying:
            return self.walk(np.inf if self._m.next > 0.0 else -np.inf, limit=count)
        targets = self._m.n + np.arange(1, count + 1)
        times = np.asarray(self._m.t0 + targets * self._m.h, dtype=np.float64)
        return self._run(SIDE, times, targets, np.zeros(count))

    @one_thread
    def advance(self, times: ArrayLike, *, sample: str | None = None) -> Samples:
        """Integrate to ``times[-1]``; see the class for the samplings and the protocol for the rest."""
        if sample is not None and (not isinstance(sample, str) or sample not in SAMPLINGS):
            raise unknown("sampling", sample, SAMPLINGS)
        grid = check_times(times, self.t)
        if self._status.failed:
            return Samples(grid[:0], np.empty((0, self._m.y.size)), self._status, self._reason)
        between = {"land": LAND, "dense": DENSE}.get(sample or "side", SIDE)
        if self._varying:
            if sample == "steps":
                return self.walk(float(grid[-1]), present=bool(grid[0] == self.t))
            self._face(float(grid[-1]))
            return self._run(between, grid)
        t0, n, h = self._m.t0, self._m.n, self._m.h
        turn = (grid[-1] - self.t) * h < 0.0
        if turn:  # steps are counted from here
            t0, n, h = self.t, 0, -h
        bases = np.full(grid.size, t0)
        if sample == "land":
            bases[1:] = grid[:-1]
        targets, parts = plan(grid, bases, h)
        if sample == "steps":
            targets = np.arange(n + (grid[0] != self.t), targets[-1] + 1)
            grid, parts = t0 + targets * h, np.zeros(targets.size)
        if turn:
            self._turn()
        return self._run(between, grid, targets, parts)

    @one_thread
    def checkpoint(self) -> Checkpoint:
        """Return a copy of all that the continuation depends on."""
        return Checkpoint(
            self._identity,
            tuple(getattr(self._m, name).copy() for name in STATE),
            self._m.words[PLACES],
            self._status,
            self._reason,
        )

    @one_thread
    def restore(self, checkpoint: Checkpoint) -> None:
        """Go back to a checkpoint of the same program; the counters keep counting.

        Raises
        ------
        problems.errors.InputError
            If the checkpoint is that of another method, of other options, another system or
            other parameters; the stepper stays where it is.
        """
        self._identity.check(checkpoint, Checkpoint)
        for name, array in zip(STATE, checkpoint.arrays, strict=True):
            getattr(self._m, name)[:] = array
        self._m.words[PLACES] = checkpoint.words
        self._m.solved = 0
        self._status, self._reason = checkpoint.status, checkpoint.reason

    @property
    def _identity(self) -> Identity:
        return Identity.of(self._program.description, self._program.system, self._m.par)

    def _face(self, end: float) -> None:
        """Turn steps of varying length towards a time."""
        if (end - self.t) * self._m.next < 0.0:
            self._turn()

    def _turn(self) -> None:
        """Reverse the direction, here."""
        self._m.solved = 0
        if self._varying:
            self._m.accepted = 0
            self._m.next = -self._m.next
        else:
            self._m.t0, self._m.n, self._m.h = self.t, 0, -self._m.h

    def _run(
        self, between: int, times: Array, targets: Counts | None = None, parts: Array | None = None
    ) -> Samples:
        """Make the samples, in chunks so that Ctrl-C is heard between them."""
        out = np.empty((times.size, self._m.y.size))
        what = VARY if targets is None else ADVANCE
        outcome, made, crawl = BUDGET, 0, ""
        watch = Crawl(self.t, float(times[-1]))
        while outcome == BUDGET and not crawl:
            before = self._m.steps
            with self._pace:
                outcome = self._call(what, between, times, targets, parts, made, out, self._pace.steps)
            made = self._m.made
            if outcome == BUDGET and self._varying:
                crawl = watch.sees(self.t, self._m.steps - before)
        if outcome not in (DONE, BUDGET) and between == SIDE and targets is not None and parts is not None:
            # Near a singularity a part of the step that failed may have a solution, far from the trajectory.
            inside = (targets[:made] == self._m.n) & (parts[:made] != 0.0)
            made -= int(inside.sum())
        return self._samples(times[:made], out[:made], outcome, crawl)

    @one_thread
    def walk(
        self, end: float, *, limit: int | None = None, longest: float = np.inf, present: bool = False
    ) -> Samples:
        """Take own steps of varying length; as `integrators.kernel.stepper_own.AdaptiveStepper.walk`."""
        pieces = [(np.array([self.t]), self.y[np.newaxis])] if present else []
        self._face(end)
        outcome, steps, crawl = BUDGET, 0, ""
        watch = Crawl(self.t, end)
        while outcome == BUDGET and (limit is None or steps < limit) and not crawl:
            n = self._pace.steps if limit is None else min(limit - steps, self._pace.steps)
            if longest < np.inf:
                n = 1
                self._m.next = np.clip(self._m.next, -longest, longest)
            times, out = np.full(n, end), np.empty((n, self._m.y.size))
            with self._pace:
                outcome = self._call(WALK, SIDE, times, None, None, 0, out, n)
            made = self._m.made
            steps += made
            pieces.append((times[:made], out[:made]))
            if outcome == BUDGET and limit is None:
                crawl = watch.sees(self.t, made)
        t, y = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
        return self._samples(t, y, DONE if outcome == BUDGET else outcome, crawl)

    def _samples(self, t: Array, y: Array, outcome: int, crawl: str) -> Samples:
        status = Status.FINISHED
        if crawl:
            status, self._reason = Status.STALLED, crawl
            self._status = status
        elif outcome != DONE:
            status, self._reason = self._failure(outcome)
            self._status = status
        return Samples(t, y, status, self._reason)

    def _call(
        self,
        what: int,
        between: int = SIDE,
        times: Array | None = None,
        targets: Counts | None = None,
        parts: Array | None = None,
        made: int = 0,
        out: Array | None = None,
        budget: int = 0,
    ) -> int:
        arrays = [None if a is None else np.ascontiguousarray(a) for a in (times, targets, parts, out)]
        t, n, p, y = (0 if a is None else a.ctypes.data for a in arrays)
        size = 0 if times is None else times.size
        return engine.line(what, self._m.address, between, size, t, n, p, made, y, budget)

    def _failure(self, outcome: int) -> tuple[Status, str]:
        """Return the status that an outcome stands for, and the reason as a sentence."""
        t = self.t
        if outcome == NOT_FINITE:
            return Status.NOT_FINITE, f"the vector field is not finite in the step from t = {t!r}."
        if outcome == UNDERFLOW:
            return Status.STEP_UNDERFLOW, (
                f"no step from t = {t!r} is short enough for tol={self._program.tol!r}; "
                "the solution may end or be singular here."
            )
        if outcome == NOT_KEPT:
            name = self._program.components[self._m.culprit]
            return Status.NOT_INVARIANT, (
                f"{name} is not an invariant: in the step from t = {t!r} the terms of its rate of change "
                f"do not cancel, but leave {self._m.defect:.1e} of their size; leave it out."
            )
        return Status.NONLINEAR_DIVERGENCE, (
            f"the fixed-point iteration did not converge in the step from t = {t!r}, "
            f"h = {self._m.h!r} (last relative change {self._m.change:.1e}); "
            "take a smaller h."
        )
