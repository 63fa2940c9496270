"""One trajectory of HBVM(k, s) under way, by steps of one length or of varying length: a `Stepper`."""

import math
import sys
import threading
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike

from integrators.checkpoints import Identity
from integrators.kernel.context import (
    ALWAYS_IMPLICIT,
    AUTO,
    BUDGET,
    DENSE,
    DONE,
    KINKS_KEPT,
    LAND,
    NOT_FINITE,
    SCATTERED,
    SIDE,
    UNDERFLOW,
    Context,
)
from integrators.kernel.implicit import engine as solver_engine
from integrators.kernel.implicit.workspace import Solver, Workspace, report
from integrators.kernel.native import engine
from integrators.kernel.pace import Pace
from integrators.kernel.step.engine import steps
from integrators.kernel.tables import Constants
from integrators.one_thread import one_thread
from integrators.options import SHORTEST
from integrators.protocol import SAMPLINGS, Array, Samples, Stats, Status, UserError, check_state, check_times
from integrators.times import Counts, plan
from integrators.watchdog import Crawl
from problems.errors import unknown
from problems.problem import System

CHUNK = 1 << 14  # steps between two looks at Ctrl-C, at most
FIRST_HELD = 16  # steps for which the implicit solver stays at work when it is made; `solve` has more

RESTART = 256 * SHORTEST  # of the time: a step after a breakpoint is tried with this length at least
Ended = tuple[Status, str]  # how a run is over before its end, and the reason as a sentence


class Program(Protocol):
    """What a stepper asks of its program; see `integrators.kernel.program`."""

    system: System
    h: float
    constants: Constants
    solver: Solver
    second: bool

    @property
    def description(self) -> str: ...
    @property
    def lanes(self) -> bool: ...
    def context(self, *, side: bool = False) -> Context: ...
    def load(self, context: Context, par: Array) -> None: ...
    def scaled(self, h: float) -> dict[str, Array]: ...
    def implicit(self) -> Workspace: ...


class VaryingProgram(Program, Protocol):
    """The same of one whose steps vary."""

    tol: float
    first: float | None
    max_step: float | None
    max_steps: int | None
    breakpoints: Array


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """All that the continuation of a stepper depends on."""

    identity: Identity
    words: Counts
    state: Array
    e: Array  # what the state has lost to rounding
    arrays: tuple[Array, ...]
    implicit: tuple[Any, ...] | None
    taken: int  # steps since the trajectory's start
    status: Status
    reason: str


