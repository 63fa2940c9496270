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
8. ``checkpoint`` returns all that makes the continuation bit for bit the same, and
   what it belongs to (`integrators.running.checkpoints.Identity`); ``restore`` takes it back, and
   nothing else.
9. Register the class under the entry point group ``hbvm_bench.integrators``;
   `integrators.testing` then checks it against these sentences.
"""

import dataclasses
import inspect
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cache
from typing import Any, ClassVar, Protocol, cast, get_type_hints, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from problems import limits
from problems.calls import Called
from problems.checks import checked
from problems.errors import InputError, shown
from problems.problem import Problem, System

Array = NDArray[np.float64]

SAMPLINGS = ("side", "steps", "land", "dense")


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


@dataclass(frozen=True)
class Samples:
    """States reached by one call of ``advance``.

    Attributes
    ----------
    t : ndarray, shape (n,)
        The times reached: a leading part of the times asked for, or the
        method's own steps with ``sample="steps"``.
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
        The last time, or that of the last own step before a failure.
    steps : ndarray of int, shape (n,)
        Own steps; accepted ones where lengths vary.
    extra : dict of int to dict
        By a trajectory's number, what of its `Stats.extra` warnings may follow from; see `telling`.
    """

    t: Array
    y: Array
    status: list[Status]
    reason: list[str]
    t_stop: Array
    steps: NDArray[np.int64]
    extra: dict[int, dict[str, Any]] = field(default_factory=dict, kw_only=True)


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
        sample : {"side", "steps", "land", "dense"}, optional
            How states between steps are made (``None``: the method's best
            that leaves its own steps untouched, or landing where landing
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

    def checkpoint(self) -> Any:
        """Return all that the continuation depends on (a value, not a view)."""
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
            system, of other parameters. The stepper stays where it is.
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


class _Signature:
    """What ``help`` shows of a method: its options and their defaults; the docstring has the types."""

    def __get__(self, method: object, cls: type) -> inspect.Signature:
        options = list(inspect.signature(cls.__init__).parameters.values())[1:]
        return inspect.Signature([p.replace(annotation=inspect.Signature.empty) for p in options])


@dataclass(frozen=True, kw_only=True)
class MethodBase(Called):
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

    __signature__ = _Signature()

    order = cast("int | None", None)  # without an annotation, with which it would be an option
    """Order of convergence, an int; ``None`` where it varies with the tolerance."""

    def __post_init__(self) -> None:
        for name, annotation in _annotations(type(self)).items():
            value = checked(type(self).__name__, name, getattr(self, name), annotation)
            object.__setattr__(self, name, value)

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
        return {
            f.name: getattr(self, f.name)
            for f in dataclasses.fields(self)
            if defaults or f.default is dataclasses.MISSING or getattr(self, f.name) != f.default
        }

    def __repr__(self) -> str:
        inside = ", ".join(f"{name}={value!r}" for name, value in self.options().items())
        return f"{type(self).__name__}({inside})"


@cache
def _annotations(method: type[MethodBase]) -> dict[str, Any]:
    """Return what the options of a method must be, by name."""
    found = get_type_hints(method, include_extras=True)
    return {option.name: found[option.name] for option in dataclasses.fields(method)}


def check_problem(problem: Problem, method: MethodBase) -> None:
    """Raise `problems.errors.InputError` unless ``method`` can integrate ``problem``."""
    if not isinstance(problem, Problem):
        raise InputError(
            f"problem must be a Problem, not {shown(problem)}; "
            "make one with problems.load or problems.Problem."
        )
    if not isinstance(method, MethodBase):
        raise InputError(f"method must be a method such as HBVM(k=8, s=4, h=0.1), not {shown(method)}.")
    reason = method.accepts(problem)
    if reason is not None:
        raise InputError(f"{method!r} cannot integrate {problem!r}: {reason}")


def check_times(times: ArrayLike, t: float) -> Array:
    """Return ``times`` as a float64 array, or raise for times no stepper can serve.

    Parameters
    ----------
    times : array_like, shape (n,)
        Requested times; n >= 1, finite, strictly monotone; none behind ``t``
        in the direction of integration.
    t : float
        The stepper's present time.

    Raises
    ------
    problems.errors.InputError
        If the times are empty, not finite, not strictly monotone or behind ``t``.
    """
    grid = np.atleast_1d(as_numbers("times", times))
    if grid.ndim != 1 or grid.size == 0:
        raise InputError(f"times must be a non-empty one-dimensional array, not of shape {grid.shape}.")
    if not np.isfinite(grid).all():
        raise InputError("times must be finite numbers.")
    rest = grid if grid[0] != t else grid[1:]
    path = np.concatenate([[t], rest])
    gaps = np.diff(path)
    if not (np.all(gaps > 0) or np.all(gaps < 0)):
        raise InputError(
            f"times must be strictly monotone and ahead of the present time {t!r}; "
            f"got {float(grid[0])!r} ... {float(grid[-1])!r}."
        )
    return grid


def as_numbers(what: str, value: ArrayLike) -> Array:
    """Return an array of float64, or refuse what is not made of numbers."""
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{what} must be numbers, not {shown(value)}.") from None


def check_start(t0: Any) -> float:
    """Return the time of a start, a finite number, or refuse it."""
    time = as_numbers("t0", t0)
    if time.ndim or not np.isfinite(time):
        raise InputError(f"t0={shown(t0)} must be one finite number.")
    return float(time)


def check_parameters(par: ArrayLike | None, system: System) -> Array:
    """Return a parameter vector as a fresh array, the system's own by default, or refuse it.

    Raises
    ------
    problems.errors.InputError
        If it is not made of numbers, or not of the system's length.
    """
    own = system.pack()
    if par is None:
        return own
    values = as_numbers("par", par)
    if values.shape != own.shape:
        raise InputError(f"par must have shape {own.shape}, not {values.shape}; see system.pack.")
    return values.copy()


def check_batch(Y0: ArrayLike, par: ArrayLike | None, times: Array, system: System) -> tuple[Array, Array]:
    """Return a batch's starts (n, dim) and parameters (n, n_par) as fresh arrays, or refuse them.

    Raises
    ------
    problems.errors.InputError
        If they are of other shapes or not finite, or if n trajectories at so many times take too much memory.
    """
    rows = np.atleast_2d(as_numbers("Y0", Y0))
    if rows.ndim != 2 or rows.shape[0] == 0:
        raise InputError(f"Y0 must have shape (n, {system.dim}) with n >= 1, not {rows.shape}.")
    n = rows.shape[0]
    limits.check(f"a batch of {n} trajectories", "GIB", 8 * times.size * rows.size / 2**30)
    if rows.shape[1] != system.dim or not np.isfinite(rows).all():
        for row in rows:
            check_state(row, system.dim)
    starts = np.array(rows, order="C")
    given = None if par is None else as_numbers("par", par)
    if given is None or given.ndim == 1:
        return starts, np.tile(check_parameters(given, system), (n, 1))
    if given.shape != (n, system.n_par):
        raise InputError(
            f"par must have shape ({system.n_par},) or ({n}, {system.n_par}), not {given.shape}."
        )
    return starts, np.array(given, order="C")


def check_state(y0: ArrayLike, dim: int) -> Array:
    """Return ``y0`` as a fresh float64 array of shape (dim,), or refuse it.

    Raises
    ------
    problems.errors.InputError
        If the shape is wrong or an entry is not finite.
    """
    y = as_numbers("the initial state", y0).copy()
    if y.shape != (dim,):
        raise InputError(f"the initial state must have shape ({dim},), not {y.shape}.")
    if not np.isfinite(y).all():
        where = int(np.flatnonzero(~np.isfinite(y))[0])
        raise InputError(f"the initial state must be finite numbers; y0[{where}] is {float(y[where])!r}.")
    return y
