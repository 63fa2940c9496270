"""Base classes of integrators written in Python.

Subclasses define the step; sampling, checkpoints and failures are inherited. `FixedStep` is for methods with
a fixed step size. `ProgramBase` and `StepperBase` are for methods with an adaptive step size; `FixedStepper`
is also for libraries that hold the state of a fixed-step integration themselves.
"""

import math
import threading
from dataclasses import dataclass, replace
from functools import cached_property
from time import perf_counter
from typing import Any, ClassVar, Protocol, TypeGuard
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from integrators.options import Step
from integrators.protocol import (
    Array,
    Compiled,
    MethodBase,
    Samples,
    Stats,
    Status,
    UserError,
    undefined_in,
)
from integrators.refusals import (
    are_finite,
    check_parameters,
    check_start,
    check_state,
    check_times,
    one_thread,
)
from integrators.running.checkpoints import Identity
from integrators.running.times import plan
from integrators.running.watchdog import StallDetector
from integrators.undefined import where_undefined
from problems.errors import unknown
from problems.problem import System
from problems.systems.opaque import Opaque

WHOLE = 1e-6  # of a step, which is rounding where steps are counted

__all__ = ["FixedStep", "FixedStepper", "March", "ProgramBase", "RestorableStepper", "StepperBase"]


