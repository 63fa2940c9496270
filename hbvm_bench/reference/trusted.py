"""References by two independent computations, and how far they agree.

Up to `SMALL` unknowns: heyoka's Taylor method in 128-bit arithmetic, checked by
Gauss collocation in double-double arithmetic (`integrators.extended.collocation`); they
must agree to 1e-20. Above: the collocation, checked by the Taylor method in
long double, to 1e-15. Where less is asked for, as over a long interval: the Taylor
method in long double, checked by Gauss in doubles. A chaotic problem has a reference
as far as they agree.
"""

import platform
from dataclasses import dataclass
from decimal import Context, Decimal
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.reference import solutions
from hbvm_bench.reference.condition import conditions
from hbvm_bench.reference.solutions import ReferenceFile
from integrators import Gauss, integrate
from integrators.extended import collocation
from problems.errors import InputError
from problems.problem import Problem

Array = NDArray[np.float64]

SMALL = 60  # unknowns
GRID = 1000  # the bench's own grid: a reference's times are among its samples
# How many states are kept at most, so that the files stay small: (unknowns up to, states).
ROWS = ((20, 50), (SMALL, 20), (100, 10))
FEW_ROWS = 4  # of larger systems
FEW_DIGITS = 21  # above SMALL unknowns
LONG_DOUBLE_TOLERANCE = "1e-20"
IN_DOUBLES = Gauss(s=8, tol=1e-14)  # the check where few digits are asked for
_EXACT = Context(prec=36)


@dataclass(frozen=True)
class Opinions:
    """Two computations of one problem.

    Attributes
    ----------
    times : ndarray, shape (n,)
        Where both were looked at.
    states : list of list of Decimal
        The first, more accurate one.
    first, second : str
        What computed them.
    apart : ndarray, shape (n,)
        Largest difference of a position (or a momentum) up to each time, relative
        to the largest position (momentum) of all.
    wanted : float
        How far they may differ.
    """

    times: Array
    states: list[list[Decimal]]
    first: str
    second: str
    apart: Array
    wanted: float

    @property
    def agreed(self) -> int:
        """How many of the times come before they differ by more than what is wanted."""
        return int((self.apart <= self.wanted).sum())


def times(problem: Problem, until: float | None = None) -> Array:
    """Return some times of the bench's grid, the start and the last one up to ``until`` among them.

    Raises
    ------
    problems.errors.InputError
        If ``until`` is not within the problem's span, or nearer than its first sample.
    """
    span = problem.t_end - problem.t0
    count = GRID
    if until is not None:
        part = (until - problem.t0) / span
        if not 0 < part <= 1:
            raise InputError(f"until={until!r} must lie between {problem.t0!r} and {problem.t_end!r}.")
        count = int(part * GRID * (1 + 1e-12))
        if count == 0:
            raise InputError(f"until={until!r} comes before the first sample, {problem.t0 + span / GRID!r}.")
    # As the bench computes its own grid, so that the times are the same doubles.
    return problem.t0 + span * _places(problem, count) / GRID


def some(problem: Problem, samples: Array) -> Array:
    """Return as many of the times of a grid as a reference of the problem has; both ends among them."""
    return samples[_places(problem, len(samples) - 1)]


