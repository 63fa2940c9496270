"""Indicators of chaos: MEGNO, alignment indices, finite-time exponents.

MEGNO (P. M. Cincotta, C. M. Giordano, C. Simó, Physica D 182 (2003), 151-178) and the alignment indices SALI
and GALI_k (Ch. Skokos, T. C. Bountis, Ch. Antonopoulos, Physica D 231 (2007), 30-54) tell regular from
chaotic motion in a shorter time than exponents do.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from integrators import registry
from integrators.dynamics.vectors import Course, random_vectors, sampling_times
from integrators.protocol import Array, MethodBase, Status
from problems.checks import at_least, checked_arguments
from problems.errors import InputError
from problems.problem import Problem, check_is_problem

SAMPLES = 2048  # by default

Samples = Annotated[int, at_least(2)]


@dataclass(frozen=True, eq=False)
class Indicator:
    """An indicator along one trajectory.

    Attributes
    ----------
    t : ndarray, shape (m,)
        Times.
    values : ndarray, shape (m,)
        The indicator there.
    status, reason
        How the integration ended; after a failure, the values are those up to there.
    steps : int
        How many the trajectory took.
    """

    t: Array
    values: Array
    status: Status
    reason: str
    steps: int

    @property
    def value(self) -> float:
        """The last one; NaN where there is none."""
        return float(self.values[-1]) if self.values.size else np.nan


@checked_arguments
def megno(
    problem: Problem,
    method: MethodBase | None = None,
    *,
    t_end: float | None = None,
    samples: Samples = SAMPLES,
) -> Indicator:
    r"""Return the mean exponential growth factor of nearby orbits, averaged over time.

    With the length d of a tangent vector, Y(t) = 2/t int_0^t (d'/d) s ds, and the indicator is its mean over
    the time from 0 to t. It tends to 2 for quasi-periodic orbits of nonlinear systems, to 0 for linear
    oscillators, and grows as lambda t / 2, with the largest exponent lambda, for chaotic orbits.

    Integrated by parts, Y(t) = 2 log d(t) - 2/t int log d ds. Both integrals are sums of trapezoids over all
    steps, added up as the vector follows the trajectory.

    Parameters
    ----------
    problem : Problem
        What to integrate; traced.
    method : MethodBase, optional
        `Gauss` or `HBVM`; by default ``HBVM()``.
    t_end : float, optional
        The end; by default the problem's.
    samples : int
        How many values to return, in equal distances but for a dense beginning: each at the end of a step,
        the last at ``t_end``. There are fewer where steps are long. The values do not depend on it.

    Returns
    -------
    Indicator

    Raises
    ------
    problems.errors.InputError
        For a method or a system without variations, or an end that is not after the start.

    Examples
    --------
    >>> import problems
    >>> from integrators import Gauss
    >>> from integrators.dynamics import megno
    >>> found = megno(problems.load("kepler", e=0.3), Gauss(s=6, h=0.1), t_end=2000.0)
    >>> bool(abs(found.value - 2.0) < 0.05)
    True
    """
    check_is_problem(problem)
    method = registry.create("HBVM") if method is None else method
    times = sampling_times(problem, method, t_end, samples)
    course = Course(problem, method, random_vectors(problem.system.dim, 1))
    t_, values, mean, before = [times[:0]], [times[:0]], MeanGrowth(1), problem.t0
    for chunk in course.by_steps(float(times[-1])):
        passed = np.searchsorted(times, np.concatenate([[before], chunk.t]), side="right")
        wanted = np.diff(passed) > 0
        t_.append(chunk.t[wanted])
        values.append(mean.after(chunk.t - problem.t0, chunk.logarithms.T)[0, wanted])
        before = chunk.t[-1]
    return Indicator(np.concatenate(t_), np.concatenate(values), course.status, course.reason, course.steps)


@checked_arguments
def sali(
    problem: Problem,
    method: MethodBase | None = None,
    *,
    t_end: float | None = None,
    samples: Samples = SAMPLES,
) -> Indicator:
    """Return the smaller alignment index: the shorter of u - v and u + v, for tangent vectors of length 1.

    On chaotic orbits it falls like exp(-(lambda_1 - lambda_2) t), down to rounding; on regular orbits of
    systems with two degrees of freedom or more it stays of the order of 1.

    Parameters, returns and errors are those of `megno`, but ``samples`` says how often to look at the
    vectors. With a fixed step size that is after whole steps, so there may be fewer.

    Examples
    --------
    >>> import problems
    >>> from integrators import Gauss
    >>> from integrators.dynamics import sali
    >>> bool(sali(problems.load("henon_heiles"), Gauss(s=6, h=0.25), t_end=500.0).value < 1e-8)
    True
    """
    check_is_problem(problem)
    t, directions, _, course = _followed(problem, method, 2, t_end, samples)
    u, v = directions[:, :, 0], directions[:, :, 1]
    values = np.minimum(np.linalg.norm(u - v, axis=1), np.linalg.norm(u + v, axis=1))
    return Indicator(t, values, course.status, course.reason, course.steps)


@checked_arguments
def gali(
    problem: Problem,
    method: MethodBase | None = None,
    *,
    k: Annotated[int, at_least(2)] = 2,
    t_end: float | None = None,
    samples: Samples = SAMPLES,
) -> Indicator:
    """Return the generalized alignment index of order k: the volume that k tangent vectors of length 1 span.

    It is the product of the singular values of the matrix of the vectors. On chaotic orbits it falls
    exponentially; on regular orbits on an N-dimensional torus it stays of the order of 1 for k <= N and falls
    like a power of t for larger k.

    Parameters
    ----------
    k : int
        How many vectors, 2 to the dimension of the state.

    Other parameters, returns and errors are those of `sali`.

    Examples
    --------
    >>> import problems
    >>> from integrators import Gauss
    >>> from integrators.dynamics import gali
    >>> bool(gali(problems.load("henon_heiles"), Gauss(s=6, h=0.25), k=3, t_end=500.0).value < 1e-12)
    True
    """
    check_is_problem(problem)
    t, directions, _, course = _followed(problem, method, k, t_end, samples)
    values = np.prod(np.linalg.svd(directions, compute_uv=False), axis=1)
    return Indicator(t, values, course.status, course.reason, course.steps)


@checked_arguments
def finite_time_exponent(
    problem: Problem,
    method: MethodBase | None = None,
    *,
    t_end: float | None = None,
    samples: Samples = SAMPLES,
) -> Indicator:
    """Return the largest finite-time Lyapunov exponent: log(sigma)/t, with the norm sigma of the tangent map.

    A map of it over initial conditions shows the separatrices of a flow. Unlike the exponent, it is a
    function of the initial condition and of the time, and involves no averaging.

    Parameters, returns and errors are those of `sali`.

    Examples
    --------
    >>> import problems
    >>> from integrators import Gauss
    >>> from integrators.dynamics import finite_time_exponent
    >>> saddle = problems.load("pendulum", q=3.14159265, p=0.0)
    >>> round(finite_time_exponent(saddle, Gauss(s=4, h=0.1), t_end=5.0).value, 3)
    1.0
    """
    check_is_problem(problem)
    dim = problem.system.dim
    t, directions, logarithms, course = _followed(problem, method, dim, t_end, samples)
    largest = logarithms.max(axis=1, initial=-np.inf)
    maps = directions * np.exp(logarithms - largest[:, np.newaxis])[:, np.newaxis]
    norms = np.linalg.norm(maps, 2, axis=(1, 2))
    return Indicator(
        t, (largest + np.log(norms)) / (t - problem.t0), course.status, course.reason, course.steps
    )


class MeanGrowth:
    """MEGNO of n trajectories from the lengths of their vectors at the ends of steps; see `megno`."""

    def __init__(self, n: int):
        # at the last step: the time, and of each log d, Y and both integrals
        self._time, (self._length, self._growth, self._integral, self._total) = 0.0, np.zeros((4, n, 1))

    def after(self, t: Array, lengths: Array) -> Array:
        """Return MEGNO after further steps, shape (n, m).

        Parameters
        ----------
        t : ndarray, shape (m,)
            The time since the start.
        lengths : ndarray, shape (n, m)
            Logarithms of the lengths relative to those at the start.
        """
        times = np.concatenate([[self._time], t])
        lengths = np.concatenate([self._length, lengths], axis=1)
        integrals = self._integral + _integral(times, lengths)
        growths = np.concatenate([self._growth, 2.0 * (lengths[:, 1:] - integrals / t)], axis=1)
        totals = self._total + _integral(times, growths)
        self._time, self._length, self._growth = float(t[-1]), lengths[:, -1:], growths[:, -1:]
        self._integral, self._total = integrals[:, -1:], totals[:, -1:]
        return totals / t


def _integral(t: Array, values: Array) -> Array:
    """Return the integrals up to each time but the first, by trapezoids."""
    return np.cumsum(np.diff(t) * (values[:, 1:] + values[:, :-1]) / 2.0, axis=1)


def _followed(
    problem: Problem, method: MethodBase | None, count: int, t_end: float | None, samples: int
) -> tuple[Array, Array, Array, Course]:
    """Return the times, directions and logarithms of the lengths of vectors, and how it ended."""
    method = registry.create("HBVM") if method is None else method
    dim = problem.system.dim
    if count > dim:
        raise InputError(
            f"{count} tangent vectors are more than the {dim} components of {problem.system.name}."
        )
    times = sampling_times(problem, method, t_end, samples)
    course = Course(problem, method, random_vectors(dim, count))
    chunks = list(course.through(times))
    return (
        np.concatenate([times[:0], *(chunk.t for chunk in chunks)]),
        np.concatenate([np.empty((0, dim, count)), *(chunk.directions for chunk in chunks)]),
        np.concatenate([np.empty((0, count)), *(chunk.logarithms for chunk in chunks)]),
        course,
    )