class ProgramBase(Compiled):
    """A method compiled for one system; satisfies `integrators.protocol.Program`.

    A subclass implements `stepper`.
    """

    compile_seconds: float = 0.0
    from_cache: bool | None = None

    def __init__(self, system: System, method: MethodBase):
        self.system, self.method = system, method

    def start(self, y0: ArrayLike, par: ArrayLike | None = None, t0: float = 0.0) -> "StepperBase":
        """Return a stepper at ``t0``; see the protocol.

        Raises
        ------
        problems.errors.InputError
            For a state or time that is not finite, or a wrong shape.
        """
        values = check_parameters(par, self.system)
        stepper = self.stepper(check_state(y0, self.system.dim), values, check_start(t0))
        stepper.started = self, values
        if isinstance(self.system, Opaque):
            self.system.forget_undefined()
        return stepper

    def stepper(self, y: Array, par: Array, t: float) -> "StepperBase":
        """Return a stepper at a checked initial state, which it may modify."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """All data that the continuation of a stepper depends on."""

    t: float
    y: Array
    status: Status
    reason: str
    inner: Any
    identity: Identity


class StepperBase:
    """A trajectory; satisfies `integrators.protocol.Stepper`.

    A subclass sets its ``samplings`` (the default first) and implements `_serve`, `_step_states` and
    `_one_step`. One with checkpoints is a `RestorableStepper`.

    The current time ``t`` and state ``y`` are those last returned. The library itself may be ahead of them
    (an adaptive method, whose steps are not shortened for a sample) or behind (a fixed step size, if the
    sample is the end of a partial step). After a failure they are the last state that was reached, with its
    time: `_fail` takes both.
    """

    samplings: ClassVar[tuple[str, ...]] = ()
    started: tuple[ProgramBase, Array]
    """The program and the parameters that it was started with."""
    error: Exception | None = None
    """What a function of the user raised, where the status is ``USER_ERROR``."""
    destination: float | None = None
    """Where the whole integration ends, if ``advance`` goes there in pieces."""
    detector: StallDetector | None = None
    """Detects stalls on the way to the destination; see `integrators.running.watchdog`."""

    def __init__(self, y: Array, t: float):
        self._at_work = threading.RLock()
        self._t, self._y = t, y
        self._status, self._reason = Status.RUNNING, ""
        self._stats = Stats()

    @property
    def t(self) -> float:
        """The current time; after a failure, that of the last state that was reached."""
        return self._t

    @property
    @one_thread
    def y(self) -> Array:
        """A copy of the current state."""
        return self._y.copy()

    @property
    def status(self) -> Status:
        """Status of the integration."""
        return self._status

    @property
    def reason(self) -> str:
        """One sentence on a failure; empty otherwise."""
        return self._reason

    @property
    def stats(self) -> Stats:
        """Statistics."""
        return self._stats

    @one_thread
    def step(self) -> Status:
        """Take one step of the method; after a failure, do nothing."""
        if self._status is Status.RUNNING:
            reached = self._one_step()
            if reached is not None:
                self._reached(np.array(reached[:1]), np.array(reached[1])[np.newaxis])
        return self._status

    @one_thread
    def advance(self, times: ArrayLike, *, sample: str | None = None) -> Samples:
        """Integrate to ``times[-1]``; see the class for the samplings and the protocol for the rest."""
        how = self.samplings[0] if sample is None else sample
        if how not in self.samplings:
            raise unknown(f"sampling of {type(self).__name__.removesuffix('Stepper')}", how, self.samplings)
        if how == "stop" and self._is_ahead(times):
            return self._stop_on_samples(times)
        grid = check_times(times, self._t)
        dim = self._y.size
        if self._status is not Status.RUNNING:
            return Samples(grid[:0], np.empty((0, dim)), self._status, self._reason)
        here = int(grid[0] == self._t)
        t, y = grid[:here], np.tile(self._y, (here, 1))
        ahead = grid[here:]
        if ahead.size:
            more = self._step_states(float(ahead[-1])) if how == "steps" else self._serve(ahead, how)
            t, y = np.concatenate([t, more[0]]), np.concatenate([y, more[1]])
            if t.size:
                t, y = self._reached(t, y)
        elif self.destination is not None and self.destination < self._t:
            self._towards(self.destination)  # `step` goes forward otherwise
        status = Status.FINISHED if self._status is Status.RUNNING else self._status
        return Samples(t, y, status, self._reason)

    def _is_ahead(self, times: ArrayLike) -> TypeGuard[Array]:
        """Whether ``times`` are one time, and nothing else has to be looked at before going there."""
        if not (isinstance(times, np.ndarray) and times.shape == (1,) and times.dtype == np.float64):
            return False
        return math.isfinite(t := times.item()) and t != self._t and not self._status.failed

    def _stop_on_samples(self, time: Array) -> Samples:
        """Go to one time, as `advance` does, with as little as can be around the library's own call.

        Short runs are timed this way, and each of NumPy's calls left out here weighs in them.
        """
        grid, states = self._serve(time.copy(), "stop")
        if grid.size and not self._status.failed and are_finite(states[-1]):
            self._t, self._y = time.item(), states[-1].copy()
        elif grid.size:
            grid, states = self._reached(grid, states)
        status = self._status if self._status.failed else Status.FINISHED
        return Samples(grid, states, status, self._reason)

    def _arrive(self, t: float, y: Array) -> None:
        self._t, self._y = t, np.array(y, dtype=np.float64)

    def _reached(self, t: Array, y: Array) -> tuple[Array, Array]:
        """Arrive at the last of some states and return them, without the last where it is not finite."""
        end, finite = float(t[-1]), are_finite(y[-1])
        if not finite:
            t, y = t[:-1], y[:-1]
        if not self._status.failed:
            if t.size:
                self._arrive(float(t[-1]), y[-1])
            if not finite:
                last = self._last_finite(end)
                self._fail(Status.NOT_FINITE, *last, f"the state is not finite at t = {end!r}.")
        return t, y

    def _last_finite(self, t: float) -> tuple[float, Array]:
        """Return the last finite state on the way from the present to ``t``, and its time before it."""
        return self._t, self._y

    def _fail(self, status: Status, t: float, y: Array, reason: str) -> None:
        """End with the state ``y``, reached at ``t``; where one of them is not finite, at the present."""
        if math.isfinite(t) and are_finite(y):
            self._arrive(t, y)
        if status in (Status.NOT_FINITE, Status.STEP_UNDERFLOW) and self.error is None:
            program, par = self.started
            undefined = undefined_in(program.system)
            if undefined is not None:
                self.error, reason = undefined, f"{reason} There {UserError(undefined)}."
            elif place := where_undefined(program.system, self._t, self._y, par):
                reason = f"{reason.rstrip('.')}; {place}."
        self._status, self._reason = status, reason

    def _towards(self, end: float) -> float | None:
        """Turn round where ``end`` lies on the other side of the present; a subclass may return the sign."""

    def _serve(self, grid: Array, how: str) -> tuple[Array, Array]:
        """Return a leading part of ``grid`` (all of it ahead of the present) and the states there.

        The last of these states may be the first that is not finite, which ends the integration.
        """
        raise NotImplementedError

    def _step_states(self, end: float) -> tuple[Array, Array]:
        """Return the steps from the present (excluded) to ``end`` (included), as `_serve` does."""
        raise NotImplementedError

    def _one_step(self) -> tuple[float, Array] | None:
        """Take one step and return where it arrived; ``None`` after a failure."""
        raise NotImplementedError


class RestorableStepper(StepperBase):
    """A trajectory with `integrators.protocol.Checkpoints`; a subclass implements `_save` and `_load` too."""

    @cached_property
    def identity(self) -> Identity:
        """The identity of the integration that its checkpoints belong to."""
        program, par = self.started
        return Identity.from_system(repr(program.method), program.system, par)

    @one_thread
    def checkpoint(self) -> Checkpoint:
        """Return a copy of all data that the continuation depends on."""
        return Checkpoint(self._t, self._y.copy(), self._status, self._reason, self._save(), self.identity)

    @one_thread
    def restore(self, checkpoint: Checkpoint) -> None:
        """Restore a checkpoint of the same program; the statistics continue.

        Raises
        ------
        problems.errors.InputError
            If the checkpoint is that of another method, of other options, another system or other parameters;
            the stepper is not changed.
        """
        self.identity.check(checkpoint, Checkpoint)
        self._t, self._y = checkpoint.t, checkpoint.y.copy()
        self._status, self._reason, self.error = checkpoint.status, checkpoint.reason, None
        self._load(checkpoint.inner)

    def _save(self) -> Any:
        """Return a copy of the library's own state."""
        raise NotImplementedError

    def _load(self, inner: Any) -> None:
        """Take back what `_save` returned, without keeping a reference to it."""
        raise NotImplementedError


