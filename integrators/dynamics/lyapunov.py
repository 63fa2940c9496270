"""Lyapunov exponents: the mean rates at which tangent vectors grow, with intervals.

The vectors follow the steps of the trajectory and are made orthonormal again and again, ``V = Q R``; the
logarithms of the diagonal of R, added up, grow like the exponents (G. Benettin, L. Galgani, A. Giorgilli,
J.-M. Strelcyn, Meccanica 15 (1980), 9-20 and 21-30). The mean square of a few cosine transforms of the growth
is the variance of its average times the time, where the time is long (E. Lazarus, D. J. Lewis, J. H. Stock,
M. W. Watson, J. Business and Economic Statistics 36 (2018), 541-559): Student's distribution then gives an
interval.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from integrators import registry
from integrators.dynamics.vectors import with_variations
from integrators.protocol import Array, MethodBase, Samples, Status
from problems.checks import at_least, checked_arguments
from problems.errors import InputError
from problems.problem import Problem

ROUNDS = 2048  # times that the vectors are made orthonormal
# How sure an exponent is follows from the slowest fluctuations of the growth, those like cos(pi k t/T). What
# a vector has grown by at the end of a part of the time depends on its direction there: averages over 8 parts
# made the intervals of Lorenz' exponent, T = 200, 1.8 times as long as they should be, over 32 parts 4 times.
WAVES = 8
STUDENT = 2.3060  # the 97.5 % quantile of Student's distribution with WAVES degrees of freedom
PARALLEL = 1e14  # vectors that have grown so differently between two rounds cannot be told apart


@dataclass(frozen=True, eq=False)
class Exponents:
    """Lyapunov exponents of one trajectory.

    Attributes
    ----------
    exponents : ndarray, shape (count,)
        In 1/time, the largest first.
    intervals : ndarray, shape (count, 2)
        Each with 95 % confidence, from the 8 slowest cosines in the growth over the time. Where 0 cannot be
        excluded, (log T)/T is added on both sides, as which exponents that are 0 vanish in the time T.
    sum : float
        Of the exponents; with all of them, the mean divergence of the field.
    pairs : float or None
        The largest sum of two exponents that are each other's negative, for all exponents of a canonical
        system: with `Gauss` this is rounding.
    time : float
        The time T that they are averages over.
    status, reason
        How the integration ended; after a failure, the averages are those up to there.
    """

    exponents: Array
    intervals: Array
    sum: float
    pairs: float | None
    time: float
    status: Status
    reason: str


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
        Time at the start that does not count, as that to an attractor.

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
    method = registry.create("HBVM") if method is None else method
    system, end = problem.system, problem.t_end if t_end is None else t_end
    n = system.dim if count is None else count
    if n > system.dim:
        raise InputError(f"count={n} is more than the {system.dim} components of {system.name}.")
    if not problem.t0 + skip < end or skip < 0.0:
        raise InputError(f"t_end={end!r} leaves no time after t0={problem.t0!r} and skip={skip!r}.")
    stepper = with_variations(problem, method)
    frame, none = _frame(system.dim, system.dof)[:, :n], np.zeros((system.n_par, n))
    stepper.follow(frame, none)
    times, growth, samples = [], [], None
    rounds = np.linspace(problem.t0, end, ROUNDS + 1)[1:]
    for t in rounds.tolist():
        samples = stepper.advance([t], sample="steps")
        if samples.status is not Status.FINISHED:
            break
        if not samples.t.size:
            continue
        frame, triangle = np.linalg.qr(stepper.variations[-1])
        sizes = np.abs(np.diag(triangle))
        if not sizes.min() * PARALLEL > sizes.max():
            raise InputError(f"in {end - problem.t0!r} vectors grow too differently; give a shorter t_end.")
        stepper.follow(frame, none)
        times.append(stepper.t)
        growth.append(np.log(sizes))
    assert samples is not None
    if np.count_nonzero(np.array(times) >= problem.t0 + skip) <= 2 * WAVES:
        why = samples.reason or "give a later t_end or shorter steps."
        raise InputError(f"there are too few steps after skip={skip!r} for intervals: {why}")
    canonical = system.dof is not None and n == system.dim
    return _averaged(problem.t0 + skip, np.array(times), np.array(growth), canonical, samples)


def _frame(dim: int, dof: int | None) -> Array:
    """Return an orthonormal frame: of a canonical system, one whose QR keeps pairs, u_i and J u_(n+1-i)."""
    rng = np.random.default_rng(0)
    if dof is None:
        return np.linalg.qr(rng.standard_normal((dim, dim)))[0]
    unitary = np.linalg.qr(rng.standard_normal((dof, dof)) + 1j * rng.standard_normal((dof, dof)))[0]
    first = np.concatenate([np.real(unitary), np.imag(unitary)])
    second = np.concatenate([-np.imag(unitary), np.real(unitary)])
    return np.concatenate([first, second[:, ::-1]], axis=1)


def _averaged(start: float, times: Array, growth: Array, canonical: bool, samples: Samples) -> Exponents:
    """Return exponents and intervals from what the vectors have grown by, up to each of some times."""
    first = int(np.searchsorted(times, start))
    grown, ends = np.cumsum(growth, axis=0)[first:], times[first:]
    time = float(ends[-1] - ends[0])
    exponents = (grown[-1] - grown[0]) / time
    middles = (ends[1:] + ends[:-1]) / 2.0 - ends[0]
    waves = np.cos(np.pi / time * np.outer(np.arange(1, WAVES + 1), middles)) @ np.diff(grown, axis=0)
    half = STUDENT * np.sqrt(2.0 * np.mean(waves**2, axis=0)) / time
    slow = np.log(max(time, np.e)) / time
    half = np.where(np.abs(exponents) <= half + slow, half + slow, half)
    pairs = float(np.abs(exponents + exponents[::-1]).max()) if canonical else None
    order = np.argsort(-exponents)
    exponents, half = exponents[order], half[order]
    intervals = np.stack([exponents - half, exponents + half], axis=1)
    return Exponents(
        exponents, intervals, float(exponents.sum()), pairs, time, samples.status, samples.reason
    )
