"""One trajectory of HBVM(k, s) under way: what fixed and adaptive steps have in common."""

import math
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from integrators.kernel.adaptive import Adaptive
from integrators.kernel.adjoint.gradient import Adjoint, Records
from integrators.kernel.context import (
    ACCUMULATE,
    ADVANCE,
    ANEW,
    BUDGET,
    DIVERGED,
    DONE,
    GO_ON,
    HALTED,
    NOT_FINITE,
    NOT_KEPT,
    RENEW,
    RESET,
    SCATTERED,
    Context,
    Shape,
)
from integrators.kernel.engines import solver, steps
from integrators.kernel.ensemble.prepared import Lanes
from integrators.kernel.implicit.workspace import Solver, Workspace, report
from integrators.kernel.inside.search import KernelSearch, Sought
from integrators.kernel.line.kept import Kept
from integrators.kernel.native import binary
from integrators.kernel.native.memory import address
from integrators.kernel.noise import ALL_LENGTHS, Noise, field_noise
from integrators.kernel.pace import FEWEST, Pace
from integrators.kernel.parts.implicit import ALWAYS_IMPLICIT, AUTO, FOR_VECTORS, NOT_WANTED
from integrators.kernel.parts.team import BLOCK
from integrators.kernel.plan import Plan
from integrators.kernel.step.rule import STAGNATION
from integrators.kernel.tables import Constants
from integrators.kernel.tangent.frames import Frames
from integrators.kernel.tangent.group import Directions
from integrators.kernel.tangent.vectors import Vectors
from integrators.kernel.threads import Threads
from integrators.protocol import (
    SAMPLINGS,
    Array,
    Samples,
    Stats,
    Status,
    UserError,
    undefined_in,
)
from integrators.refusals import check_times, one_thread
from integrators.running.checkpoints import Identity
from integrators.running.watchdog import StallDetector
from integrators.undefined import where_undefined
from problems.errors import InputError, unknown
from problems.problem import System
from problems.systems.opaque import Opaque

CHUNK = 1 << 14  # steps between two looks at Ctrl-C, at most
CHUNK_WITH_EVENTS = 1 << 10  # the same where a step may take as long as many
SHORTEST_TIME = 64  # units in the last place: nothing happens in a time as short
# What a field that is not defined somewhere may lead to.
FROM_UNDEFINED = (Status.NOT_FINITE, Status.STEP_UNDERFLOW, Status.NONLINEAR_DIVERGENCE)
FIRST_HELD = 16  # steps for which the implicit solver stays at work when it is made; `solve` has more

# Changes that noise makes in a step, relative: an iteration stagnates at ten times as much, and is over at
# `step.rule.STAGNATION`.
LEAST_NOISE = 0.1 * STAGNATION

Ended = tuple[Status, str]  # how a run is over before its end, and the reason as a sentence
Filled = tuple[Array, int, Ended | None]  # samples, how the kernel came back, and why they are the last


class Program(Protocol):
    """What steppers and batches ask of their program; see `integrators.kernel.program`."""

    system: System
    plan: Plan
    h: float
    shape: Shape
    constants: Constants
    solver: Solver
    second: bool
    varying: bool
    field: binary.Native
    adaptive: Adaptive | None
    kept: Kept | None
    vectors: dict[tuple[int, bool], Context]
    compile_seconds: float

    @property
    def description(self) -> str: ...
    @property
    def lanes(self) -> bool: ...
    @property
    def renews(self) -> bool: ...

    def start(self, y0: ArrayLike, par: ArrayLike | None = None, t0: float = 0.0) -> "HBVMStepper": ...
    def program_of_lanes(self) -> "Program": ...
    def in_lanes(self) -> Lanes | None: ...
    def contexts(self, par: Array) -> tuple[Context, Context]: ...
    def give_back(self, own: Context, partial: Context) -> None: ...
    def begin(self, own: Context, partial: Context, y: Array, par: Array, t0: float) -> None: ...
    def renew(self, own: Context, partial: Context, par: Array) -> None: ...
    def scaled(self, h: float) -> dict[str, Array]: ...
    def implicit(self) -> Workspace: ...
    def field_of_eight(self) -> binary.Native: ...
    def part_of_field(self) -> binary.Native | None: ...


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """All that the continuation of a stepper depends on."""

    identity: Identity
    words: dict[str, int]
    arrays: dict[str, Array]
    implicit: tuple[Any, ...] | None
    taken: int  # steps since the trajectory's start
    status: Status
    reason: str
    vectors: tuple[Any, ...] | None = None  # what `Vectors.save` returned
    stages: Array | None = None  # of the step ahead, which may be solved, where steps are recorded
    par: Array | None = None  # the present parameters, which events may have changed