def _places(problem: Problem, count: int) -> NDArray[np.int64]:
    rows = next((rows for most, rows in ROWS if problem.system.dim <= most), FEW_ROWS)
    return np.append(np.arange(0, count, -(-count // rows)), count)


def ask(problem: Problem, at: Array, agreement: float | None = None) -> Opinions:
    """Compute a problem twice, at the given times; see `make` for ``agreement``."""
    long_double = (
        f"heyoka taylor_adaptive, fp_type=longdouble, tol={LONG_DOUBLE_TOLERANCE}, high_accuracy=True"
    )
    if agreement is not None:
        states = solutions.taylor(problem, at, LONG_DOUBLE_TOLERANCE, "longdouble")
        doubles = integrate(problem, IN_DOUBLES, times=at).y.tolist()
        check = [[Decimal(x) for x in row] for row in doubles]
        return Opinions(
            at, states, long_double, f"{IN_DOUBLES!r} in doubles", _apart(problem, states, check), agreement
        )
    values = collocation.integrate(problem, at)
    gauss = (
        f"Gauss collocation with {collocation.STAGES} stages, double-double arithmetic, "
        f"last Legendre coefficient {collocation.DECAY:g}"
    )
    collocated = [[_EXACT.add(Decimal(x.real), Decimal(x.imag)) for x in row] for row in values.tolist()]
    if problem.system.dim <= SMALL:
        states = solutions.taylor(problem, at, solutions.TOLERANCE)
        taylor = f"heyoka taylor_adaptive, fp_type=real128, tol={solutions.TOLERANCE}, high_accuracy=True"
        return Opinions(at, states, taylor, gauss, _apart(problem, states, collocated), 1e-20)
    other = solutions.taylor(problem, at, LONG_DOUBLE_TOLERANCE, "longdouble")
    return Opinions(at, collocated, gauss, long_double, _apart(problem, collocated, other), 1e-15)


def make(
    problem: Problem, until: float | None = None, at: Array | None = None, agreement: float | None = None
) -> ReferenceFile:
    """Return a reference that two computations agree on; seconds to minutes.

    Parameters
    ----------
    problem : Problem
        What to integrate.
    until : float, optional
        How far; by default the end of the problem's span.
    at : ndarray, optional
        The times instead of the bench's own, as those of a stored reference.
    agreement : float, optional
        How far the two may differ, relative to the largest component, at least about 1e-12; for intervals on
        which more digits take hours.

    Returns
    -------
    ReferenceFile
        It ends where the two begin to differ.

    Raises
    ------
    problems.errors.InputError
        If they do not agree anywhere.
    """
    opinions = ask(problem, times(problem, until) if at is None else at, agreement)
    kept = opinions.agreed
    if kept < 2:
        raise InputError(
            f"two computations of {problem!r} differ by {opinions.apart[1]:.1e} already at "
            f"t = {float(opinions.times[1])!r}; ask for less with until=."
        )
    horizon = "the whole interval" if opinions.times[kept - 1] == problem.t_end else "this horizon"
    states = np.array(opinions.states[:kept]).astype(float)
    all_digits = problem.system.dim <= SMALL and agreement is None
    text = str if all_digits else _few_digits
    return solutions.file_from(
        problem,
        opinions.times[:kept],
        [[text(value) for value in row] for row in opinions.states[:kept]],
        {
            "method": opinions.first,
            "check": opinions.second,
            "agreement": (
                f"{opinions.apart[kept - 1]:.1e} relative to the largest component, over {horizon} "
                f"(t <= {opinions.times[kept - 1]:g}, {opinions.wanted:g} wanted)"
            ),
            "heyoka": version("heyoka"),
            "python": platform.python_version(),
        },
        conditions(problem, opinions.times[:kept], states) if all_digits else None,
    )


def _few_digits(value: Decimal) -> str:
    return str(Context(prec=FEW_DIGITS).plus(value))


def _apart(problem: Problem, first_: list[list[Decimal]], other: list[list[Decimal]]) -> Array:
    first, second = np.array(first_), np.array(other)  # of decimals
    a, b, gap = (np.abs(states).astype(float) for states in (first, second, first - second))
    gaps = np.zeros(len(gap))
    dof = problem.system.dof or problem.system.dim
    for block in (slice(0, dof), slice(dof, None)):
        if gap[:, block].size:
            size = max(a[:, block].max(), b[:, block].max())
            gaps = np.maximum(gaps, gap[:, block].max(axis=1) / (size or 1.0))
    return np.maximum.accumulate(gaps)
