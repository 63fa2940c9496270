"""What every integrator, ours or a peer's, satisfies.

Guide for implementers
----------------------
A **method** is a description; it holds options and nothing else.

For a method with a fixed step derive from `integrators.stepping.FixedStep`, and only the
class attributes, ``accepts`` and the function that takes the steps are left to write.

1. Derive a frozen, keyword-only dataclass from `MethodBase`. Annotate each option with
   what must hold of it (`problems.checks`, `integrators.options`): it is checked by that.
   What depends on several options, check in ``__post_init__`` after the base's, and raise
   `problems.errors.InputError`.
2. Set the class attributes ``library`` (the package that does the work), ``citation``
   (how its authors ask to be cited) and ``order`` (``None`` where the order varies with
   the tolerance).
3. ``accepts(problem)`` returns ``None`` or the reason why not, as a sentence. Leave it
   out where the method takes every system.
4. ``compile(system)`` does all compilation, imports the library (raising
   `problems.errors.MissingLibraryError`) and returns a `Program`, which knows
   the seconds that this took. Parameters are run-time values.
5. ``program.start(y0, par, t0)`` returns a `Stepper` at ``t0``.
6. A stepper's ``advance`` takes the bulk of the work in compiled code and
   returns the samples it reached; ``step`` takes one step, for looking. The class
   attribute ``to_end`` names the sampling by which the library itself goes to one
   end time, where it is another than the method's best: that one is timed.
7. A numerical failure is a `Status`, never an exception, never a silent NaN,
   never an endless loop; the samples computed before it are returned.
8. Register the class under the entry point group ``hbvm_bench.integrators``;
   `integrators.testing` then checks it against these sentences.

What follows is optional. Each capability is a class of this module, which the rest of the package asks for
by `offers`; without it the method still integrates. The conformance kit checks those that are offered.

9. `Samplings`: a stepper states in ``samplings`` which ways of sampling its ``advance`` has, the default
   first. Without it all of `SAMPLINGS` are expected.
10. `Checkpoints`: ``checkpoint`` returns all that makes the continuation bit for bit the same, and what it
    belongs to (`integrators.running.checkpoints.Identity`); ``restore`` takes it back, and nothing else.
    Files of checkpoints need it (``integrate(checkpoint=...)``).
11. `Destination`: a stepper that ends when its steps collapse is told in ``destination`` where the whole
    integration ends, since `integrate` goes there in pieces. `integrators.running.watchdog` has the rule.
12. `KeptError`: after ``USER_ERROR``, ``error`` is the exception that a function of the user raised.
13. `Events`: ``with_events`` of a program starts steppers that look for events in their steps. Such an
    `EventStepper` has the ``search``, and ``look_to``, which searches the step ahead up to the last time.
    `Actions`: with ``acts`` these events may change the state.
14. `Interruptible`: another thread sets ``stop`` of a stepper to call it back from ``advance``. Events of
    many trajectories are looked for in several threads.
15. `Batches`: ``batch`` of a program integrates many starts better than one after another, for
    `integrate_many`. `PreparedBatches`: ``prepare_batch`` does all of it that is not integrating, so that
    the bench can time the rest. `Threads`: with ``threaded`` it takes ``threads=``. `PieceSize`: ``piece`` is
    the number of trajectories that it is best given first.
16. `TimeLimit`: after ``time_limit`` seconds ``advance`` returns the samples that it has, so that `integrate`
    can ask for all of them at once and Ctrl-C loses few.
17. `Variations`: tangent vectors ``follow`` a stepper; ``variations`` are the vectors at the samples of the
    last ``advance``. `BatchesAlong`: ``batch_along`` of a program integrates many starts with tangent
    vectors, where it ``goes_along`` with so many.
18. `Gradients`: a stepper can ``record`` its solved steps, and their ``adjoint`` follows these backwards.
    With this and `Checkpoints`, `integrators.gradient` works.
19. `DoubleDouble`: ``start_pairs`` of a program begins from states with twice the digits of a double; what
    the samples of such a `LowParts` stepper leave out is its ``low``.
20. `AsHBVM`: ``as_hbvm`` of a method returns the HBVM(k, s) that it is; `integrators.order_of` and the
    plugins then know its coefficients.
"""

import inspect
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cache, wraps
from typing import Any, ClassVar, Protocol, cast, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from problems import deprecated
from problems.checks import CheckedOptions
from problems.errors import InputError, shown
from problems.problem import Problem, System

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

SAMPLINGS = ("partial", "steps", "stop", "dense")
_FORMER_SAMPLINGS = {"side": "partial", "land": "stop"}


def sampling_named(sample: Any) -> Any:
    """Return the present name of a sampling; the former ``"side"`` and ``"land"`` warn."""
    if sample is None:
        return None
    return deprecated.renamed("sampling", sample, _FORMER_SAMPLINGS, removed_in="0.2")