class HBVMStepper(ABC):
    """A trajectory of HBVM(k, s); satisfies `integrators.protocol.Stepper`.

    ``advance`` offers every sampling:

    ``"partial"`` (default)
        A partial step from the last step: order 2s,
        energy as at the steps, and the steps are untouched.
    ``"steps"``
        The steps themselves, up to the last time (and the present state, if
        the first time is the present).
    ``"stop"``
        The last step before each time is shortened onto it and the next begins
        there. This changes the sequence of steps, which costs a symplectic
        method (k = s) its long-time behaviour.
    ``"dense"``
        The polynomial of the step: free, but of order s + 1 only, and it does not
        conserve the energy.
    """

    error: Exception | None = None
    """What a function of the user raised, where the status is ``USER_ERROR``."""
    search: KernelSearch | None = None
    """What looks for events in the steps, see `look_for`."""
    samplings: tuple[str, ...] = SAMPLINGS
    destination: float | None = None
    """Where the whole integration ends, if ``advance`` goes there in pieces."""
    detector: StallDetector | None = None
    """What watches the way to the destination; see `integrators.running.watchdog`."""
    time_limit = math.inf  # seconds after which ``advance`` returns what it has
    variations: Array | None = None
    """Tangent vectors at the last samples, shape (m, dim, n); see `follow`."""
    _vectors: Vectors | None = None
    _threads: Threads | None = None
    _recorded = False  # whether steps are recorded for an adjoint
    stop: threading.Event | None = None  # set by another thread: come back, what is made is not wanted

    def __init__(self, program: Program, y: Array, par: Array, t0: float):
        self._at_work = threading.RLock()
        self._program = program
        self._implicit: tuple[Workspace, Workspace] | None = None
        self._dim, self._pace = y.size, Pace(CHUNK, y.size)
        if isinstance(program.system, Opaque):
            program.system.forget_undefined()
        self._status, self._reason = Status.RUNNING, ""
        self._par = par
        self._context, self._partial = program.contexts(par)
        program.begin(self._context, self._partial, y, par, t0)
        if program.solver.strategy == ALWAYS_IMPLICIT:
            self._take_implicit()
        self._begin(y, t0)

    def __del__(self) -> None:
        if hasattr(self, "_partial"):  # what cannot be started has none
            self._program.give_back(self._context, self._partial)

    def look_for(self, sought: Sought, end: float) -> None:
        """Look for events in all steps from here on, up to a time."""
        self.search = KernelSearch(sought, (self._context, self._partial), end)
        self._pace = Pace(CHUNK_WITH_EVENTS, self._dim)
        self._pace.steps = FEWEST

    def share(self, threads: int) -> None:
        """Share the work of the steps among threads; see `integrators.protocol.SharedSteps`."""
        program, started, rows = self._program, binary.clock(), self._context.rows
        system, few = program.system, rows <= BLOCK
        if program.kept:
            reason = "steps of a line integral are not shared"
        elif program.field.calls_back:
            reason = f"the right-hand side of {system.name} is Python's, which one thread runs at a time"
        elif few and system.traced:
            reason = f"steps of {system.name} are shared from {BLOCK + 1} rows on, and it has {rows}"
        elif few and program.constants.k <= 8:
            reason = f"eight stages of {system.name} are evaluated in one thread"
        else:
            contexts = self._context, self._partial
            self._threads = Threads(threads, contexts, program.field_of_eight(), program.part_of_field())
            program.compile_seconds += binary.clock() - started
            return
        raise InputError(f"threads={threads} saves no time: {reason}; leave it out.")

    def follow(self, state: ArrayLike, parameters: ArrayLike) -> None:
        """Let tangent vectors follow the trajectory from here on; see `integrators.protocol.Variations`."""
        self._check_derivatives("variations")
        directions = Directions(np.array(state, dtype=np.float64), np.array(parameters, dtype=np.float64))
        if self._vectors and self._vectors.fits(directions):
            self._vectors.put(directions.state)
            return
        system, program, started = self._program.system, self._program, binary.clock()
        self._vectors = Vectors(system, (self._context, self._partial), directions, program.vectors)
        program.compile_seconds += binary.clock() - started
        if self._implicit is not None:
            self._vectors.solve_by(self._implicit)

    def _check_derivatives(self, label: str) -> None:
        """Refuse what needs the derivatives of the steps where these have none."""
        system, program = self._program.system, self._program
        if not system.traced:
            need = "a formula"
        elif program.plan.projected:
            need = "steps without a projection, which they do not follow; leave out projection='energy'"
        elif program.kept:
            need = "a Runge-Kutta method: line integrals are none; use Gauss"
        else:
            return
        raise InputError(f"{label} of {system.name} need {need}.")

    def recorder(self, capacity: int) -> Records:
        """Return room for the records of so many steps; see `integrators.protocol.Gradients`."""
        self._check_derivatives("gradients")
        return Records(self._context.shape, capacity)

    def record(self, records: Records) -> None:
        """Record the steps from here on, instead of what was recorded or followed them before."""
        records.attach(self._context)
        self._recorded = True

    def adjoint(self, *, parameters: bool) -> Adjoint:
        """Return the adjoint of recorded steps."""
        return Adjoint(self._program.system, self._context.shape, self._context.par.copy(), parameters)

    @abstractmethod
    def march(self, end: float, most: int) -> Samples:
        """Take steps, ``most`` at most and none beyond the time ``end``; return them."""

    @one_thread
    def frames(self, frame: Array, marks: Array, *, divergence: bool) -> Frames:
        """Let an orthonormal frame follow the trajectory up to some times; see `Frames`."""
        self.follow(frame, np.zeros((self._program.system.n_par, frame.shape[1])))
        return Frames(self, frame, marks, divergence=divergence)

    def scale(self, factors: ArrayLike) -> None:
        """Multiply the vectors by numbers; see `integrators.protocol.Variations`."""
        if self._vectors is not None:
            self._vectors.scale(np.asarray(factors, dtype=np.float64))

    def look_to(self, end: float) -> Status:
        """Look for events from the last step to a time that lies in the step ahead."""
        search = self.search
        if search is not None and search.trouble is None and self._status is Status.RUNNING:
            if abs(end - self.t) <= SHORTEST_TIME * float(np.spacing(abs(end))):
                return self._status
            if not self._context.solved:  # as after samples that are ends of steps
                samples = self.advance([end], sample="partial")
                if samples.status is not Status.FINISHED:
                    reason = f"{samples.reason} Events are known up to t = {self.t!r} only."
                    search.trouble = samples.status, reason, self.error
            if self._status is Status.RUNNING and self._context.solved:
                search.finish(end)
        return self._status

    def _begin(self, y: Array, t0: float) -> None:
        """Put the trajectory at its start."""
        ctx = self._context
        self._uncounted = ctx.counters.steps  # steps that are not of this trajectory
        ctx.numbers.t0 = t0
        for workspace in self._implicit or ():
            workspace.forget()
        steps(RESET, ctx, 0, 0, 0, 0, 0, 0, 0, address(y), 0)

    @property
    def t(self) -> float:
        """Time of the last step."""
        numbers = self._context.numbers
        return numbers.t0 + numbers.n * numbers.h

    @property
    @one_thread
    def y(self) -> Array:
        """A copy of the state at the last step."""
        return self._context.read()

    @property
    def par(self) -> Array:
        """A copy of the present parameters, which an event may have changed; shape (n_par,)."""
        return self._context.par.copy()

    def _renew(self, par: Array) -> None:
        """Let other parameters be the present ones."""
        if np.array_equal(par, self._context.par):
            return
        self._program.renew(self._context, self._partial, par)
        for workspace in self._implicit or ():
            workspace.forget()

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

        ``extra`` holds: partial steps made, and what of the iterations and evaluations was theirs
        (``"partial_iterations"``, ``"partial_evaluations"``: the iterations that are left do not depend on
        how many states between steps were asked for); restarts from a bad extrapolation;
        ``"lanes"``, whether the field runs on all stages at once; ``"form"``, whether
        stages hold the positions only ("second") or the whole state ("first"); and, once
        there is an implicit solver, ``"implicit"``, a dict: steps that it solved, times
        that it took over, Jacobians (and whether they are "traced" or by "differences"),
        factorizations, corrections, what of the Jacobians and corrections partial steps took,
        ``rescues`` (full Newton iterations of steps that a fixed Jacobian could not solve). With several
        invariants also ``"lost"``, a dict of those that moved by more than rounding accounts for (k is then
        too small): the time when that was seen first, by how much in all, and the size of the terms; and
        ``"left_out"``, the names of those that follow from others.
        With adaptive step size also the method's ``"k"`` and ``"s"`` and, where the field
        or a derivative of it is discontinuous, ``"kinks"``: pairs (t, h), the place that a step had to be cut
        for and the length at which it was found, or the time and 0 where a step ends on a switching surface,
        of the first 64 places. With variations ``"variations"``, a dict: their iterations.
        """
        counters = self._context.counters.numbers
        return Stats(
            counters.steps, counters.rejections, counters.evaluations, counters.iterations, self._solvers(),
            self._extra(),
        )  # fmt: skip

    def _extra(self) -> dict[str, Any]:
        ctx, kept, counters = self._context, self._program.kept, self._context.counters.numbers
        extra: dict[str, Any] = {
            "partial_steps": counters.partial_steps,
            "partial_iterations": counters.partial_iterations,
            "partial_evaluations": counters.partial_evaluations,
            "restarts": counters.restarts,
            "lanes": self._program.lanes,
            "form": "second" if self._program.second else "first",
        }
        if kept:
            extra.update(kept.report(ctx))
        if self._implicit is not None:
            extra["implicit"] = {
                "steps": counters.implicit_steps,
                "switches": counters.switches,
                **report(*self._implicit),
            }
        if self._vectors is not None:
            extra["variations"] = {"iterations": self._vectors.iterations}
        return extra

    @property
    def _solver(self) -> str:
        """Name of the iteration that is at work."""
        if self._implicit is not None and self._context.implicit.active:
            return self._implicit[0].name
        return "fixed-point"

    def _solvers(self) -> str:
        """Return the names of the solvers that have solved steps, the one that solved more first."""
        if self._implicit is None:
            return "fixed point"
        ctx = self._context
        implicit = ctx.counters.implicit_steps
        fixed = int(ctx.counters.steps + ctx.solved) - implicit
        always = self._program.solver.strategy == ALWAYS_IMPLICIT
        parts = [(fixed, "fixed point"), (implicit, self._implicit[0].name)]
        used = [(count, name) for count, name in parts if count > 0] or [(0, parts[always][1])]
        return ", ".join(name for _, name in sorted(used, key=lambda part: -part[0]))

    def _make_implicit(self) -> tuple[Workspace, Workspace]:
        """Return the implicit solver's memory for own and for partial steps; compile it if need be."""
        if self._implicit is None:
            self._implicit = (self._program.implicit(), self._program.implicit())
            for context, workspace in zip((self._context, self._partial), self._implicit, strict=True):
                context.implicit.code, context.implicit.memory = solver.code(), workspace
                context.implicit.target_corrections = workspace.target_corrections
                context.point({"implicit.increment": workspace.increment})
            if self._vectors:
                self._vectors.solve_by(self._implicit)
        return self._implicit

    def _take_implicit(self) -> None:
        """Put the implicit solver to work."""
        self._make_implicit()
        ctx = self._context
        ctx.implicit.active, ctx.implicit.wanted, ctx.implicit.slow = 1, NOT_WANTED, 0
        ctx.implicit.held = ctx.implicit.left = FIRST_HELD
        ctx.counters.switches += int(self._program.solver.strategy == AUTO)

    @one_thread
    def step(self) -> Status:
        """Take one step; after a failure, do nothing."""
        plain = self.search is None and self.stop is None and self._implicit is None
        if not self._status.failed and not (plain and self._one_step()):
            self.take(1)
        return self._status

    @abstractmethod
    def _one_step(self) -> bool:
        """Take one step by one call of the kernel; return whether it is taken, or has failed for good."""

    def _is_one(self, outcome: int, taken: int) -> bool:
        """Whether such a call, which comes back with ``taken`` after a step, is all there is to do."""
        if outcome == taken and self._context.samples_written == 1:
            return True
        outcome = self._handled(outcome)
        if outcome != BUDGET:
            self._samples(np.empty(0), np.empty((0, self._dim)), outcome)
        return outcome != BUDGET

    @cached_property
    def _for_one_step(self) -> tuple[Array, Callable[[], int], Array]:
        """Two numbers that one step reads, what the kernel is called with for it, and where it writes."""
        numbers, states = np.zeros(2), np.empty((2, self._dim))
        call = steps.prepared(*self._one_step_call(address(numbers), address(states)))
        return numbers, call, states

    @abstractmethod
    def _one_step_call(self, numbers: int, out: int) -> tuple[int | Context, ...]:
        """Return what the kernel is called with for one step, with the addresses of numbers and of states."""

    @abstractmethod
    def take(self, count: int) -> Samples:
        """Take ``count`` steps and return them."""

    @one_thread
    def advance(self, times: ArrayLike, *, sample: str | None = None) -> Samples:
        """Integrate to ``times[-1]``; see the class for the samplings and the protocol for the rest."""
        if sample is not None and (not isinstance(sample, str) or sample not in SAMPLINGS):
            raise unknown("sampling", sample, SAMPLINGS)
        grid = check_times(times, self.t)
        if self._status.failed:
            return Samples(grid[:0], np.empty((0, self._dim)), self._status, self._reason)
        return self._advance(grid, sample or "partial")

    @abstractmethod
    def _advance(self, grid: Array, sample: str) -> Samples:
        """Integrate to the last of some times that are checked."""

    def _set_step(self, h: float) -> None:
        """Set the length of the steps, and what depends on it."""
        if not self._program.varying:
            self._context.point_to(self._program.scaled(h))
        self._context.set_factors(h)

    def _forget(self) -> None:
        """Forget the step ahead, and what is known of it."""
        if self._context.solved:
            self._context.solved, self._context.length = 0, 0.0

    @one_thread
    def checkpoint(self) -> Checkpoint:
        """Return a copy of all that the continuation depends on."""
        return Checkpoint(
            self._identity,
            *self._context.lasting(),
            None if self._implicit is None else self._implicit[0].save(),
            self._taken,
            self._status,
            self._reason,
            None if self._vectors is None else self._vectors.save(),
            self._context.stages.copy() if self._recorded else None,
            self.par,
        )

    @one_thread
    def restore(self, checkpoint: Checkpoint) -> None:
        """Go back to a checkpoint of the same program; the counters keep counting.

        Raises
        ------
        problems.errors.InputError
            If the checkpoint is that of another method, of other options, another system or
            other parameters, or of a trajectory that other tangent vectors followed or none; the stepper
            stays where it is.
        """
        self._identity.check(checkpoint, Checkpoint)
        if self._vectors is not None and not self._vectors.fit(checkpoint.vectors):
            raise InputError(
                "this checkpoint has no tangent vectors, or others; restore it before any follow."
            )
        words, arrays = checkpoint.words, checkpoint.arrays
        shapes = {name: array.shape for name, array in self._context.lasting()[1].items()}
        known = isinstance(words, dict) and words.keys() == self._context.lasting_words.keys()
        if not known or {name: array.shape for name, array in arrays.items()} != shapes:
            raise InputError(
                "this checkpoint is of another version of hbvm-bench, whose steps depend on other numbers; "
                "restore it with that version, or begin anew."
            )
        if checkpoint.par is not None:
            self._renew(checkpoint.par)
        self._context.go_on(words, arrays)
        self._set_step(self._context.h)
        if checkpoint.implicit is not None:
            self._make_implicit()[0].restore(checkpoint.implicit)
        if self._vectors is not None and checkpoint.vectors is not None:
            self._vectors.restore(checkpoint.vectors)
        if checkpoint.stages is not None:
            self._context.stages[:] = checkpoint.stages
        self._uncounted = self._context.counters.steps - checkpoint.taken
        self._status, self._reason, self.error = checkpoint.status, checkpoint.reason, None

    @property
    def _taken(self) -> int:
        """Steps from the trajectory's start to the present; the counters keep counting after a `restore`."""
        return self._context.counters.steps - self._uncounted

    @property
    def _identity(self) -> Identity:
        return Identity.from_system(self._program.description, self._program.system, self._par)

    def _fill(self, between: int, times: Array, *steps_and_parts: NDArray[Any]) -> Filled:
        """Make samples, in chunks so that Ctrl-C is heard between them."""
        times, given = np.ascontiguousarray(times), tuple(map(np.ascontiguousarray, steps_and_parts))
        addresses = tuple(map(address, given))
        out = np.empty((times.size, self._dim))
        if self._vectors:
            self._vectors.room(times.size)
        outcome, count, reason, ctx = BUDGET, 0, None, self._context
        late = perf_counter() + self.time_limit
        while outcome == BUDGET and reason is None and not (count and perf_counter() > late):
            before = ctx.counters.steps
            outcome = self._call(ADVANCE, between, times, out, count, self._budget(), *addresses)
            count = ctx.samples_written
            if outcome == BUDGET:
                reason = self._ended(ctx.counters.steps - before)
        if self._vectors:
            self._vectors.note(times[:count])
        elif outcome == HALTED and self.search and self.search.hits.stop in times[count : count + 1]:
            _, out[count] = self.search.hits.last()  # of a terminal event where the steps end too
            count += 1
        return out[:count], outcome, reason

    def _budget(self) -> int:
        """Return how many steps the kernel may take at a time."""
        return self._pace.steps

    def _ended(self, steps: int) -> Ended | None:
        """Return why the run is over after ``steps`` steps that the kernel took, if it is."""
        return None

    def _call(
        self, operation: int, between: int, times: Array, out: Array, written: int, budget: int,
        targets: int = 0, parts: int = 0, /,
    ) -> int:  # fmt: skip
        """Call the kernel once; put the implicit solver to work where it is wanted."""
        if self._context.implicit.wanted != NOT_WANTED:
            self._provide_solver()
        with self._pace:
            outcome = self._enter(
                steps.prepared(
                    operation, self._context, self._partial, between, times.size,
                    address(times), targets, parts, written, address(out), budget,
                )
            )  # fmt: skip
        return self._handled(outcome)

    def _provide_solver(self) -> None:
        """Put the implicit solver to work, which is wanted."""
        if self._context.implicit.wanted == FOR_VECTORS:
            self._make_implicit()
            self._context.implicit.wanted = NOT_WANTED
        else:
            self._take_implicit()

    def _enter(self, call: Callable[[], int]) -> int:
        """Return how the kernel came back."""
        try:
            return self._threads.during(call) if self._threads else call()
        except UserError as raised:
            self.error = raised.error
            return NOT_FINITE

    def _handled(self, outcome: int) -> int:
        """Do what the kernel came back for; return whether it may go on, or what it ended with."""
        if outcome == RENEW:
            assert self.search is not None
            self._renew(self.search.parameters)
            outcome = self._enter(steps.prepared(GO_ON, self._context))
            if outcome == DONE:
                outcome = BUDGET if self._program.varying else ANEW
        if self.stop is not None and self.stop.is_set():
            raise KeyboardInterrupt
        if self._implicit or self._vectors:
            for workspace in (*(self._implicit or ()), *(self._vectors.solvers if self._vectors else ())):
                workspace.raise_what_is_no_failure()
        if outcome == HALTED and self.search is not None and self.search.attend():
            return BUDGET
        return outcome

    @property
    def _wants_solver(self) -> bool:
        """Whether the kernel has come back for the implicit solver."""
        return self._context.implicit.wanted != NOT_WANTED

    def _samples(self, t: Array, y: Array, outcome: int, reason: "Ended | None" = None) -> Samples:
        if reason is None and outcome not in (DONE, BUDGET):
            status, sentence = self._failure(outcome)
            error = undefined_in(self._program.system) if self.error is None else None
            if error is not None and status in FROM_UNDEFINED:
                self.error, sentence = error, f"{sentence} There {UserError(error)}."
            reason = status, sentence
        if reason is not None:
            self._status, self._reason = reason
        if self._vectors:
            self.variations = self._vectors.take(t)
        return Samples(t, y, Status.FINISHED if reason is None else reason[0], self._reason)

    def _failure(self, outcome: int) -> tuple[Status, str]:
        """Return the status that an outcome stands for, and the reason as a sentence."""
        if self.error is not None:
            return Status.USER_ERROR, f"{UserError(self.error)} in the step from t = {self.t!r}."
        if self._vectors is not None and self._vectors.failed:
            return Status.NONLINEAR_DIVERGENCE, (
                f"the equations of the variations were not solved in the step from t = {self.t!r}, "
                f"h = {self._context.h!r}; {shorter(self._program)}."
            )
        if outcome == HALTED and self.search is not None:
            if self.search.trouble is not None:
                status, reason, self.error = self.search.trouble
                return status, reason
            return Status.EVENT, self.search.hits.reason
        if outcome == ACCUMULATE:
            return accumulated(self.t)
        if (
            outcome in (DIVERGED, SCATTERED)
            and (noise := self._noise(ALL_LENGTHS)).added(self._context.h) > LEAST_NOISE
        ):
            return noise.ends(self.t, self._context.h)
        return failure(outcome, self._program, (self._context, self._partial), self.t, self._solver)

    def _noise(self, lengths: Sequence[float]) -> Noise:
        """Return the noise of a field that is called, at the present state."""
        ctx, system, values = self._context, self._program.system, np.empty(self._dim)
        if not isinstance(system, Opaque):
            return Noise(0.0 * self.y, 0.0 * self.y, self.y)

        def field(t: float, y: Array) -> Array:
            try:
                system.evaluate(t, y, ctx.par, values)
            except Exception:  # beside the trajectory the function may not be defined
                values[:] = np.nan
            ctx.counters.evaluations += 1
            return values.copy()

        with np.errstate(all="ignore"):
            return Noise(field_noise(field, self.t, ctx.h, self.y, lengths), field(self.t, self.y), self.y)


