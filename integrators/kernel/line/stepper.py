"""One trajectory of a line integral method: a `Stepper` over the compiled steps."""

import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from integrators.checkpoints import Identity
from integrators.kernel.line import engine
from integrators.kernel.line import layout as at
from integrators.kernel.pace import Pace
from integrators.one_thread import one_thread
from integrators.protocol import SAMPLINGS, Array, Samples, Stats, Status, check_times
from integrators.times import Counts, plan
from integrators.watchdog import Crawl
from problems.errors import unknown

if TYPE_CHECKING:
    from integrators.kernel.line.program import LineProgram

CHUNK = 1 << 12  # steps between two looks at Ctrl-C, at most

STATE = ("y", "e", "previous", "reference", "active", "real")
NUMBERS = (at.N, at.ACCEPTED)


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """All that the continuation of a `LineStepper` depends on."""

    identity: Identity
    arrays: tuple[Array, ...]
    numbers: tuple[int, ...]
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

    def __init__(self, program: "LineProgram", y: Array, par: Array, t0: float):
        self._entry = engine.entry()
        self._at_work = threading.RLock()
        self._program = program
        sizes, self._m = program.memory(y, par, t0)
        self._words = np.array([*sizes, *(array.ctypes.data for array in self._m.values())], dtype=np.int64)
        self._real, self._count = self._m["real"], self._m["count"]
        self._real[at.T0] = t0
        if program.tol is None:
            assert program.h is not None
            self._real[at.H] = program.h
        else:
            self._real[at.TOLERANCE] = program.tol
            self._real[at.NEXT] = program.h or 0.0
            self._real[at.LIMIT] = np.inf
        self._status, self._reason = Status.RUNNING, ""
        self._pace = Pace(CHUNK, y.size)
        self._call(at.RESET)

    @property
    def t(self) -> float:
        """Time of the last own step."""
        real = self._real
        return float(real[at.T0] + (real[at.LOW] if self._varying else self._count[at.N] * real[at.H]))

    @property
    @one_thread
    def y(self) -> Array:
        """A copy of the state at the last own step."""
        return self._m["y"].copy()

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
        count = self._count.tolist()
        extra: dict[str, Any] = {"partial_steps": count[at.PARTIAL], "restarts": count[at.RESTARTS]}
        if names := self._program.components:
            extra["lost"] = count[at.LOST]
            extra["left_out"] = [n for n, on in zip(names, self._m["active"], strict=True) if not on]
        return Stats(
            steps=count[at.STEPS],
            rejections=count[at.REJECTIONS],
            evaluations=count[at.EVALUATIONS],
            iterations=count[at.ITERATIONS],
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
            return self.walk(np.inf if self._real[at.NEXT] > 0.0 else -np.inf, limit=count)
        targets = self._count[at.N] + np.arange(1, count + 1)
        times = self._real[at.T0] + targets * self._real[at.H]
        return self._run(at.SIDE, times, targets, np.zeros(count))

    @one_thread
    def advance(self, times: ArrayLike, *, sample: str | None = None) -> Samples:
        """Integrate to ``times[-1]``; see the class for the samplings and the protocol for the rest."""
        if sample is not None and (not isinstance(sample, str) or sample not in SAMPLINGS):
            raise unknown("sampling", sample, SAMPLINGS)
        grid = check_times(times, self.t)
        if self._status.failed:
            return Samples(grid[:0], np.empty((0, self._m["y"].size)), self._status, self._reason)
        between = {"land": at.LAND, "dense": at.DENSE}.get(sample or "side", at.SIDE)
        if self._varying:
            if sample == "steps":
                return self.walk(float(grid[-1]), present=bool(grid[0] == self.t))
            self._face(float(grid[-1]))
            return self._run(between, grid)
        t0, n, h = self._real[at.T0], int(self._count[at.N]), float(self._real[at.H])
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
            tuple(self._m[name].copy() for name in STATE),
            tuple(int(self._count[i]) for i in NUMBERS),
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
            self._m[name][:] = array
        for i, number in zip(NUMBERS, checkpoint.numbers, strict=True):
            self._count[i] = number
        self._count[at.SOLVED] = 0
        self._status, self._reason = checkpoint.status, checkpoint.reason

    @property
    def _identity(self) -> Identity:
        return Identity.of(self._program.description, self._program.system, self._m["par"])

    def _face(self, end: float) -> None:
        """Turn steps of varying length towards a time."""
        if (end - self.t) * self._real[at.NEXT] < 0.0:
            self._turn()

    def _turn(self) -> None:
        """Reverse the direction, here."""
        real, count = self._real, self._count
        count[at.SOLVED] = 0
        if self._varying:
            count[at.ACCEPTED] = 0
            real[at.NEXT] = -real[at.NEXT]
        else:
            real[at.T0], count[at.N], real[at.H] = self.t, 0, -real[at.H]

    def _run(
        self, between: int, times: Array, targets: Counts | None = None, parts: Array | None = None
    ) -> Samples:
        """Make the samples, in chunks so that Ctrl-C is heard between them."""
        out = np.empty((times.size, self._m["y"].size))
        what = at.VARY if targets is None else at.ADVANCE
        outcome, made, crawl = at.BUDGET, 0, ""
        watch = Crawl(self.t, float(times[-1]))
        while outcome == at.BUDGET and not crawl:
            before = int(self._count[at.STEPS])
            with self._pace:
                outcome = self._call(what, between, times, targets, parts, made, out, self._pace.steps)
            made = int(self._count[at.MADE])
            if outcome == at.BUDGET and self._varying:
                crawl = watch.sees(self.t, int(self._count[at.STEPS]) - before)
        if (
            outcome not in (at.DONE, at.BUDGET)
            and between == at.SIDE
            and targets is not None
            and parts is not None
        ):
            # Near a singularity a part of the step that failed may have a solution, far from the trajectory.
            inside = (targets[:made] == self._count[at.N]) & (parts[:made] != 0.0)
            made -= int(inside.sum())
        return self._samples(times[:made], out[:made], outcome, crawl)

    @one_thread
    def walk(
        self, end: float, *, limit: int | None = None, longest: float = np.inf, present: bool = False
    ) -> Samples:
        """Take own steps of varying length; as `integrators.kernel.adaptive.stepper.AdaptiveStepper.walk`."""
        pieces = [(np.array([self.t]), self.y[np.newaxis])] if present else []
        self._face(end)
        outcome, steps, crawl = at.BUDGET, 0, ""
        watch = Crawl(self.t, end)
        while outcome == at.BUDGET and (limit is None or steps < limit) and not crawl:
            n = self._pace.steps if limit is None else min(limit - steps, self._pace.steps)
            if longest < np.inf:
                n = 1
                self._real[at.NEXT] = np.clip(self._real[at.NEXT], -longest, longest)
            times, out = np.empty(n), np.empty((n, self._m["y"].size))
            with self._pace:
                outcome = self._call(at.WALK, at.SIDE, times, None, None, 0, out, n, end)
            made = int(self._count[at.MADE])
            steps += made
            pieces.append((times[:made], out[:made]))
            if outcome == at.BUDGET and limit is None:
                crawl = watch.sees(self.t, made)
        t, y = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
        return self._samples(t, y, at.DONE if outcome == at.BUDGET else outcome, crawl)

    def _samples(self, t: Array, y: Array, outcome: int, crawl: str) -> Samples:
        status = Status.FINISHED
        if crawl:
            status, self._reason = Status.STALLED, crawl
            self._status = status
        elif outcome != at.DONE:
            status, self._reason = self._failure(outcome)
            self._status = status
        return Samples(t, y, status, self._reason)

    def _call(
        self,
        what: int,
        between: int = at.SIDE,
        times: Array | None = None,
        targets: Counts | None = None,
        parts: Array | None = None,
        made: int = 0,
        out: Array | None = None,
        budget: int = 0,
        end: float = 0.0,
    ) -> int:
        arrays = [None if a is None else np.ascontiguousarray(a) for a in (times, targets, parts, out)]
        t, n, p, y = (0 if a is None else a.ctypes.data for a in arrays)
        size = 0 if times is None else times.size
        return self._entry(what, self._words.ctypes.data, between, size, t, n, p, made, y, budget, end)

    def _failure(self, outcome: int) -> tuple[Status, str]:
        """Return the status that an outcome stands for, and the reason as a sentence."""
        t, real = self.t, self._real
        if outcome == at.NOT_FINITE:
            return Status.NOT_FINITE, f"the vector field is not finite in the step from t = {t!r}."
        if outcome == at.UNDERFLOW:
            return Status.STEP_UNDERFLOW, (
                f"no step from t = {t!r} is short enough for tol={self._program.tol!r}; "
                "the solution may end or be singular here."
            )
        if outcome == at.NOT_KEPT:
            name = self._program.components[int(self._count[at.CULPRIT])]
            return Status.NOT_INVARIANT, (
                f"{name} is not an invariant: in the step from t = {t!r} the terms of its rate of change "
                f"do not cancel, but leave {float(real[at.DEFECT]):.1e} of their size; leave it out."
            )
        return Status.NONLINEAR_DIVERGENCE, (
            f"the fixed-point iteration did not converge in the step from t = {t!r}, "
            f"h = {float(real[at.H])!r} (last relative change {float(real[at.CHANGE]):.1e}); "
            "take a smaller h."
        )
