"""The protocol that every integrator satisfies.

Guide for implementers
----------------------
A **method** is a description; it holds only options.

For a method with a fixed step size derive from `integrators.stepping.FixedStep`; only the class attributes,
``accepts`` and the function that takes the steps have to be written.

1. Derive a frozen, keyword-only dataclass from `MethodBase`. Annotate each option with its constraint
   (`problems.checks`, `integrators.options`), which is then checked. Check conditions on several options in
   ``__post_init__``, after that of the base, and raise `problems.errors.InputError`.
2. Set the class attributes ``library`` (the package that does the work), ``citation`` (how its authors ask
   to be cited) and ``order`` (``None`` where the order varies with the tolerance).
3. ``accepts(problem)`` returns ``None``, or a sentence on why the method cannot integrate it. Omit it if the
   method accepts every system.
4. ``compile(system)`` does all compilation, imports the library (raising
   `problems.errors.MissingLibraryError`) and returns a `Program`, which knows the seconds that this took.
   Parameters are run-time values.
5. ``program.start(y0, par, t0)`` returns a `Stepper` at ``t0``.
6. A stepper's ``advance`` does most of the work in compiled code and returns the samples it reached;
   ``step`` takes one step, for inspection. The class attribute ``to_end`` names the sampling with which the
   library itself integrates to an end time, if it differs from the default: that one is timed.
7. A numerical failure is a `Status`, never an exception, never a silent NaN, and never an endless loop; the
   samples computed before it are returned.
8. Register the class under the entry point group ``hbvm_bench.integrators``; `integrators.testing` then
   checks it against this guide.

The following is optional. Each capability is a class of this module, which the rest of the package tests for
by `offers`; without it the method still integrates. The conformance kit checks those that are offered.

9. `Samplings`: the attribute ``samplings`` of a stepper lists the samplings that its ``advance`` supports,
   the default first. Without it all of `SAMPLINGS` are expected.
10. `Checkpoints`: ``checkpoint`` returns all data that a bitwise identical continuation needs, with the
    identity of the integration (`integrators.running.checkpoints.Identity`); ``restore`` accepts only such a
    checkpoint. Checkpoint files need it (``integrate(checkpoint=...)``).
11. `Destination`: the attribute ``destination`` of a stepper is the end of the whole integration, which
    `integrate` reaches in pieces. The vector field is not evaluated beyond it: the last step is shortened.
    Whether steps have collapsed is judged by the way to it, see `integrators.running.watchdog`.
12. `KeptError`: after ``USER_ERROR``, ``error`` is the exception raised by a user function.
13. `Events`: ``with_events`` of a program starts steppers that search their steps for events. Such an
    `EventStepper` has the ``search``, and ``look_to``, which searches the next step up to the last time.
    `Actions`: with ``acts`` these events may change the state and the parameters. `BatchesEvents`: what
    ``with_events`` returns can ``find_in_batch`` the events of many trajectories, if it
    ``goes_in_batches``.
14. `Interruptible`: another thread sets ``stop`` of a stepper to interrupt ``advance``. Many trajectories
    with events are integrated in several threads.
15. `Batches`: ``batch`` of a program integrates many initial conditions faster than one after another, for
    `integrate_many`. `PreparedBatches`: ``prepare_batch`` does everything except the integration, which the
    benchmark can then time separately. `Threads`: with ``threaded`` it takes ``threads=``. `PieceSize`:
    ``piece`` is the recommended number of trajectories of the first call.
16. `TimeLimit`: after ``time_limit`` seconds ``advance`` returns the samples that it has computed, so that
    `integrate` can request all of them at once and Ctrl-C loses few.
17. `Variations`: ``follow`` of a stepper propagates tangent vectors; ``variations`` are the vectors at the
    samples of the last ``advance``. `BatchesAlong`: ``batch_along`` of a program integrates many initial
    conditions with tangent vectors, if it ``goes_along`` with so many.
18. `Gradients`: a stepper can ``record`` its steps, and ``adjoint`` integrates the adjoint equations over
    them backwards. `integrators.gradient` needs this and `Checkpoints`.
19. `DoubleDouble`: ``start_pairs`` of a program starts from states with twice the digits of a double;
    ``low`` of such a `LowParts` stepper has the low parts of the samples.
20. `AsHBVM`: ``as_hbvm`` of a method returns the HBVM(k, s) that it is identical to; `integrators.order_of`
    and the plugins use its coefficients.
"""