def accumulated(t: float) -> tuple[Status, str]:
    """Return the status of a trajectory whose events accumulate at a time, and the reason as a sentence."""
    return Status.STALLED, (
        f"events that change the state accumulate at t = {t!r}: the times between them become "
        "too short to be told from none, or the state stays where the event happens."
    )


def failure(
    outcome: int, program: Program, contexts: tuple[Context, Context], t: float, solver: str = "fixed-point"
) -> tuple[Status, str]:
    """Return the status that an outcome of the kernel stands for, and the reason as a sentence."""
    ctx = contexts[0]
    if outcome == NOT_KEPT and program.kept:
        return Status.NOT_INVARIANT, program.kept.refusal(contexts, t)
    if outcome == NOT_FINITE:
        raises = undefined_in(program.system) is not None  # and is told with what it raised
        place = "" if raises else where_undefined(program.system, t, ctx.read(), ctx.par, ctx.h)
        return Status.NOT_FINITE, (
            f"the vector field is not finite in the step from t = {t!r}{place and f': {place}'}."
        )
    if outcome == SCATTERED:
        return Status.NONLINEAR_DIVERGENCE, (
            f"the equations of the step from t = {t!r}, h = {ctx.h!r} have no solution near "
            f"the trajectory: the one found oscillates within the step; {shorter(program)}."
        )
    return Status.NONLINEAR_DIVERGENCE, (
        f"the {solver} iteration did not converge in the step from t = {t!r}, "
        f"h = {ctx.h!r} (last relative change {ctx.solver.last:.1e}); {shorter(program)}."
    )


def shorter(program: Program) -> str:
    """Return what makes the steps of a method shorter."""
    return "give a smaller tol, or max_step" if program.varying else "take a smaller h"