class Status(StrEnum):
    """How an integration stands, or how it ended.

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

    @property
    def failed(self) -> bool:
        """Whether the integration ended before its time."""
        return self not in (Status.RUNNING, Status.FINISHED, Status.EVENT)


class UserError(Exception):
    """Carries what a function of the user raised to the code that keeps the states reached before it.

    Attributes
    ----------
    error : Exception
        The user's own.
    """

    def __init__(self, error: Exception):
        said = " ".join(str(error).split())
        super().__init__(f"a function of yours raised {type(error).__name__}{f' ({said})' if said else ''}")
        self.error = error


@dataclass
class Stats:
    """Counters of the work done; ``None`` where a library has no such counter.

    Attributes
    ----------
    steps : int
        Accepted steps.
    rejections : int or None
        Steps tried and rejected.
    evaluations : int or None
        Evaluations of the vector field at one state.
    iterations : int or None
        Iterations of the nonlinear solver, over all steps.
    solver : str or None
        Which nonlinear solver did the work.
    extra : dict
        Anything else worth telling, by name; arrays for histories such as
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
        """Return the counters as they are now."""
        return Stats(**vars(self))  # in a third of the time of `dataclasses.replace`


@dataclass(frozen=True)
class Samples:
    """States reached by one call of ``advance``.

    Attributes
    ----------
    t : ndarray, shape (n,)
        The times reached: a leading part of the times asked for, or the steps of the
        method with ``sample="steps"``.
    y : ndarray, shape (n, dim)
        The states at these times, in the problem's coordinates.
    status : Status
        ``FINISHED`` when all times asked for were reached.
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
    """Trajectories of one system from many starts, as ``batch`` of a program returns them.

    Attributes
    ----------
    t : ndarray, shape (m,)
        Times.
    y : ndarray, shape (n, m, dim)
        States; NaN where a trajectory did not arrive.
    status, reason : list, length n
        How each trajectory ended, and one sentence where it failed.
    t_stop : ndarray, shape (n,)
        The last time, or that of the last step before a failure.
    steps : ndarray of int, shape (n,)
        Steps; accepted ones where lengths vary.
    extra : dict of int to dict
        By a trajectory's number, what of its `Stats.extra` warnings may follow from; see `telling`.
    variations : ndarray, shape (n, m, dim, k), or None
        Tangent vectors at the times, where they were asked for.
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
    """Return what of ``stats.extra`` warnings may follow from: kinks, and what the implicit solver did."""
    return {name: stats.extra[name] for name in ("kinks", "implicit") if name in stats.extra}


@runtime_checkable
class Stepper(Protocol):
    """A trajectory under way."""

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
        """Take one step of the method's own length."""
        ...

    def advance(self, times: Array, *, sample: str | None = None) -> Samples:
        """Integrate to ``times[-1]`` and return the states at ``times``.

        The stepper then stands at ``times[-1]`` or, where states between steps are
        made beside the steps, at the last step before it.

        Parameters
        ----------
        times : ndarray, shape (n,)
            Finite, strictly monotone in the direction of integration; the
            first may be the present time.
        sample : {"partial", "steps", "stop", "dense"}, optional
            How states between steps are made (``None``: the method's best
            that leaves its steps unchanged, or a stop where a stop
            costs it nothing). A method refuses what it cannot do.

        Returns
        -------
        Samples

        Raises
        ------
        problems.errors.InputError
            For times that are not finite or not monotone, or a sampling the
            method does not offer.
        """
        ...


@runtime_checkable
class Program(Protocol):
    """A method compiled for one system; parameters stay run-time values."""

    @property
    def compile_seconds(self) -> float: ...
    @property
    def from_cache(self) -> bool | None:
        """Whether compiled code came from a cache; ``None`` where nothing is compiled."""
        ...

    def start(self, y0: Array, par: Array | None = None, t0: float = 0.0) -> Stepper:
        """Return a stepper at ``t0``; `UserError` where a function of the user raises there."""
        ...


class Compiled:
    """Base of programs: pickled, one is the method and the system that it is compiled from again.

    Attributes
    ----------
    method : MethodBase
        Set by its `MethodBase.compile`.
    system : System
        What it was compiled for.
    """

    method: Any
    system: System

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self.method).compile, (self.method, self.system)


class Samplings(Protocol):
    """A stepper that has not all of `integrators.protocol.SAMPLINGS`, or another default.

    Attributes
    ----------
    samplings : tuple of str
        Those that its ``advance`` takes, the default first; it refuses all others.
    """

    samplings: tuple[str, ...]