import inspect
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cache, wraps
from typing import Any, ClassVar, Literal, Protocol, cast, get_args, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from problems.checks import CheckedOptions
from problems.errors import InputError, shown
from problems.problem import Problem, System, check_is_problem
from problems.systems.opaque import Opaque

__all__ = [
    "CAPABILITIES",
    "SAMPLINGS",
    "Actions",
    "AsHBVM",
    "Batches",
    "Checkpoints",
    "Destination",
    "DoubleDouble",
    "EventStepper",
    "Events",
    "Gradients",
    "Interruptible",
    "KeptError",
    "LowParts",
    "MethodBase",
    "PieceSize",
    "PreparedBatches",
    "Program",
    "Samples",
    "Samplings",
    "Stats",
    "Status",
    "Stepper",
    "Threads",
    "TimeLimit",
    "Trajectories",
    "UserError",
    "offers",
]

Array = NDArray[np.float64]

SamplingName = Literal["partial", "steps", "stop", "dense"]
SAMPLINGS: tuple[str, ...] = get_args(SamplingName)


class Status(StrEnum):
    """Status of an integration.

    Examples
    --------
    >>> from integrators import Status
    >>> Status.STALLED.failed, Status.EVENT.failed, str(Status.FINISHED)
    (True, False, 'finished')
    """

    RUNNING = "running"
    FINISHED = "finished"
    EVENT = "event"
    NONLINEAR_DIVERGENCE = "nonlinear_divergence"
    STEP_UNDERFLOW = "step_underflow"
    NOT_FINITE = "not_finite"
    STALLED = "stalled"
    NOT_INVARIANT = "not_invariant"
    SLIDING = "sliding"
    MAX_STEPS = "max_steps"
    USER_ERROR = "user_error"
    INTERRUPTED = "interrupted"
    INACCURATE = "inaccurate"

    @property
    def failed(self) -> bool:
        """Whether the integration ended before the requested time, or what it found is known to be wrong."""
        return self not in _NO_FAILURES


_NO_FAILURES = (Status.RUNNING, Status.FINISHED, Status.EVENT)  # looked up once, and not in each step


class UserError(Exception):
    """Exception raised by a user function, together with the states computed before it.

    Attributes
    ----------
    error : Exception
        The original exception.
    """

    def __init__(self, error: Exception):
        said = " ".join(str(error).split())
        super().__init__(f"a function of yours raised {type(error).__name__}{f' ({said})' if said else ''}")
        self.error = error


def undefined_in(system: System) -> Exception | None:
    """Return what a user's field raised where it is not defined (`ArithmeticError`, `ValueError`), if it did.

    Its value is NaN there, and a shorter step may avoid the place; where none does, this is why.
    """
    return system.undefined if isinstance(system, Opaque) else None


@dataclass
class Stats:
    """Statistics of an integration; ``None`` if a library does not count a quantity.

    Attributes
    ----------
    steps : int
        Accepted steps.
    rejections : int or None
        Rejected steps.
    evaluations : int or None
        Evaluations of the right-hand side at one state.
    iterations : int or None
        Iterations of the nonlinear solver, over all steps, partial ones included.
    solver : str or None
        The nonlinear solver that was used.
    extra : dict
        Further information, by name; arrays for histories such as
        ``{"dt_history": (n, 2) array of t and dt}``.

    Examples
    --------
    >>> import problems
    >>> from integrators import Gauss, integrate
    >>> stats = integrate(problems.load("pendulum"), Gauss(s=4, h=0.1), [10.0]).stats
    >>> stats.steps, stats.rejections, stats.solver
    (100, 0, 'fixed point')
    """

    steps: int = 0
    rejections: int | None = None
    evaluations: int | None = None
    iterations: int | None = None
    solver: str | None = None
    extra: dict[str, Any] = field(default_factory=dict)

    def copy(self) -> "Stats":
        """Return a copy of the current counters."""
        return Stats(**vars(self))  # in a third of the time of `dataclasses.replace`