class FixedStepper(RestorableStepper):
    """A stepper with a fixed step size, whose steps end at the times t0 + n h.

    ``"partial"`` (default)
        Times that are a multiple of h are ends of steps; for others one partial step is taken from a copy of
        the state.
    ``"steps"``
        The steps up to the last time.
    ``"stop"``
        The last step before each time is shortened to end there; the next steps start from there.

    The state is one array, which ``program.march``, a `March`, advances. For a library that holds the
    state itself a subclass has its own `_march`, `_state`, `_aside`, `_shorten` (unless it leaves out
    ``"stop"``), `_restart`, `_save_steps` and `_load_steps`.

    Parameters
    ----------
    program : ProgramBase
        Its ``method`` has the step ``h``.
    y, par, t
        A start, checked, and the stepper's own.
    """

    samplings = ("partial", "steps", "stop")
    at_once = 1 << 14
    """Steps between two looks at Ctrl-C."""
    marks = True
    """Whether `_save_steps` costs less than a step."""

    def __init__(self, program: Any, y: Array, par: Array, t: float):
        super().__init__(y, t)
        self._program, self._par, self._here = program, par, y.copy()
        self._t0, self._n, self._h = t, 0, program.method.h
        self._behind: tuple[float, int, Any] | None = None  # where the last steps began
        if not program.system.traced:  # slow anyway, and known is then which step it was that failed
            self.at_once = 1
        if getattr(program.method, "evaluations", None) is not None:
            self._stats.evaluations = 0

    def _time(self) -> float:
        return self._t0 + self._n * self._h

    def _towards(self, end: float) -> None:
        """Turn round where ``end`` lies on the other side of the present: steps count from here then."""
        if (end - self._t) * self._h < 0.0:
            self._t0, self._n, self._h, self._behind = self._t, 0, -self._h, None
            self._restart(self._t, self._y, self._h)

    def _go(self, n: int) -> None:
        """March to the step with number ``n``, to a failure, or some steps beyond the last finite state."""
        while self._n < n and not self._status.failed:
            count = min(n - self._n, self.at_once)
            if self.marks:
                self._behind = self._t0, self._n, self._save_steps()
            self._march(count)
            self._stats.steps += count
            self._n += count
            if self._n < n and not are_finite(self._state()):
                return

    def _last_finite(self, t: float) -> tuple[float, Array]:
        """Return the end of the last step whose state is finite: by steps taken again, in halves."""
        last = self._t, self._y
        if are_finite(state := self._state()):  # that between two steps is not
            return (self._time(), state) if (self._time() - self._t) * self._h > 0.0 else last
        self._stats, stats = self._stats.copy(), self._stats
        self._t0, self._n, mark = self._behind or (self._t, 0, None)
        if mark is not None and (self._time() - self._t) * self._h > 0.0:
            self._load_steps(mark)
            last = self._time(), self._state()
        left = int((t - self._time()) / self._h + WHOLE)
        count = 1 << left.bit_length()
        while count := count // 2:
            if count > left:
                continue
            if mark is None:
                self._restart(*last, self._h)
            else:
                self._load_steps(mark)
            self._march(count)
            if are_finite(state := self._state()):
                self._n, left = self._n + count, left - count
                last, mark = (self._time(), state), None if mark is None else self._save_steps()
        self._stats = stats
        return last

    def _serve(self, grid: Array, how: str) -> tuple[Array, Array]:
        self._towards(float(grid[-1]))
        if how == "stop":
            return self._step_to(grid)
        counts, parts = plan(grid, np.full(grid.size, self._t0), self._h)
        states = np.empty((grid.size, self._y.size))
        for i, (n, part) in enumerate(zip(counts.tolist(), parts.tolist(), strict=True)):
            self._go(n)
            states[i] = self._aside(part) if part else self._state()
            if not np.isfinite(states[i]).all():
                return grid[: i + 1], states[: i + 1]
        return grid, states

    def _step_to(self, grid: Array) -> tuple[Array, Array]:
        states = np.empty((grid.size, self._y.size))
        for i, t in enumerate(grid.tolist()):
            count, part = plan(grid[i : i + 1], np.array([self._t0]), self._h)
            self._go(int(count[0]))
            if part[0]:
                self._shorten(float(part[0]))
                self._stats.steps += 1
                self._t0, self._n = t, 0
            states[i] = self._state()
            if not np.isfinite(states[i]).all():
                return grid[: i + 1], states[: i + 1]
        return grid, states

    def _step_states(self, end: float) -> tuple[Array, Array]:
        self._towards(end)
        last = int(plan(np.array([end]), np.array([self._t0]), self._h)[0][0])
        times: Array = self._t0 + self._h * np.arange(self._n + 1, last + 1, dtype=np.float64)
        states = np.empty((times.size, self._y.size))
        for i in range(times.size):
            self._go(self._n + 1)
            states[i] = self._state()
            if not np.isfinite(states[i]).all():
                return times[: i + 1], states[: i + 1]
        return times, states

    def _one_step(self) -> tuple[float, Array]:
        self._go(self._n + 1)
        return self._time(), self._state()

    def _save(self) -> Any:
        return self._t0, self._n, self._h, self._save_steps()

    def _load(self, inner: Any) -> None:
        self._t0, self._n, self._h, steps = inner
        self._behind = None
        self._load_steps(steps)

    def _march(self, count: int) -> None:
        """Take ``count`` steps, no more than ``at_once``."""
        self._steps(self._t0, self._h, self._n, count, self._here)
        self._evaluated(count)

    def _steps(self, t: float, h: float, first: int, n: int, y: Array) -> None:
        """Take steps by the program's `March`; where the user's own field raises, it fails and y is NaN."""
        try:
            self._program.march(t, h, first, n, y, self._par)
        except Exception as error:
            if self._program.system.traced:
                raise
            start, before, self.error = t + first * h, y.copy(), error
            y[:] = np.nan
            self._fail(
                Status.USER_ERROR, start, before, f"{UserError(error)} in the step from t = {start!r}."
            )

    def _evaluated(self, steps: int) -> None:
        if (each := self._program.method.evaluations) is not None:
            self._stats.evaluations = (self._stats.evaluations or 0) + steps * each

    def _state(self) -> Array:
        """Return a copy of the state at the last step."""
        return self._here.copy()

    def _aside(self, part: float) -> Array:
        """Return the state a partial step of length ``part`` after the last step."""
        y = self._here.copy()
        self._steps(self._time(), part, 0, 1, y)
        return y

    def _shorten(self, part: float) -> None:
        """Take one step of length ``part`` after the last step."""
        self._here = self._aside(part)
        self._evaluated(1)

    def _restart(self, t: float, y: Array, h: float) -> None:
        """Begin anew at ``t`` with steps of ``h``."""
        self._here = y.copy()

    def _save_steps(self) -> Any:
        """Return a copy of what the next steps depend on."""
        return self._here.copy()

    def _load_steps(self, steps: Any) -> None:
        """Take back what `_save_steps` returned."""
        self._here = steps.copy()