class Destination(Protocol):
    """A stepper that is told where the whole integration ends, which ``advance`` reaches piece by piece.

    A stepper that notices when it no longer gets anywhere judges by this distance, not by that of a piece.
    The samples do not depend on it.

    Attributes
    ----------
    destination : float or None
        That time; ``None``: each ``advance`` is an integration of its own.
    """

    destination: float | None


class KeptError(Protocol):
    """A stepper that keeps what a function of the user raised.

    Attributes
    ----------
    error : Exception or None
        The user's own exception, where the status is ``USER_ERROR``.
    """

    error: Exception | None


class Checkpoints(Protocol):
    """A stepper that can be continued later, bit for bit: what files of checkpoints are made of."""

    def checkpoint(self) -> Any:
        """Return all that the continuation depends on (a value, not a view), which can be pickled."""
        ...

    def restore(self, checkpoint: Any) -> None:
        """Go back to a checkpoint of this program; the continuation is bit for bit the same.

        The checkpoint may be that of another stepper of the program, or of another program of the
        same method and system. It brings no parameters along: the stepper must have been started
        with the same.

        Raises
        ------
        problems.errors.InputError
            For anything else: the checkpoint of another method, of other options, of another
            system, of other parameters (`integrators.running.checkpoints.Identity`). The stepper
            stays where it is.
        """
        ...


class Interruptible(Protocol):
    """A stepper that another thread can call back.

    Attributes
    ----------
    stop : threading.Event or None
        When it is set, ``advance`` ends soon by raising `KeyboardInterrupt`; what was made is not wanted.
    """

    stop: threading.Event | None


class TimeLimit(Protocol):
    """A stepper whose ``advance`` comes back with a part of the samples when it has taken its time.

    Attributes
    ----------
    time_limit : float
        Seconds after which ``advance`` returns the samples that it has, if there are any, as
        ``FINISHED``; called with the other times it goes on as if it had not come back. Infinite at first.
    """

    time_limit: float


class EventStepper(Protocol):
    """A stepper that looks for events in its steps, as `Events.with_events` starts it.

    Attributes
    ----------
    search : integrators.events.finder.Finder
        The search at work, and what it has found.
    """

    search: Any

    def look_to(self, end: float) -> Status:
        """Look for events from the last step to a time within the step ahead."""
        ...


class Actions(Protocol):
    """A program whose events may change the state (``Event(then=...)``).

    Attributes
    ----------
    acts : bool
        Whether they may.
    """

    acts: bool


class Variations(Protocol):
    """A stepper that tangent vectors can follow.

    Attributes
    ----------
    variations : ndarray, shape (m, dim, n), or None
        The vectors at the samples of the last ``advance``.
    """

    variations: Array | None

    def follow(self, state: ArrayLike, parameters: ArrayLike) -> None:
        """Let tangent vectors follow the trajectory from here on.

        They are the derivatives of the steps that are taken, with the steps' lengths held fixed.

        Parameters
        ----------
        state : array_like, shape (dim, n)
            Their parts in the state.
        parameters : array_like, shape (n_par, n)
            Their parts in the parameters.

        Raises
        ------
        problems.errors.InputError
            For a system without a formula, and steps that are not those of a Runge-Kutta method.
        """
        ...

    def scale(self, factors: ArrayLike) -> None:
        """Multiply the vectors by numbers, from the last own step on; powers of 2 round nothing.

        Parameters
        ----------
        factors : array_like, shape (n,)
            For each of the vectors, whose parts in the parameters are 0.
        """
        ...


class Gradients(Protocol):
    """A stepper whose steps can be recorded, for their adjoint."""

    def march(self, end: float, most: int) -> Samples:
        """Take steps, ``most`` at most and none beyond the time ``end``; return them."""
        ...

    def recorder(self, capacity: int) -> Any:
        """Return room for the records of so many steps: it has a ``len``, and a size in ``bytes``.

        Raises
        ------
        problems.errors.InputError
            For a system without a formula, and steps that are not those of a Runge-Kutta method.
        """
        ...

    def record(self, records: Any) -> None:
        """Record the solved steps from here on, partial steps too."""
        ...

    def adjoint(self, *, parameters: bool) -> Any:
        """Return what follows records backwards.

        ``begin(gradient)`` sets the derivatives with respect to a last state, ``follow(records)`` goes
        back to the state before the first of some steps; ``gradient`` are the derivatives with respect to
        that state, and with ``parameters`` those with respect to these.
        """
        ...


class Events(Protocol):
    """A program whose steps can be searched for events."""

    def with_events(
        self, problem: Problem, events: Mapping[str, Any]
    ) -> Callable[[ArrayLike, ArrayLike | None, float, float], Any]:
        """Compile the functions of events; return what starts a trajectory that looks for them.

        What is returned takes the arguments of ``start``, and the time up to which is looked; it
        returns an `EventStepper`. The events change neither steps nor samples, but a terminal one
        ends the integration with the status ``EVENT``.

        Parameters
        ----------
        problem : Problem
            Whose variables the functions name.
        events : mapping of str to integrators.events.Event
            What to look for.

        Raises
        ------
        problems.errors.InputError
            For a function that the program cannot use.
        """
        ...