@dataclass(frozen=True)
class Samples:
    """States reached by one call of ``advance``.

    Attributes
    ----------
    t : ndarray, shape (n,)
        The times reached: the first n output times, or the ends of the steps with ``sample="steps"``.
    y : ndarray, shape (n, dim)
        The states at these times, in the problem's coordinates.
    status : Status
        ``FINISHED`` if all output times were reached.
    reason : str
        One sentence on a failure; empty otherwise.

    Examples
    --------
    >>> import problems
    >>> from integrators import Gauss
    >>> problem = problems.load("pendulum")
    >>> stepper = Gauss(s=4, h=0.1).compile(problem.system).start(problem.y0, problem.par)
    >>> samples = stepper.advance([1.0, 2.0])
    >>> samples.t, samples.y.shape, samples.status
    (array([1., 2.]), (2, 2), <Status.FINISHED: 'finished'>)
    """

    t: Array
    y: Array
    status: Status
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Trajectories:
    """Trajectories of one system from many initial conditions, as ``batch`` of a program returns them.

    Attributes
    ----------
    t : ndarray, shape (m,)
        Times.
    y : ndarray, shape (n, m, dim)
        States; NaN where a trajectory did not reach the time. The last state of one that failed before all
        times: ``integrators.integrate(made[i].problem, made.method, [end])``.
    status, reason : list, length n
        Status of each trajectory, and one sentence if it failed.
    t_stop : ndarray, shape (n,)
        The last time, or the time of the last step before a failure.
    steps : ndarray of int, shape (n,)
        Accepted steps.
    extra : dict of int to dict
        Entries of `Stats.extra` that warnings are derived from, by the index of the trajectory; see
        `telling`.
    variations : ndarray, shape (n, m, dim, k), or None
        Tangent vectors at the times, if requested.
    """

    t: Array
    y: Array
    status: list[Status]
    reason: list[str]
    t_stop: Array
    steps: NDArray[np.int64]
    extra: dict[int, dict[str, Any]] = field(default_factory=dict, kw_only=True)
    variations: Array | None = field(default=None, kw_only=True)


def telling(stats: Stats) -> dict[str, Any]:
    """Return the entries of ``stats.extra`` that warnings are derived from."""
    return {name: stats.extra[name] for name in ("kinks", "implicit") if name in stats.extra}


@runtime_checkable
class Stepper(Protocol):
    """An integration in progress."""

    @property
    def t(self) -> float: ...
    @property
    def y(self) -> Array: ...
    @property
    def status(self) -> Status: ...
    @property
    def reason(self) -> str: ...
    @property
    def stats(self) -> Stats: ...

    def step(self) -> Status:
        """Take one step of the method."""
        ...

    def advance(self, times: Array, *, sample: str | None = None) -> Samples:
        """Integrate to ``times[-1]`` and return the states at ``times``.

        The stepper is then at ``times[-1]`` or, if states between steps are computed without a change of the
        steps, at the last step before it.

        Parameters
        ----------
        times : ndarray, shape (n,)
            Finite, strictly monotone in the direction of integration; the
            first may be the current time.
        sample : {"partial", "steps", "stop", "dense"}, optional
            How states between steps are computed. ``None``: the most accurate way that leaves the steps
            unchanged, or a stop at the output times if the method does not lose efficiency by it. A method
            refuses samplings that it does not support.

        Returns
        -------
        Samples

        Raises
        ------
        problems.errors.InputError
            For times that are not finite or not monotone, or a sampling that the method does not support.
        """
        ...


