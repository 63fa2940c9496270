"""What an integration returns: samples, their status, statistics."""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from problems.problem import System
from problems.systems.opaque import Opaque

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
