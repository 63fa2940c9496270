"""Lyapunov exponents: the mean rates at which tangent vectors grow, with intervals.

The vectors follow the steps of the trajectory and are made orthonormal again and again, ``V = Q R``; the
logarithms of the diagonal of R, added up, grow like the exponents (G. Benettin, L. Galgani, A. Giorgilli,
J.-M. Strelcyn, Meccanica 15 (1980), 9-20 and 21-30). All of that is compiled
(`integrators.kernel.tangent.rounds`): the next round of steps is as long as the growth in the
last one allows; where the vectors grew too differently all the same, the rounds since a checkpoint are
repeated with fewer steps each. Adaptive steps are also as short as the vectors' own errors require: a step
may be accurate for the trajectory and many times as long as a contracting vector takes to decay.
The mean square of a few cosine transforms of the growth
is the variance of its average times the time, where the time is long (E. Lazarus, D. J. Lewis, J. H. Stock,
M. W. Watson, J. Business and Economic Statistics 36 (2018), 541-559): Student's distribution then gives an
interval.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from integrators import registry
from integrators.dynamics.divergence import Divergence
from integrators.dynamics.vectors import with_variations
from integrators.protocol import Array, MethodBase, Status
from integrators.refusals import check_interval
from problems.checks import at_least, checked_arguments
from problems.errors import InputError
from problems.problem import Problem, check_is_problem

INTERVALS = 2048  # of equal length, at whose ends at least the vectors are made orthonormal
# How sure an exponent is follows from the slowest fluctuations of the growth, those like cos(pi k t/T). What
# a vector has grown by at the end of a part of the time depends on its direction there: averages over 8 parts
# made the intervals of Lorenz' exponent, T = 200, 1.8 times as long as they should be, over 32 parts 4 times.
WAVES = 8
STUDENT = 2.3060  # the 97.5 % quantile of Student's distribution with WAVES degrees of freedom
MOST_DIGITS = 12  # after the decimal point, where exponents are printed
UNCERTAIN = 1e-6  # part of the exponents by which their sum may differ from the mean divergence anyway


@dataclass(frozen=True, eq=False)
class Exponents:
    """Lyapunov exponents of one trajectory.

    Attributes
    ----------
    exponents : ndarray, shape (count,)
        In 1/time, the largest first.
    intervals : ndarray, shape (count, 2)
        Each with 95 % confidence, from the 8 slowest cosines in the growth over the time. Where 0 cannot be
        excluded, as on regular motion, they are a bound of convergence instead: exponents that are 0 vanish
        like (log T)/T in the time T. As the factor of that is not known, (log T)/T is added to the half
        length, which is itself a small multiple of it there.
    sum : float
        Of the exponents; with all of them, the mean divergence of the field.
    divergence : float
        That mean along the trajectory: exact where it is constant; else, with all exponents, its integral by
        the quadrature of the same steps, so that it is the sum to the local error of the vectors; with fewer,
        the mean over up to 2048 steps' ends, whose scatter it has.
    pairs : float or None
        The largest sum of two exponents that are each other's negative, for all exponents of a canonical
        system: with `Gauss` this is rounding.
    time : float
        The time T that they are averages over.
    rounds : int
        How many times the vectors were made orthonormal.
    steps : int
        Number of steps, repeated ones included.
    status, reason
        How the integration ended; after a failure, the averages are those up to there. ``INACCURATE``: with
        all exponents, sum and mean divergence differ by more than the intervals explain, as where fixed
        steps are too long for a contracting direction.
    """

    exponents: Array
    intervals: Array
    sum: float
    divergence: float
    pairs: float | None
    time: float
    rounds: int
    steps: int
    status: Status
    reason: str
    all: bool
    """Whether there is one for each component of the state."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What makes the exponents doubtful, as sentences."""
        return (self.reason,) if self.status is Status.INACCURATE else ()

    def __str__(self) -> str:
        """Return the exponents with their intervals, and what must hold of them, one a line."""
        bound = _slow(self.time)
        lines = [f"Lyapunov exponents in 1/time, averages over T = {self.time:.10g}; intervals of 95 %"]
        for value, (low, high) in zip(self.exponents.tolist(), self.intervals.tolist(), strict=True):
            half = (high - low) / 2.0
            digits = min(max(0, 1 - int(np.floor(np.log10(max(half, 1e-300))))), MOST_DIGITS)
            line = f"  {value:+.{digits}f} ± {half:.{digits}f}"
            if low <= 0.0 <= high:
                line += f"  0 is not excluded; zero exponents vanish like (log T)/T = {bound:.1e}"
            lines.append(line)
        line = f"sum {self.sum:.13g}, mean divergence along the trajectory {self.divergence:.13g}"
        if self.all:
            line += f": difference {abs(self.sum - self.divergence):.0e}"
        lines.append(line)
        if self.pairs is not None:
            lines.append(f"pairs of opposite sign: to {self.pairs:.0e}")
        if self.reason:
            lines.append(f"{self.status.value}: {self.reason}")
        return "\n".join(lines)