@runtime_checkable
class Program(Protocol):
    """A method compiled for one system; parameters are run-time values."""

    @property
    def compile_seconds(self) -> float: ...
    @property
    def from_cache(self) -> bool | None:
        """Whether compiled code came from a cache; ``None`` where nothing is compiled."""
        ...

    def start(self, y0: Array, par: Array | None = None, t0: float = 0.0) -> Stepper:
        """Return a stepper at ``t0``; raises `UserError` if a user function raises there."""
        ...


class Compiled:
    """Base class of programs.

    A pickled program contains the method and the system, and is compiled again when it is loaded.

    Attributes
    ----------
    method : MethodBase
        Set by its `MethodBase.compile`.
    system : System
        The system that it was compiled for.
    """

    method: Any
    system: System

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self.method).compile, (self.method, self.system)


class Samplings(Protocol):
    """A stepper that does not support all of `integrators.protocol.SAMPLINGS`, or has another default.

    Attributes
    ----------
    samplings : tuple of str
        The samplings that its ``advance`` supports, the default first; it refuses all others.
    """

    samplings: tuple[str, ...]


class Destination(Protocol):
    """A stepper that knows the end of the whole integration, which ``advance`` reaches in pieces.

    It does not evaluate the vector field beyond it: the last step is shortened. A stepper that detects
    stalled integrations compares its progress with this distance, not with that of a piece.

    Attributes
    ----------
    destination : float or None
        The end time; ``None``: each ``advance`` is a separate integration.
    """

    destination: float | None


class KeptError(Protocol):
    """A stepper that stores the exception raised by a user function.

    Attributes
    ----------
    error : Exception or None
        The original exception, if the status is ``USER_ERROR``, or if a field is not defined where the
        integration has failed.
    """

    error: Exception | None


class Checkpoints(Protocol):
    """A stepper whose integration can be continued later, bitwise identical to one without a break."""

    def checkpoint(self) -> Any:
        """Return all data that the continuation depends on, as a value that can be pickled (not a view)."""
        ...

    def restore(self, checkpoint: Any) -> None:
        """Restore a checkpoint of this program; the continuation is bitwise identical.

        The checkpoint may be that of another stepper of the program, or of another program of the
        same method and system. It does not contain the parameters: the stepper must have been started with
        the same ones.

        Raises
        ------
        problems.errors.InputError
            For any other checkpoint: of another method, other options, another system or other parameters
            (`integrators.running.checkpoints.Identity`). The stepper is not changed.
        """
        ...


class Interruptible(Protocol):
    """A stepper that another thread can interrupt.

    Attributes
    ----------
    stop : threading.Event or None
        If it is set, ``advance`` soon raises `KeyboardInterrupt`; its samples are discarded.
    """

    stop: threading.Event | None


class TimeLimit(Protocol):
    """A stepper whose ``advance`` returns with a part of the samples after a time limit.

    Attributes
    ----------
    time_limit : float
        Seconds after which ``advance`` returns the samples that it has, if there are any, as
        ``FINISHED``; called with the remaining times it continues as if it had not returned. Initially
        infinite.
    """

    time_limit: float


class EventStepper(Protocol):
    """A stepper that searches its steps for events, as `Events.with_events` starts it.

    Attributes
    ----------
    search : integrators.events.finder.Finder
        The search, with the events found so far.
    """

    search: Any

    def look_to(self, end: float) -> Status:
        """Search for events from the last step to a time within the next step."""
        ...


class Actions(Protocol):
    """A program whose events may change the state and the parameters (``Event(then=...)``).

    A stepper that looks for such events has ``par``, the present parameters, shape (n_par,), and its
    ``search`` passes those after each event to `integrators.events.finder.EventLog`.

    Attributes
    ----------
    acts : bool
        Whether they may.
    """

    acts: bool