class March(Protocol):
    """Function that takes steps ``first`` ... ``first + n - 1`` of size ``h``; step i begins at ``t + i h``.

    The state ``y``, shape (dim,), is changed in place.
    """

    def __call__(self, t: float, h: float, first: int, n: int, y: Array, par: Array, /) -> object: ...


@dataclass(frozen=True, kw_only=True, repr=False)
class FixedStep(MethodBase):
    """Base class of an integrator with a fixed step size.

    Subclasses define the step; sampling, checkpoints and failures are inherited.

    A subclass is a frozen dataclass. It sets ``order``, ``library``, ``family``, ``citation`` and
    ``evaluations`` (without annotations, which would make them options), defines `accepts` if it does not
    accept all problems, and returns from `march` the function that takes steps. Statistics and backward
    integration are inherited too; `integrators.testing.check_method` checks the result.

    Parameters
    ----------
    h : float
        Step size, > 0; the output times determine the direction.

    Attributes
    ----------
    evaluations : int or None
        Evaluations of the right-hand side, or of the force, per step.

    Raises
    ------
    problems.errors.InputError
        For a step size that is not a finite number above 0.

    Examples
    --------
    ``examples/integrator`` has Yoshida's composition of order 6 in about forty lines.
    """

    h: Step

    evaluations: ClassVar[int | None] = None

    def march(self, system: System) -> March:
        """Return the function that takes steps of ``system``, compiled with numba for speed.

        ``problems.targets.numba(system, "field")`` is the right-hand side, ``f(t, y, par, out)``; a separable
        system also has ``"force"``, p', and ``"velocity_scale"``, c with q' = c p. The field of a
        `problems.Opaque` is Python code; the uncompiled function is then called.

        The function must depend only on its arguments, because samples between steps and checkpoints rely on
        that. It is stored while ``system`` exists, and is used for every ``h``.
        """
        raise NotImplementedError

    def compile(self, system: System) -> "FixedStepProgram":
        """Compile what `march` returns."""
        return FixedStepProgram(system, self)


_marches: WeakKeyDictionary[System, dict[FixedStep, March]] = WeakKeyDictionary()


class FixedStepProgram(ProgramBase):
    """A `FixedStep` method compiled for one system."""

    def __init__(self, system: System, method: FixedStep):
        super().__init__(system, method)
        started = perf_counter()
        known, key = _marches.setdefault(system, {}), replace(method, h=1.0)
        self.from_cache = key in known
        self.march = known[key] if self.from_cache else method.march(system)
        if not system.traced:  # compiled code cannot call a field in Python
            self.march = getattr(self.march, "py_func", self.march)
        # No step at all: numba compiles at the first call, and its seconds belong here.
        self.march(0.0, method.h, 0, 0, np.zeros(system.dim), system.pack())
        known[key] = self.march
        self.compile_seconds = perf_counter() - started

    def stepper(self, y: Array, par: Array, t: float) -> FixedStepper:
        """Return a trajectory."""
        return FixedStepper(self, y, par, t)