@checked_arguments
def lyapunov(
    problem: Problem,
    method: MethodBase | None = None,
    *,
    count: Annotated[int, at_least(1)] | None = None,
    t_end: float | None = None,
    skip: float = 0.0,
) -> Exponents:
    """Return the Lyapunov exponents of a trajectory.

    Parameters
    ----------
    problem : Problem
        What to integrate; traced.
    method : MethodBase, optional
        `Gauss` or `HBVM`; by default ``HBVM()``.
    count : int, optional
        How many, the largest ones; by default all.
    t_end : float, optional
        The end; by default the problem's.
    skip : float
        Initial transient that is excluded.

    Returns
    -------
    Exponents
        After Ctrl-C, with the status ``INTERRUPTED``, the averages up to there, where there are any.

    Raises
    ------
    problems.errors.InputError
        For a method without variations, for more exponents than components, and where there are too
        few steps for averages.

    Examples
    --------
    >>> import problems
    >>> from integrators import Gauss
    >>> from integrators.dynamics import lyapunov
    >>> found = lyapunov(problems.load("henon_heiles"), Gauss(s=6, h=0.5), t_end=500.0)
    >>> found.exponents.shape, found.pairs < 1e-10
    ((4,), True)
    """
    check_is_problem(problem)
    method = registry.create("HBVM") if method is None else method
    n, end = checked_span(problem, count, t_end, skip)
    return exponents_of(problem, method, n, end, skip, interruptible=True)


class NoAveragesError(InputError):
    """There is too little of a trajectory for exponents.

    Attributes
    ----------
    status : Status
        How it ended.
    steps : int
        How many there were.
    """

    def __init__(self, text: str, status: Status, steps: int):
        super().__init__(text)
        self.status, self.steps = status, steps


def checked_span(problem: Problem, count: int | None, t_end: float | None, skip: float) -> tuple[int, float]:
    """Return how many exponents of a problem are asked for, and where its integration ends.

    Raises
    ------
    problems.errors.InputError
        For more exponents than components, and a time that is too short.
    """
    system, end = problem.system, problem.t_end if t_end is None else t_end
    n = system.dim if count is None else count
    if n > system.dim:
        raise InputError(f"count={n} is more than the {system.dim} components of {system.name}.")
    if not problem.t0 + skip < end or skip < 0.0:
        raise InputError(f"t_end={end!r} leaves no time after t0={problem.t0!r} and skip={skip!r}.")
    check_interval(problem.t0, end)
    if np.count_nonzero(interval_ends(problem, end) >= problem.t0 + skip) <= 2 * WAVES:
        raise InputError(f"skip={skip!r} leaves too little of the time for intervals; give a later t_end.")
    return n, end