class Variations(Protocol):
    """A stepper that can propagate tangent vectors.

    Attributes
    ----------
    variations : ndarray, shape (m, dim, n), or None
        The vectors at the samples of the last ``advance``.
    """

    variations: Array | None

    def follow(self, state: ArrayLike, parameters: ArrayLike) -> None:
        """Propagate tangent vectors along the trajectory from here on.

        They are the derivatives of the steps that are taken, with fixed step sizes.

        Parameters
        ----------
        state : array_like, shape (dim, n)
            Their components in the state.
        parameters : array_like, shape (n_par, n)
            Their components in the parameters.

        Raises
        ------
        problems.errors.InputError
            For a system without a formula, and steps that are not those of a Runge-Kutta method.
        """
        ...

    def scale(self, factors: ArrayLike) -> None:
        """Multiply the vectors by numbers, from the end of the last step on.

        Powers of 2 cause no rounding errors.

        Parameters
        ----------
        factors : array_like, shape (n,)
            One for each vector; their components in the parameters must be 0.
        """
        ...


class Gradients(Protocol):
    """A stepper whose steps can be recorded for the adjoint equations."""

    def march(self, end: float, most: int) -> Samples:
        """Take at most ``most`` steps, none beyond the time ``end``, and return their ends."""
        ...

    def recorder(self, capacity: int) -> Any:
        """Return memory for the records of ``capacity`` steps: it has a ``len``, and a size in ``bytes``.

        Raises
        ------
        problems.errors.InputError
            For a system without a formula, and steps that are not those of a Runge-Kutta method.
        """
        ...

    def record(self, records: Any) -> None:
        """Record the steps from here on, including partial steps."""
        ...

    def adjoint(self, *, parameters: bool) -> Any:
        """Return an integrator of the adjoint equations over recorded steps.

        ``begin(gradient)`` sets the derivatives with respect to the last state, ``follow(records)``
        integrates back to the state before the first of these steps; ``gradient`` has the derivatives with
        respect to that state and, with ``parameters``, with respect to the parameters.
        """
        ...


class Events(Protocol):
    """A program whose steps can be searched for events."""

    def with_events(
        self, problem: Problem, events: Mapping[str, Any]
    ) -> Callable[[ArrayLike, ArrayLike | None, float, float], Any]:
        """Compile the functions of events; return a function that starts a trajectory with a search for them.

        That function takes the arguments of ``start`` and the end time of the search; it returns an
        `EventStepper`. The events do not affect the steps and samples; a terminal one ends the integration
        with the status ``EVENT``.

        Parameters
        ----------
        problem : Problem
            Its variables are the arguments of the functions.
        events : mapping of str to integrators.events.Event
            The events, by name.

        Raises
        ------
        problems.errors.InputError
            For a function that the program cannot use.
        """
        ...


class Batches(Protocol):
    """A program that integrates many initial conditions faster than one after another."""

    def batch(
        self, Y0: ArrayLike, par: ArrayLike | None = None, *, times: ArrayLike, t0: float = 0.0
    ) -> Trajectories:
        """Integrate from ``Y0`` (n, dim) with parameters (n, n_par), from ``t0`` to the same times (m,).

        Each result is independent of the others. A trajectory that fails has its status, reason and time, and
        does not affect the others.
        """
        ...


class BatchesAlong(Protocol):
    """A program that integrates many trajectories with tangent vectors faster than one after another."""

    def goes_along(self, directions: tuple[Array, Array]) -> bool:
        """Whether it has for so many vectors; they are as for `batch_along`."""
        ...

    def batch_along(
        self, Y0: ArrayLike, par: ArrayLike | None = None, *, times: ArrayLike, t0: float = 0.0,
        directions: tuple[Array, Array], threads: int = 1,
    ) -> Trajectories:  # fmt: skip
        """Do what `Batches.batch` does, with vectors: the result has `Trajectories.variations`.

        Parameters
        ----------
        Y0, par, times, t0
            As for `Batches.batch`.
        directions : pair of ndarray, shapes (n, dim, k), (n, n_par, k)
            Parts of the tangent vectors in the starts and in the parameters.
        threads : int
            Threads to share the work among.

        Returns
        -------
        Trajectories

        Raises
        ------
        problems.errors.InputError
            Where `goes_along` says that it cannot, and as `Batches.batch`.
        """
        ...


