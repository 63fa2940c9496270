"""The times at which a solution is looked at, the same for every method.

Equal distances can hit the same phase of every revolution, so that an error which
oscillates with the orbit looks constant, or is not seen at all. The spacings
``"irregular"`` and ``"log"`` cannot: one sample lies in each of equally long cells
(of the time, or of its logarithm), and where in its cell follows the fractional
parts of the multiples of the golden ratio, which no period resembles.
"""

from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from hbvm_bench.reference import solutions
from problems import limits
from problems.errors import InputError, shown
from problems.problem import Problem

GOLDEN = (5**0.5 - 1) / 2
FIRST = 1e-2  # of the interval: where samples in log time begin

Positive = Annotated[float, Meta(gt=0, le=1e300)]  # finite
Count = Annotated[int, Meta(ge=1)]
Spacing = Literal["equal", "irregular", "log"]


class Grid(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """The sampling times that every method shares.

    Attributes
    ----------
    step : float, optional
        Distance of equally spaced samples in the problem's unit of time.
    count : int, optional
        Number of intervals or cells.
    spacing : {"equal", "irregular", "log"}
        See the module's text. To an irregular and a logarithmic grid the times of the
        stored reference belong, so that the position can be compared there.
    first : float, optional
        Where a logarithmic grid begins, after the start, in the problem's unit of
        time; a hundredth of the interval by default.
    also : list of float
        Further times after the start, where they lie within the interval.
    multiple_of : float, optional
        Moves every time between the ends to the nearest multiple of this after the start, such
        as a year, which a step may divide.
    at_steps : bool
        Whether samples are moved to the nearest ends of steps of a method with a fixed one, so
        that they cost it nothing in quality, and the end is that of a run without samples,
        the one that is timed.

    Without step and count: the problem's own grid, or else 1000 intervals.
    """

    step: Positive | None = None
    count: Count | None = None
    spacing: Spacing = "equal"
    first: Positive | None = None
    also: list[Positive] = []
    multiple_of: Positive | None = None
    at_steps: bool = False

    def __post_init__(self) -> None:
        if self.step is not None and self.count is not None:
            raise InputError("a grid has a step or a count, not both.")
        if self.step is not None and self.spacing != "equal":
            raise InputError(f"a grid with spacing={self.spacing!r} has a count, not a step.")
        if self.first is not None and self.spacing != "log":
            raise InputError("first= belongs to a grid with spacing='log'.")

    def times(
        self, problem: Problem, h: float | None = None, made: solutions.References = solutions.NONE
    ) -> NDArray[np.float64]:
        """Return the sampling times from ``t0`` to ``t_end``, both included, shape (n,).

        Parameters
        ----------
        problem : Problem
            Has the interval.
        h : float, optional
            The method's fixed step, which ``at_steps`` asks for.
        made : mapping, optional
            References that do not come with the package; see `hbvm_bench.reference.solutions.find`.

        Raises
        ------
        problems.errors.InputError
            For more samples than `problems.limits` allow, ``first`` beyond the interval, or a problem that
            ends at its start.
        """
        if problem.t_end == problem.t0:
            raise InputError(f"{problem} ends at its start, t0={problem.t0!r}: give it a later t_end.")
        times, span = self._shared(problem, made), problem.t_end - problem.t0
        further = problem.t0 + np.copysign([t for t in self.also if t < abs(span)], span)
        times = np.union1d(times, further)[:: 1 if span > 0.0 else -1] if further.size else times
        unit = h if self.at_steps and h else self.multiple_of
        if not unit:
            return times
        after = np.unique(np.rint(np.abs(times - problem.t0) / unit)) * unit
        inside = after[after < abs(span) * (1 - 1e-12)]
        return np.append(problem.t0 + np.copysign(inside, span), problem.t_end)

    def _shared(self, problem: Problem, made: solutions.References) -> NDArray[np.float64]:
        """Return the times that are the same for every method."""
        span = problem.t_end - problem.t0
        count = self.count or 1000
        limits.check(f"a grid with count={shown(count)}", "SAMPLES", count)
        if self.spacing != "equal":
            return self._uneven(problem, span, count, solutions.find(problem, made))
        if self.step is None and self.count is None and problem.times is not None:
            return np.asarray(problem.times, dtype=np.float64)
        if self.step is None:
            return problem.t0 + span * np.arange(count + 1) / count
        limits.check(f"a grid with step={self.step!r}", "SAMPLES", abs(span) / self.step, "make it larger")
        whole = round(abs(span) / self.step)
        times = problem.t0 + np.copysign(self.step, span) * np.arange(whole + 1)
        inside = times[np.abs(times - problem.t0) < abs(span) * (1 - 1e-12)]
        return np.append(inside, problem.t_end)

    def _uneven(
        self, problem: Problem, span: float, count: int, known: solutions.Reference | None
    ) -> NDArray[np.float64]:
        number = np.arange(count)
        cells = (number + (GOLDEN * (number + 1)) % 1.0) / count
        if self.spacing == "log":
            first = FIRST if self.first is None else self.first / abs(span)
            if first >= 1.0:
                raise InputError(
                    f"a grid that begins at first={self.first!r} lies beyond the integration interval of "
                    f"length {span!r}."
                )
            cells = first ** (1.0 - cells)
        times = np.concatenate([[problem.t0, problem.t_end], problem.t0 + span * cells])
        if known is not None:
            inside = (known.t - problem.t0) / span
            times = np.concatenate([times, known.t[(inside > 0.0) & (inside < 1.0)]])
        ascending = np.unique(times)
        return ascending if span > 0.0 else ascending[::-1]