class Batches(Protocol):
    """A program that has a better way to integrate many starts than one after another."""

    def batch(
        self, Y0: ArrayLike, par: ArrayLike | None = None, *, times: ArrayLike, t0: float = 0.0
    ) -> Trajectories:
        """Integrate starts, shape (n, dim), with parameters (n, n_par), from ``t0`` to the same times (m,).

        What comes out for one does not depend on the others. One that fails has its status, reason and
        time, and leaves the others alone.
        """
        ...


class BatchesAlong(Protocol):
    """A program with a better way to integrate many starts with tangent vectors than one after another."""

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


class PreparedBatches(Protocol):
    """A program whose batches can be prepared, so that a clock runs for the integration alone."""

    def prepare_batch(
        self, Y0: ArrayLike, par: ArrayLike | None = None, *, times: ArrayLike, t0: float = 0.0
    ) -> Callable[[], Trajectories]:
        """Compile, check and allocate all that `Batches.batch` needs; return what then does it, once."""
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
    """A program whose ``batch`` is best given a certain number of trajectories first.

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
            The state: the nearest doubles, and what these leave out.
        par, t0
            As for `Program.start`.
        """
        ...


class LowParts(Protocol):
    """A stepper whose samples are states rounded to doubles.

    Attributes
    ----------
    low : ndarray, shape (m, dim), or None
        What the samples of the last ``advance`` leave out.
    pairs : ndarray, shape (dim, 2)
        The state at exactly the present time.
    """

    low: Array | None

    @property
    def pairs(self) -> Array: ...


class AsHBVM(Protocol):
    """A method that is HBVM(k, s) for certain k and s, of which tableau and order are known."""

    def as_hbvm(self) -> "MethodBase":
        """Return it as `integrators.HBVM`.

        Raises
        ------
        problems.errors.InputError
            Where options that HBVM does not have make other steps of it.
        """
        ...


CAPABILITIES: tuple[type, ...] = (
    Samplings, Destination, KeptError, Checkpoints, Interruptible, EventStepper,
    Events, Actions, Batches, BatchesAlong, PreparedBatches, Threads, PieceSize, TimeLimit, Variations,
    Gradients, DoubleDouble, LowParts, AsHBVM,
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
    """Base of all methods: a frozen description that prints as the call that makes it.

    Attributes
    ----------
    library, citation, family : str
        The package that does the work, how its authors ask to be cited, what kind of method it is.
    to_end : str or None
        The sampling by which the library's own documentation goes to one end time, which is what
        a clock runs for; ``None`` where that is the method's best, see `Stepper.advance`.

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

    order = cast("int | None", None)  # without an annotation, with which it would be an option
    """Order of convergence, an int; ``None`` where it varies with the tolerance."""

    precision = cast("Any", "double")
    """Of the numbers that it calculates with; programs of another one are `DoubleDouble`."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if "compile" in vars(cls):
            setattr(cls, "compile", _of_a_system(cls.compile))  # noqa: B010 -- its type stays as written

    def accepts(self, problem: Problem) -> str | None:
        """Return ``None`` if the method can integrate ``problem``, else the reason; it can, by default."""
        return None

    def caveat(self, problem: Problem) -> str | None:
        """Return why ``problem`` is outside what the method was made for although it runs, if it is."""
        return None

    def conserved(self, system: System) -> dict[str, float]:
        """Return the invariants that the method conserves, and by how much each may change in a step.

        Relative to its size; 0: by rounding only. What changes by much more has met something that no step
        saw, and `integrators.Solution.warnings` say so.
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


def check_is_problem(problem: Problem) -> None:
    """Raise `problems.errors.InputError` for what is no problem, such as a system without a start."""
    if isinstance(problem, Problem):
        return
    if isinstance(problem, System):
        raise InputError(
            f"problem must be a Problem, not {shown(problem)}, a system without a start; "
            "give problems.Problem(system, y0=..., t_end=...)."
        )
    raise InputError(
        f"problem must be a Problem, not {shown(problem)}; make one with problems.load or problems.Problem."
    )


def check_problem(problem: Problem, method: MethodBase) -> None:
    """Raise `problems.errors.InputError` unless ``method`` can integrate ``problem``."""
    check_is_problem(problem)
    if not isinstance(method, MethodBase):
        raise InputError(f"method must be a method such as HBVM(k=8, s=4, h=0.1), not {shown(method)}.")
    reason = method.accepts(problem)
    if reason is not None:
        raise InputError(f"{method!r} cannot integrate {problem!r}: {reason}")