class BatchesEvents(Protocol):
    """A function that `Events.with_events` returned and that also integrates many trajectories together."""

    def goes_in_batches(self) -> bool:
        """Whether `find_in_batch` can be called; it compiles what that needs."""
        ...

    def find_in_batch(
        self, Y0: ArrayLike, par: ArrayLike | None, times: ArrayLike, t0: float, threads: int
    ) -> tuple[Trajectories, list[dict[str, Any]]]:
        """Integrate as `Batches.batch` with a search for the events.

        The second result has the `integrators.solution.Occurrences` of each trajectory by the events' names.
        """
        ...


class PreparedBatches(Protocol):
    """A program whose batches can be prepared, so that the integration can be timed separately."""

    def prepare_batch(
        self, Y0: ArrayLike, par: ArrayLike | None = None, *, times: ArrayLike, t0: float = 0.0
    ) -> Callable[[], Trajectories]:
        """Compile, check and allocate for `Batches.batch`; return a function that integrates, once."""
        ...


class Threads(Protocol):
    """A program whose ``batch`` also takes ``threads=``, a number of threads to share the work among.

    Attributes
    ----------
    threaded : bool
        Whether it does.
    """

    threaded: bool


class PieceSize(Protocol):
    """A program whose ``batch`` has a recommended number of trajectories for its first call.

    Attributes
    ----------
    piece : int
        That number; later pieces have more where they take little time.
    """

    piece: int


class DoubleDouble(Protocol):
    """A program whose states have twice the digits of a double, unevaluated sums of two."""

    def start_pairs(self, pairs: Array, par: Array | None = None, t0: float = 0.0) -> Any:
        """Return a stepper, with `LowParts`, at ``t0``.

        Parameters
        ----------
        pairs : ndarray, shape (dim, 2)
            The state: the nearest doubles, and the low parts.
        par, t0
            As for `Program.start`.
        """
        ...


class LowParts(Protocol):
    """A stepper whose samples are states rounded to doubles.

    Attributes
    ----------
    low : ndarray, shape (m, dim), or None
        Low parts of the samples of the last ``advance``.
    pairs : ndarray, shape (dim, 2)
        The state at the current time.
    """

    low: Array | None

    @property
    def pairs(self) -> Array: ...


class AsHBVM(Protocol):
    """A method that is identical to HBVM(k, s) for certain k and s."""

    def as_hbvm(self) -> "MethodBase":
        """Return it as `integrators.HBVM`.

        Raises
        ------
        problems.errors.InputError
            If options that HBVM does not have change its steps.
        """
        ...


CAPABILITIES: tuple[type, ...] = (
    Samplings, Destination, KeptError, Checkpoints, Interruptible, EventStepper,
    Events, Actions, Batches, BatchesAlong, BatchesEvents, PreparedBatches, Threads, PieceSize, TimeLimit,
    Variations, Gradients, DoubleDouble, LowParts, AsHBVM,
)  # fmt: skip
"""All of them."""


def offers(thing: Any, capability: type) -> bool:
    """Whether a method, a program or a stepper has everything that a capability names."""
    # Without a generator, which takes longer: `integrate` asks at each call.
    for name in members(capability):  # noqa: SIM110
        if not hasattr(thing, name):
            return False
    return True


@cache
def members(capability: type) -> tuple[str, ...]:
    """Return the names that a capability consists of."""
    named = {**inspect.get_annotations(capability), **vars(capability)}
    return tuple(name for name in named if not name.startswith("_"))