class HBVMStepper:
    """A trajectory of HBVM(k, s); satisfies `integrators.protocol.Stepper`.

    The present time is ``t0 + n h`` with an integer n, never an accumulated sum.
    ``advance`` offers every sampling:

    ``"side"`` (default)
        A throw-away step of the missing length from the last own step: order 2s,
        energy as at the own steps, and the own steps are untouched.
    ``"steps"``
        The own steps themselves, up to the last time (and the present state, if
        the first time is the present).
    ``"land"``
        The last step before each time is shortened onto it and the next begins
        there. This changes the sequence of steps, which costs a symplectic
        method (k = s) its long-time behaviour.
    ``"dense"``
        The polynomial of the step: free, but of order s + 1 only, and it does not
        keep the energy.
    """

    # What a checkpoint holds besides the state and its error; the values matter to the next start.
    _words: ClassVar[tuple[str, ...]] = (
        "h", "t0", "n", "length", "older_length", "solved", "age", "free", "rate",
        "implicit", "slow", "held", "left",
    )  # fmt: skip
    _arrays: ClassVar[tuple[str, ...]] = ("values", "older_values", "strict", "floored")
    _state: ClassVar[tuple[str, str]] = ("state", "error")
    _engine: ClassVar[engine.Engine] = steps
    error: Exception | None = None
    """What a function of the user raised, where the status is ``USER_ERROR``."""
    stop: threading.Event | None = None  # set by another thread: come back, what is made is not wanted

    def __init__(self, program: Program, y: Array, par: Array, t0: float):
        self._at_work = threading.RLock()
        self._program = program
        self._implicit: tuple[Workspace, Workspace] | None = None
        self._dim, self._pace = y.size, Pace(CHUNK, y.size)
        self._status, self._reason = Status.RUNNING, ""
        self._context, self._side = self._memories(y, par, t0)
        self._begin(y, t0)

    def _memories(self, y: Array, par: Array, t0: float) -> tuple[Any, Any]:
        """Return the memory of the trajectory, and that of partial steps."""
        program = self._program
        self._context, self._side = program.context(), program.context(side=True)
        for context in (self._context, self._side):
            program.load(context, par)
        self._context.strategy = program.solver.strategy
        if program.solver.strategy == ALWAYS_IMPLICIT:
            self._take_implicit()
        return self._context, self._side

    def _begin(self, y: Array, t0: float) -> None:
        """Put the trajectory at its start."""
        ctx = self._context
        self._uncounted = ctx.steps  # steps that are not of this trajectory
        ctx.t0 = t0
        self._first_length(t0)
        self._engine(engine.RESET, ctx.address, out=y.ctypes.data)

    def _first_length(self, t0: float) -> None:
        """Set the length of the first step from t0."""
        self._context.h = self._program.h

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
        return self._run(LAND, np.array([t]), np.zeros(1, dtype=np.int64), np.array([t - t0]))

    @property
    def t(self) -> float:
        """Time of the last own step."""
        ctx = self._context
        return ctx.t0 + ctx.n * ctx.h

    @property
    @one_thread
    def y(self) -> Array:
        """A copy of the state at the last own step."""
        return self._context.read()

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

        ``extra`` holds: partial steps made; restarts from a bad extrapolation;
        ``"lanes"``, whether the field runs on all stages at once; ``"form"``, whether
        stages hold the positions only ("second") or the whole state ("first"); and, once
        there is an implicit solver, ``"implicit"``, a dict: own steps that it solved, times
        that it took over, Jacobians (and whether they are "traced" or by "differences"),
        factorizations, rescues of steps that a fixed Jacobian could not solve.
        """
        ctx = self._context
        extra: dict[str, Any] = {
            "partial_steps": ctx.partial,
            "restarts": ctx.restarts,
            "lanes": self._program.lanes,
            "form": "second" if self._program.second else "first",
        }
        if self._implicit is not None:
            extra["implicit"] = {
                "steps": ctx.implicit_steps,
                "switches": ctx.switches,
                **report(*self._implicit),
            }
        return Stats(
            steps=ctx.steps,
            rejections=0,
            evaluations=ctx.evaluations,
            iterations=ctx.iterations,
            solver=self._solvers(),
            extra=extra,
        )

    @property
    def _solver(self) -> str:
        """Name of the iteration that is at work."""
        if self._implicit is not None and self._context.implicit:
            return self._implicit[0].name
        return "fixed-point"

    def _solvers(self) -> str:
        """Return the names of the solvers that have solved steps, the one that solved more first."""
        ctx = self._context
        implicit = ctx.implicit_steps
        fixed = int(ctx.steps + ctx.solved) - implicit
        always = self._program.solver.strategy == ALWAYS_IMPLICIT
        parts = [(fixed, "fixed point"), (implicit, "" if self._implicit is None else self._implicit[0].name)]
        used = [(count, name) for count, name in parts if count > 0] or [(0, parts[always][1])]
        return ", ".join(name for _, name in sorted(used, key=lambda part: -part[0]))

    def _make_implicit(self) -> tuple[Workspace, Workspace]:
        """Return the implicit solver's memory for own and for partial steps; compile it if need be."""
        if self._implicit is None:
            self._implicit = (self._program.implicit(), self._program.implicit())
            for context, workspace in zip((self._context, self._side), self._implicit, strict=True):
                context.solver = solver_engine.solver.code().address
                context.solver_memory = workspace.address
                context.point({"increment": workspace.increment})
        return self._implicit

    def _take_implicit(self) -> None:
        """Put the implicit solver to work."""
        self._make_implicit()
        ctx = self._context
        ctx.implicit, ctx.wanted, ctx.slow = 1, 0, 0
        ctx.held = ctx.left = FIRST_HELD
        ctx.switches += int(self._program.solver.strategy == AUTO)

    @one_thread
    def step(self) -> Status:
        """Take one step of length h; after a failure, do nothing."""
        if not self._status.failed:
            self.take(1)
        return self._status

    @one_thread
    def take(self, count: int) -> Samples:
        """Take ``count`` own steps and return them."""
        ctx = self._context
        targets = ctx.n + np.arange(1, count + 1)
        times = np.asarray(ctx.t0 + targets * ctx.h, dtype=np.float64)
        return self._run(SIDE, times, targets, np.zeros(count))

    @one_thread
    def advance(self, times: ArrayLike, *, sample: str | None = None) -> Samples:
        """Integrate to ``times[-1]``; see the class for the samplings and the protocol for the rest."""
        if sample is not None and (not isinstance(sample, str) or sample not in SAMPLINGS):
            raise unknown("sampling", sample, SAMPLINGS)
        grid = check_times(times, self.t)
        if self._status.failed:
            return Samples(grid[:0], np.empty((0, self._dim)), self._status, self._reason)
        ctx = self._context
        t0, n, h = ctx.t0, ctx.n, ctx.h
        turn = (grid[-1] - self.t) * h < 0.0
        if turn:  # steps are counted from here
            t0, n, h = self.t, 0, -h
        between = {"land": LAND, "dense": DENSE}.get(sample or "side", SIDE)
        bases = np.full(grid.size, t0)
        if sample == "land":
            bases[1:] = grid[:-1]
        targets, parts = plan(grid, bases, h)
        if sample == "steps":
            targets = np.arange(n + (grid[0] != self.t), targets[-1] + 1)
            grid, parts = t0 + targets * h, np.zeros(targets.size)
        if turn:
            self._turn(t0)
        return self._run(between, grid, targets, parts)

    def _turn(self, t0: float) -> None:
        """Reverse the direction, here, at time ``t0``; what lay ahead lies behind and is forgotten."""
        ctx = self._context
        ctx.t0, ctx.n = t0, 0
        self._set_step(-ctx.h)
        self._forget()

    def _forget(self) -> None:
        """Forget the step ahead, and what is known of it."""
        if self._context.solved:
            self._context.solved, self._context.length = 0, 0.0

    def _set_step(self, h: float) -> None:
        self._context.point(self._program.scaled(h))
        self._context.set_factors(h)

    @property
    def _places(self) -> list[int]:
        """Words of a checkpoint."""
        return [self._context.slots[name].place for name in self._words]

    @one_thread
    def checkpoint(self) -> Checkpoint:
        """Return a copy of all that the continuation depends on."""
        state, error, *arrays = (getattr(self._context, name).copy() for name in self._state + self._arrays)
        return Checkpoint(
            self._identity,
            self._context.words[self._places],
            state,
            error,
            tuple(arrays),
            None if self._implicit is None else self._implicit[0].save(),
            self._taken,
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
        self._context.words[self._places] = checkpoint.words
        self._set_step(self._context.h)
        kept = (checkpoint.state, checkpoint.e, *checkpoint.arrays)
        for name, array in zip(self._state + self._arrays, kept, strict=True):
            getattr(self._context, name)[:] = array
        if checkpoint.implicit is not None:
            self._make_implicit()[0].restore(checkpoint.implicit)
        self._uncounted = self._context.steps - checkpoint.taken
        self._status, self._reason, self.error = checkpoint.status, checkpoint.reason, None

    @property
    def _taken(self) -> int:
        """Steps from the trajectory's start to the present; the counters keep counting after a `restore`."""
        return self._context.steps - self._uncounted

    @property
    def _identity(self) -> Identity:
        return Identity.of(self._program.description, self._program.system, self._context.par)

    def _heed_stop(self) -> None:
        if self.stop is not None and self.stop.is_set():
            raise KeyboardInterrupt

    def _run(self, between: int, times: Array, targets: Counts, parts: Array) -> Samples:
        """Make the samples, in chunks so that Ctrl-C is heard between them."""
        out = np.empty((times.size, self._dim))
        times, parts = np.ascontiguousarray(times), np.ascontiguousarray(parts)
        targets = np.ascontiguousarray(targets)
        outcome, made = BUDGET, 0
        while outcome == BUDGET:
            outcome = self._call(
                engine.ADVANCE, between, times, out, made, self._pace.steps,
                targets.ctypes.data, parts.ctypes.data,
            )  # fmt: skip
            made = self._context.made
        return self._samples(times[:made], out[:made], outcome)

    def _call(
        self, what: int, between: int, times: Array, out: Array, made: int, budget: int,
        targets: int = 0, parts: int = 0,
    ) -> int:  # fmt: skip
        """Call the kernel once; put the implicit solver to work where it is wanted."""
        if self._wants_solver:
            self._take_implicit()
        try:
            with self._pace:
                outcome = self._engine(
                    what, self._context.address, self._side.address, between, times.size,
                    times.ctypes.data, targets, parts, made, out.ctypes.data, budget,
                )  # fmt: skip
        except UserError as raised:
            outcome, self.error = NOT_FINITE, raised.error
        self._heed_stop()
        for workspace in self._implicit or ():
            workspace.raise_what_is_no_failure()
        return outcome

    @property
    def _wants_solver(self) -> bool:
        """Whether the kernel has come back for the implicit solver."""
        return self._context.wanted != 0

    def _samples(self, t: Array, y: Array, outcome: int, why: "Ended | None" = None) -> Samples:
        if why is None and outcome != DONE:
            why = self._failure(outcome)
        if why is not None:
            self._status, self._reason = why
        return Samples(t, y, Status.FINISHED if why is None else why[0], self._reason)

    def _failure(self, outcome: int) -> tuple[Status, str]:
        """Return the status that an outcome stands for, and the reason as a sentence."""
        if self.error is not None:
            return Status.USER_ERROR, f"{UserError(self.error)} in the step from t = {self.t!r}."
        return failure(outcome, self._context, self.t, self._solver)


class AdaptiveStepper(HBVMStepper):
    """A trajectory whose steps vary; satisfies `integrators.protocol.Stepper`.

    The present time is a sum of two doubles. ``advance`` offers every sampling of
    `HBVMStepper`, with the same meaning. The step that would pass a time asked for
    is solved and kept; after a time reached with ``"land"`` a step of the same
    length is tried again from there.
    """

    _program: VaryingProgram
    _words = (
        *HBVMStepper._words,
        "time_low", "next_length", "length_after", "length_behind",
        "error_behind", "error_ahead", "defect_behind", "defect_ahead",
        "length_limit", "kinks", "kink_end", "doubt_end",
    )  # fmt: skip
    _arrays = (*HBVMStepper._arrays, "next_state", "next_error", "kink_places")

    def _first_length(self, t0: float) -> None:
        self._context.next_length = self._program.first or 0.0
        self._context.doubt_end = t0

    @property
    def t(self) -> float:
        """Time of the last own step."""
        return self._context.t0

    @property
    def stats(self) -> Stats:
        """Counters of the work done, as `HBVMStepper.stats`; ``extra`` has the method's k and s too.

        And, where the field jumps or has a kink, ``"kinks"``: pairs (t, h), the place that a
        step had to be cut for and the length at which it was found, of the first 64 places.
        """
        stats, c, context = super().stats, self._program.constants, self._context
        extra = {**stats.extra, "k": c.k, "s": c.s}
        if found := context.kinks:
            kept = context.kink_places.reshape(-1, 2)[: min(found, KINKS_KEPT)]
            extra["kinks"] = [(float(t), float(h)) for t, h in kept]
        return replace(stats, rejections=context.rejections, extra=extra)

    @one_thread
    def take(self, count: int) -> Samples:
        """Take ``count`` own steps and return them."""
        ahead = self._context.next_length > 0.0
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
        between = {"land": LAND, "dense": DENSE}.get(sample or "side", SIDE)
        return self._to(grid, between)

    def _stop(self) -> float:
        """Return the next breakpoint ahead, which no step passes; infinitely far if there is none."""
        ctx, points = self._context, self._program.breakpoints
        ahead = ctx.next_length > 0.0
        if not points.size:
            return math.inf if ahead else -math.inf
        points = points[[not self._is_at(point) for point in points.tolist()]]
        found = points[points > self.t] if ahead else points[points < self.t][::-1]
        stop = float(found[0]) if found.size else math.inf if ahead else -math.inf
        ctx.stop = stop
        return stop

    def _is_at(self, t: float) -> bool:
        """Whether a breakpoint is reached; as `integrators.kernel.step.vary.remaining`."""
        ctx = self._context
        rest = (t - self.t) - ctx.time_low
        return abs(rest) <= SHORTEST * max(abs(t), abs(self.t), abs(ctx.length_behind))

    def _restart(self, t: float) -> None:
        """Begin anew at a breakpoint: what is known from before it says nothing about what follows."""
        ctx = self._context
        ctx.t0, ctx.time_low = t, 0.0
        ctx.length = ctx.length_behind = 0.0
        # The step that ended here may have been too short to be followed by one of its length.
        length = ctx.next_length
        ctx.next_length = math.copysign(max(abs(length), RESTART * abs(t)), length)
        ctx.solved = ctx.age = 0

    def _set_step(self, h: float) -> None:
        self._context.set_factors(h)

    def _take_implicit(self) -> None:
        """Put the implicit solver to work; what the fixed-point iteration allowed does not bind it."""
        super()._take_implicit()
        self._context.held = 0
        self._context.length_limit = np.inf

    def _face(self, end: float) -> None:
        """Turn towards a time; what lay ahead is forgotten where it lies behind then."""
        ctx = self._context
        if not np.sign(end - self.t) * ctx.next_length < 0.0:
            return
        ctx.next_length *= -1.0
        self._forget()

    def _to(self, times: Array, between: int) -> Samples:
        """Make the samples, piece by piece from one breakpoint to the next."""
        watch = Crawl(self.t, float(times[-1]))
        if not self._program.breakpoints.size:
            states, outcome, why = self._piece(np.ascontiguousarray(times), between, watch)
            return self._samples(times[: len(states)], states, outcome, why)
        out = np.empty((times.size, self._dim))
        made, outcome, why = 0, DONE, None
        while made < times.size and outcome == DONE and why is None:
            stop = self._stop()
            beyond = np.flatnonzero((times - stop) * self._context.next_length > 0.0)
            last = int(beyond[0]) if beyond.size and beyond[0] >= made else times.size
            piece = times[made:last]
            meets = last < times.size or times[-1] == stop
            grid = np.append(piece, stop) if meets and (not piece.size or piece[-1] != stop) else piece
            states, outcome, why = self._piece(np.ascontiguousarray(grid), between, watch)
            n = min(len(states), piece.size)
            out[made : made + n] = states[:n]
            made += n
            if meets and outcome == DONE and why is None:
                self._restart(stop)
        return self._samples(times[:made], out[:made], outcome, why)

    def _piece(self, grid: Array, between: int, watch: Crawl) -> tuple[Array, int, "Ended | None"]:
        """Make samples before the next breakpoint, in chunks so that Ctrl-C is heard between them."""
        out, made, why = np.empty((grid.size, self._dim)), 0, None
        outcome, ctx = BUDGET, self._context
        while outcome == BUDGET and why is None:
            before = ctx.steps
            outcome = self._call(engine.ADVANCE, between, grid, out, made, self._budget(watch.patience))
            made = ctx.made
            if outcome == BUDGET:
                why = self._ended(watch, ctx.steps - before)
        return out[:made], outcome, why

    def _budget(self, most: int) -> int:
        """Return how many of ``most`` steps the kernel may take at a time, and of those left."""
        most = min(most, self._pace.steps)
        if self._program.max_steps is None:
            return most
        return max(0, min(most, self._program.max_steps - self._taken))

    def _ended(self, watch: Crawl, steps: int) -> "Ended | None":
        """Return why the run is over after ``steps`` steps that the kernel took, if it is."""
        most = self._program.max_steps
        if most is not None and self._taken >= most and not self._wants_solver:
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
        outcome, steps, why, ctx = BUDGET, 0, None, self._context
        watch = Crawl(self.t, end)
        while outcome == BUDGET and (limit is None or steps < limit) and why is None:
            # fewer come where the implicit solver is made
            n = self._budget(watch.patience if limit is None else limit - steps)
            if longest < math.inf:
                n = min(n, 1)
                ctx.next_length = np.clip(ctx.next_length, -longest, longest)
            stop = self._stop()
            passes = (end - stop) * ctx.next_length >= 0.0
            times, out = np.full(n + 1, stop if passes else end), np.empty((n + 1, self._dim))
            outcome = self._call(engine.WALK, SIDE, times, out, 0, n)
            made = self._context.made
            steps += made
            pieces.append((times[:made], out[:made]))
            if math.isfinite(stop) and self._is_at(stop):
                if outcome == DONE and stop != end:
                    outcome = BUDGET
                times[made - 1 : made] = stop
                self._restart(stop)
            elif outcome == BUDGET and (n == 0 or (limit is None and self._budget(1))):
                why = self._ended(watch, made)
        t, y = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
        return self._samples(t, y, DONE if outcome == BUDGET else outcome, why)

    def _failure(self, outcome: int) -> tuple[Status, str]:
        """Return the status that an outcome stands for, and the reason as a sentence."""
        longest = self._program.max_step
        if outcome == UNDERFLOW and longest is not None and longest <= SHORTEST * abs(self.t):
            return Status.STEP_UNDERFLOW, (
                f"a step of max_step={longest!r} from t = {self.t!r} cannot be told from none; give more."
            )
        if outcome == UNDERFLOW:
            return Status.STEP_UNDERFLOW, (
                f"no step from t = {self.t!r} is short enough for tol={self._program.tol!r}; "
                "the solution may end or be singular here."
            )
        return super()._failure(outcome)


def failure(outcome: int, ctx: Context, t: float, solver: str = "fixed-point") -> tuple[Status, str]:
    """Return the status that an outcome of the kernel stands for, and the reason as a sentence."""
    if outcome == NOT_FINITE:
        return Status.NOT_FINITE, f"the vector field is not finite in the step from t = {t!r}."
    if outcome == SCATTERED:
        return Status.NONLINEAR_DIVERGENCE, (
            f"the equations of the step from t = {t!r}, h = {ctx.h!r} have no solution near "
            "the trajectory: the one found oscillates within the step; take a smaller h."
        )
    return Status.NONLINEAR_DIVERGENCE, (
        f"the {solver} iteration did not converge in the step from t = {t!r}, "
        f"h = {ctx.h!r} (last relative change {ctx.last:.1e}); take a smaller h."
    )
