"""One trajectory of HBVM(k, s) under way: a `Stepper` over the compiled kernel."""

import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from integrators.checkpoints import Identity
from integrators.kernel import engine, layout
from integrators.kernel.implicit.workspace import Workspace, report, solver
from integrators.kernel.pace import Pace
from integrators.kernel.workspace import Integers
from integrators.one_thread import one_thread
from integrators.protocol import SAMPLINGS, Array, Samples, Stats, Status, UserError, check_state, check_times
from integrators.times import Counts, plan
from problems.errors import unknown

if TYPE_CHECKING:
    from integrators.kernel.program import HBVMProgram

CHUNK = 1 << 14  # steps between two looks at Ctrl-C, at most
FIRST_HELD = 16  # steps for which the implicit solver stays at work when it is made; `solve` has more

# What a checkpoint holds besides STATE and ERROR; F matters to the next start.
WORDS = (
    layout.H, layout.T0, layout.N, layout.LENGTH, layout.SOLVED, layout.AGE, layout.FREE,
    layout.IMPLICIT, layout.SLOW, layout.HELD, layout.LEFT,
)  # fmt: skip
ARRAYS = ("F", "STRICT", "FLOORED")


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """All that the continuation of an `HBVMStepper` depends on."""

    identity: Identity
    words: Integers
    state: Array
    e: Array
    arrays: tuple[Array, ...]
    implicit: tuple[Any, ...] | None
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

    _kind: ClassVar[type[Checkpoint]] = Checkpoint
    error: Exception | None = None
    """What a function of the user raised, where the status is ``USER_ERROR``."""
    stop: threading.Event | None = None  # set by another thread: come back, what is made is not wanted

    def __init__(self, program: "HBVMProgram", y: Array, par: Array, t0: float):
        self._at_work = threading.RLock()
        self._program = program
        self._context = program.context()
        self._side = program.context(side=True)
        for context in (self._context, self._side):
            program.load(context, par)
        self._dim, self._pace = y.size, Pace(CHUNK, y.size)
        self._begin(y, t0)
        self._implicit: tuple[Workspace, Workspace] | None = None
        self._context.words[layout.STRATEGY] = program.solver.strategy
        if program.solver.strategy == layout.ALWAYS_IMPLICIT:
            self._take_implicit()
        self._status, self._reason = Status.RUNNING, ""

    def _begin(self, y: Array, t0: float) -> None:
        """Put the trajectory at its start."""
        self._context.reals[layout.H] = self._program.h
        self._context.reals[layout.T0] = t0
        engine.call(engine.RESET, self._context.address, y.ctypes.data)

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
        if self._context.reals[layout.H] != self._program.h:
            self._set_step(self._program.h)
        self._begin(start, t0)
        self._status, self._reason, self.error = Status.RUNNING, "", None
        return self._run(layout.LAND, np.array([t]), np.zeros(1, dtype=np.int64), np.array([t - t0]))

    @property
    def t(self) -> float:
        """Time of the last own step."""
        words, reals = self._context.words, self._context.reals
        return float(reals[layout.T0]) + int(words[layout.N]) * float(reals[layout.H])

    @property
    @one_thread
    def y(self) -> Array:
        """A copy of the state at the last own step."""
        return self._context.state()

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
        words = self._context.words
        extra: dict[str, Any] = {
            "partial_steps": int(words[layout.PARTIAL]),
            "restarts": int(words[layout.RESTARTS]),
            "lanes": self._program.lanes,
            "form": "second" if self._program.second else "first",
        }
        if self._implicit is not None:
            extra["implicit"] = {
                "steps": int(words[layout.IMPLICIT_STEPS]),
                "switches": int(words[layout.SWITCHES]),
                **report(self._implicit),
            }
        return Stats(
            steps=int(words[layout.STEPS]),
            rejections=0,
            evaluations=int(words[layout.EVALUATIONS]),
            iterations=int(words[layout.ITERATIONS]),
            solver=self._solvers(),
            extra=extra,
        )

    @property
    def _solver(self) -> str:
        """Name of the iteration that is at work."""
        if self._implicit is not None and self._context.words[layout.IMPLICIT]:
            return self._implicit[0].name
        return "fixed-point"

    def _solvers(self) -> str:
        """Return the names of the solvers that have solved steps, the one that solved more first."""
        words = self._context.words
        implicit = int(words[layout.IMPLICIT_STEPS])
        fixed = int(words[layout.STEPS] + words[layout.SOLVED]) - implicit
        always = self._program.solver.strategy == layout.ALWAYS_IMPLICIT
        parts = [(fixed, "fixed point"), (implicit, "" if self._implicit is None else self._implicit[0].name)]
        used = [(count, name) for count, name in parts if count > 0] or [(0, parts[always][1])]
        return ", ".join(name for _, name in sorted(used, key=lambda part: -part[0]))

    def _make_implicit(self) -> tuple[Workspace, Workspace]:
        """Return the implicit solver's memory for own and for partial steps; compile it if need be."""
        if self._implicit is None:
            self._implicit = (self._program.implicit(), self._program.implicit())
            for context, workspace in zip((self._context, self._side), self._implicit, strict=True):
                context.words[layout.SOLVER] = solver().address
                context.words[layout.SOLVER_MEMORY] = workspace.address
                context.words[layout.INCREMENT] = workspace.increment.ctypes.data
        return self._implicit

    def _take_implicit(self) -> None:
        """Put the implicit solver to work."""
        self._make_implicit()
        words = self._context.words
        words[layout.IMPLICIT], words[layout.WANTED], words[layout.SLOW] = 1, 0, 0
        words[layout.HELD] = words[layout.LEFT] = FIRST_HELD
        words[layout.SWITCHES] += int(self._program.solver.strategy == layout.AUTO)

    @one_thread
    def step(self) -> Status:
        """Take one step of length h; after a failure, do nothing."""
        if not self._status.failed:
            self.take(1)
        return self._status

    @one_thread
    def take(self, count: int) -> Samples:
        """Take ``count`` own steps and return them."""
        reals, targets = self._context.reals, int(self._context.words[layout.N]) + np.arange(1, count + 1)
        times = np.asarray(float(reals[layout.T0]) + targets * float(reals[layout.H]), dtype=np.float64)
        return self._run(layout.SIDE, times, targets, np.zeros(count))

    @one_thread
    def advance(self, times: ArrayLike, *, sample: str | None = None) -> Samples:
        """Integrate to ``times[-1]``; see the class for the samplings and the protocol for the rest."""
        if sample is not None and (not isinstance(sample, str) or sample not in SAMPLINGS):
            raise unknown("sampling", sample, SAMPLINGS)
        grid = check_times(times, self.t)
        if self._status.failed:
            return Samples(grid[:0], np.empty((0, self._dim)), self._status, self._reason)
        words, reals = self._context.words, self._context.reals
        t0, n, h = float(reals[layout.T0]), int(words[layout.N]), float(reals[layout.H])
        turn = (grid[-1] - self.t) * h < 0.0
        if turn:  # steps are counted from here
            t0, n, h = self.t, 0, -h
        between = {"land": layout.LAND, "dense": layout.DENSE}.get(sample or "side", layout.SIDE)
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
        words, reals = self._context.words, self._context.reals
        reals[layout.T0], words[layout.N] = t0, 0
        self._set_step(-float(reals[layout.H]))
        if words[layout.SOLVED]:
            words[layout.SOLVED], reals[layout.LENGTH] = 0, 0.0

    def _set_step(self, h: float) -> None:
        self._context.point(self._program.scaled(h))
        self._context.set_factors(h)

    @one_thread
    def checkpoint(self) -> Checkpoint:
        """Return a copy of all that the continuation depends on."""
        context = self._context
        return Checkpoint(
            self._identity,
            context.words[list(WORDS)],
            context.array(layout.STATE).copy(),
            context.array(layout.ERROR).copy(),
            tuple(context[name].copy() for name in ARRAYS),
            None if self._implicit is None else self._implicit[0].save(),
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
        self._identity.check(checkpoint, self._kind)
        context = self._context
        context.words[list(WORDS)] = checkpoint.words
        self._set_step(float(context.reals[layout.H]))
        context.array(layout.STATE)[:] = checkpoint.state
        context.array(layout.ERROR)[:] = checkpoint.e
        for name, array in zip(ARRAYS, checkpoint.arrays, strict=True):
            context[name][:] = array
        if checkpoint.implicit is not None:
            self._make_implicit()[0].restore(checkpoint.implicit)
        self._status, self._reason, self.error = checkpoint.status, checkpoint.reason, None

    @property
    def _identity(self) -> Identity:
        return Identity.of(self._program.description, self._program.system, self._context["PAR"])

    def _heed_stop(self) -> None:
        if self.stop is not None and self.stop.is_set():
            raise KeyboardInterrupt

    def _run(self, between: int, times: Array, targets: Counts, parts: Array) -> Samples:
        """Run the kernel over the samples, in chunks so that Ctrl-C is heard between them."""
        context = self._context
        out = np.empty((times.size, self._dim))
        arrays = [np.ascontiguousarray(array) for array in (times, targets, parts)]
        outcome, made = layout.BUDGET, 0
        while outcome == layout.BUDGET:
            if context.words[layout.WANTED]:
                self._take_implicit()
            try:
                with self._pace:
                    outcome = engine.call(
                        engine.ADVANCE, context.address, self._side.address, between, times.size,
                        *(array.ctypes.data for array in arrays), made, out.ctypes.data, self._pace.steps,
                    )  # fmt: skip
            except UserError as raised:
                outcome, self.error = layout.NOT_FINITE, raised.error
            made = int(context.words[layout.MADE])
            self._heed_stop()
            for workspace in self._implicit or ():
                workspace.raise_what_is_no_failure()
        status = Status.FINISHED
        if outcome != layout.DONE:
            status, self._reason = self._failure(outcome)
            self._status = status
        return Samples(times[:made], out[:made], status, self._reason)

    def _failure(self, outcome: int) -> tuple[Status, str]:
        """Return the status that an outcome stands for, and the reason as a sentence."""
        if self.error is not None:
            return Status.USER_ERROR, f"{UserError(self.error)} in the step from t = {self.t!r}."
        return failure(outcome, self.t, self._context.reals, self._solver)


def failure(outcome: int, t: float, reals: Array, solver: str = "fixed-point") -> tuple[Status, str]:
    """Return the status that an outcome of the kernel stands for, and the reason as a sentence."""
    if outcome == layout.NOT_FINITE:
        return Status.NOT_FINITE, f"the vector field is not finite in the step from t = {t!r}."
    if outcome == layout.SCATTERED:
        return Status.NONLINEAR_DIVERGENCE, (
            f"the equations of the step from t = {t!r}, h = {float(reals[layout.H])!r} have no solution near "
            "the trajectory: the one found oscillates within the step; take a smaller h."
        )
    return Status.NONLINEAR_DIVERGENCE, (
        f"the {solver} iteration did not converge in the step from t = {t!r}, "
        f"h = {float(reals[layout.H])!r} (last relative change {reals[layout.LAST]:.1e}); take a smaller h."
    )