def exponents_of(
    problem: Problem, method: MethodBase, n: int, end: float, skip: float, *, interruptible: bool = False
) -> Exponents:
    """Return the exponents of a trajectory, of arguments that `checked_span` has checked.

    Parameters
    ----------
    interruptible : bool
        Whether Ctrl-C is to return what was computed until then.

    Raises
    ------
    problems.errors.InputError
        For a method without variations; a `NoAveragesError` where there is too little of the trajectory.
    """
    system, start = problem.system, problem.t0 + skip
    whole, known = n == system.dim, Divergence(problem)
    stepper, frame = with_variations(problem, method), canonical_frame(system.dim, system.dof)[:, :n]
    course = stepper.frames(frame, interval_ends(problem, end), divergence=whole and known.constant is None)
    broken: KeyboardInterrupt | None = None
    try:
        status, reason = course.go_on()
    except KeyboardInterrupt as raised:
        if not interruptible:
            raise
        broken, status, reason = raised, Status.INTERRUPTED, f"interrupted at t = {stepper.t!r}."
    counted, steps = np.isfinite(course.ends), stepper.stats.steps
    times, growth = course.ends[counted], course.growth[counted]
    if np.count_nonzero(times >= start) <= 2 * WAVES:
        if broken is not None:
            raise broken
        why = reason or "give a later t_end or shorter steps."
        text = f"there are too few steps after skip={skip!r} for intervals: {why}"
        raise NoAveragesError(text, status if status.failed else Status.NOT_FINITE, steps)
    canonical = whole and system.dof is not None
    exponents, intervals, pairs, time = averaged(start, times, growth, canonical)
    first = int(np.searchsorted(times, start))
    if whole and known.constant is None:
        divergence = float(course.divergence[counted][first + 1 :].sum()) / time
    else:
        divergence = known.mean(times[first:], course.states[counted][first:])
    total = float(exponents.sum())
    if whole and not status.failed:
        explained = float(np.diff(intervals).min()) / 2.0 + UNCERTAIN * float(np.abs(exponents).sum())
        if not abs(total - divergence) <= explained:
            status = Status.INACCURATE
            reason = (
                f"the sum of the exponents, {total:.6g}, is not the mean divergence, {divergence:.6g}, as it "
                "must be: the steps are too long for vectors that contract fast; take shorter steps."
            )
    return Exponents(
        exponents, intervals, total, divergence, pairs, time, course.rounds, steps, status, reason, whole
    )


def interval_ends(problem: Problem, end: float) -> Array:
    """Return the ends of the intervals."""
    return np.linspace(problem.t0, end, INTERVALS + 1)[1:]


def canonical_frame(dim: int, dof: int | None) -> Array:
    """Return an orthonormal frame: of a canonical system, one whose QR keeps pairs, u_i and J u_(n+1-i)."""
    rng = np.random.default_rng(0)
    if dof is None:
        return np.linalg.qr(rng.standard_normal((dim, dim)))[0]
    unitary = np.linalg.qr(rng.standard_normal((dof, dof)) + 1j * rng.standard_normal((dof, dof)))[0]
    first = np.concatenate([np.real(unitary), np.imag(unitary)])
    second = np.concatenate([-np.imag(unitary), np.real(unitary)])
    return np.concatenate([first, second[:, ::-1]], axis=1)


def averaged(
    start: float, times: Array, growth: Array, canonical: bool
) -> tuple[Array, Array, float | None, float]:
    """Return exponents, intervals, pairs and the time, from the growth of vectors between times."""
    first = int(np.searchsorted(times, start))
    grown, ends = np.cumsum(growth, axis=0)[first:], times[first:]
    time = float(ends[-1] - ends[0])
    exponents = (grown[-1] - grown[0]) / time
    middles = (ends[1:] + ends[:-1]) / 2.0 - ends[0]
    waves = np.cos(np.pi / time * np.outer(np.arange(1, WAVES + 1), middles)) @ np.diff(grown, axis=0)
    half = STUDENT * np.sqrt(2.0 * np.mean(waves**2, axis=0)) / time
    slow = _slow(time)
    half = np.where(np.abs(exponents) <= half + slow, half + slow, half)
    pairs = float(np.abs(exponents + exponents[::-1]).max()) if canonical else None
    order = np.argsort(-exponents)
    exponents, half = exponents[order], half[order]
    intervals = np.stack([exponents - half, exponents + half], axis=1)
    return exponents, intervals, pairs, time


def _slow(time: float) -> float:
    """Return (log T)/T, like which exponents that are 0 vanish."""
    return float(np.log(max(time, np.e)) / time)