@dataclass(frozen=True, kw_only=True)
class MethodBase(CheckedOptions):
    """Base class of all methods: a frozen description that prints as the call that creates it.

    Attributes
    ----------
    library, citation, family : str
        The package that integrates, the citation that its authors ask for, and the kind of method.
    to_end : str or None
        The sampling with which the library's documentation integrates to an end time, which is timed;
        ``None`` if it is the default of `Stepper.advance`.
    built : str
        What the library's machine code is built for, in a few words.
    computes_with : tuple of str
        Packages on whose versions the numbers depend, beside the library itself.

    Raises
    ------
    problems.errors.UnknownNameError
        For an option that does not exist, with the nearest names.
    problems.errors.InputError
        For an option that is missing, not given by name, or not what its annotation says.

    Examples
    --------
    >>> from integrators import HBVM
    >>> method = HBVM(k=8, s=4, h=0.5)
    >>> method, method.order, method.library
    (HBVM(k=8, s=4, h=0.5), 8, 'hbvm-bench')
    """

    library: ClassVar[str] = "hbvm-bench"
    citation: ClassVar[str] = ""
    family: ClassVar[str] = ""
    to_end: ClassVar[str | None] = None
    built: ClassVar[str] = ""
    computes_with: ClassVar[tuple[str, ...]] = ()

    order = cast("int | None", None)  # without an annotation, with which it would be an option
    """Order of convergence, an int; ``None`` where it varies with the tolerance."""

    precision = cast("Any", "double")
    """Precision of the arithmetic; programs with another one are `DoubleDouble`."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if "compile" in vars(cls):
            setattr(cls, "compile", _of_a_system(cls.compile))  # noqa: B010 -- its type stays as written

    def accepts(self, problem: Problem) -> str | None:
        """Return ``None`` if the method can integrate ``problem`` (the default), else the reason."""
        return None

    def caveat(self, problem: Problem) -> str | None:
        """Return why `problem` is outside the method's intended use, or `None`."""
        return None

    def conserved(self, system: System) -> dict[str, float]:
        """Return the invariants that the method conserves, and by how much each may change in a step.

        Relative to its size; 0: by rounding only. A much larger change indicates a feature that all steps
        missed, and `integrators.Solution.warnings` report it.
        """
        return {}

    def compile(self, system: System) -> Program:
        """Compile for ``system``; see the module's guide."""
        raise NotImplementedError

    def options(self, *, defaults: bool = False) -> dict[str, Any]:
        """Return the options by name: those that differ from their default, or all."""
        return self._values() if defaults else self._printed()

    def __repr__(self) -> str:
        inside = ", ".join(f"{name}={value!r}" for name, value in self.options().items())
        return f"{type(self).__name__}({inside})"


def _of_a_system(compile_: Callable[[Any, System], Program]) -> Callable[[Any, System], Program]:
    """Return a method's ``compile`` that refuses what is no system."""

    @wraps(compile_)
    def checking(method: Any, system: System) -> Program:
        check_system(method, system)
        return compile_(method, system)

    return checking


def check_system(method: MethodBase, system: System) -> None:
    """Raise `problems.errors.InputError` unless ``system`` is one, which ``method`` is to be compiled for."""
    if not isinstance(system, System):
        raise InputError(
            f"{type(method).__name__}.compile takes a system, such as problem.system, not {shown(system)}."
        )


def check_problem(problem: Problem, method: MethodBase) -> None:
    """Raise `problems.errors.InputError` unless ``method`` can integrate ``problem``."""
    check_is_problem(problem)
    if not isinstance(method, MethodBase):
        raise InputError(f"method must be a method such as HBVM(k=8, s=4, h=0.1), not {shown(method)}.")
    reason = method.accepts(problem)
    if reason is not None:
        raise InputError(f"{method!r} cannot integrate {problem!s}: {reason}")
