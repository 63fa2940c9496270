"""States between the samples of a trajectory: the method goes on from the sample before."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from integrators.protocol import Array, DoubleDouble, MethodBase, Program
from integrators.solution.segments import Segments
from problems.errors import InputError
from problems.problem import Problem

ROUNDING = 1e-14  # relative to its largest size, how far a component may be from a sample that is met
FAR, MOST_AT_ONCE = 4, 1024  # intervals between samples: not gone through for nothing, and at a time


@dataclass(frozen=True, eq=False)
class Interpolant:
    """The states at any time of a trajectory.

    Attributes
    ----------
    problem, method
        The problem that was integrated, and the method.
    t : ndarray, shape (n,)
        Times of the samples, the start among them, in the order of integration.
    rows : ndarray, shape (n, m)
        States there; behind each its low parts or its tangent vectors, where there are any.
    end : float
        The last time that can be asked for.
    segments : Segments
        What events have made of the state and the parameters.
    tangent : ndarray, shape (n_par, k), or None
        Components of the tangent vectors in the parameters, if the rows hold such vectors.
    pairs : bool
        Whether the rows hold low parts.
    """

    problem: Problem
    method: MethodBase
    t: Array
    rows: Array
    end: float
    segments: Segments
    tangent: Array | None
    pairs: bool

    @classmethod
    def from_samples(
        cls, problem: Problem, method: MethodBase, t: Array, rows: Array, end: float, segments: Segments,
        *, tangent: Array | None, pairs: bool,
    ) -> "Interpolant":  # fmt: skip
        """Return that of samples, into which the states that events have made are put."""
        if segments.t.size > 1:  # at one time the sample counts
            t, rows = np.append(t, segments.t[1:]), np.concatenate([rows, segments.y[1:]])
            _, order = np.unique(segments.sign * t, return_index=True)
            t, rows = t[order], rows[order]
        return cls(problem, method, t, rows, end, segments, tangent, pairs)

    @cached_property
    def program(self) -> Program:
        """The compiled method."""
        return self.method.compile(self.problem.system)

    @cached_property
    def _sign(self) -> float:
        return 1.0 if self.end >= self.problem.t0 else -1.0

    @cached_property
    def _ahead(self) -> Array:
        """The samples' times, in rising order."""
        return self._sign * self.t

    @cached_property
    def _owner(self) -> NDArray[np.int64]:
        """The number of the segment of each sample."""
        return self.segments.places(self.t, self.rows[:, : self.problem.system.dim])

    @cached_property
    def _close(self) -> Array:
        """How far each component may be from a sample that is met."""
        size = np.abs(self.rows[:, : self.problem.system.dim]).max(axis=0)
        return max(ROUNDING, self.method.options(defaults=True).get("tol") or 0.0) * size

    def __call__(self, times: Array) -> Array:
        """Return the rows at times of any shape, shape (..., m).

        Raises
        ------
        problems.errors.InputError
            For times outside the interval, or where the method does not go on from the sample before.
        """
        if times.size == 1:
            return self._row(float(times.reshape(-1)[0])).reshape(*times.shape, -1)
        sign, at = self._sign, self._ahead
        wanted, places = np.unique(sign * times, return_inverse=True)
        inside = (wanted >= at[0]) & (wanted <= sign * self.end)
        if not inside.all():
            raise self._outside(float(sign * wanted[int(np.argmin(inside))]))
        sample = np.searchsorted(at, wanted, side="right") - 1
        found = np.empty((wanted.size, self.rows.shape[1]))
        intervals, first, count = np.unique(sample), 0, 1
        while first < intervals.size:
            group = intervals[first : first + count]
            far = np.flatnonzero(np.diff(group) > FAR)
            group = group[: far[0] + 1] if far.size else group
            mine = np.flatnonzero((sample >= group[0]) & (sample <= group[-1]))
            ends = at[group]
            goals = np.union1d(wanted[mine], ends[1:])
            goals = goals[goals > ends[0]]
            reached = self._reached(int(group[0]), sign * goals, alone=group.size == 1)
            if reached is None:
                count = 1
                continue
            goals, reached = np.append(ends[0], goals), np.concatenate([self.rows[group[:1]], reached])
            done = self._met(group, reached[np.searchsorted(goals, ends)])
            mine = mine[sample[mine] <= group[done - 1]]
            found[mine] = reached[np.searchsorted(goals, wanted[mine])]
            first += done
            count = min(2 * count, MOST_AT_ONCE) if done == group.size else done
        own = wanted == at[sample]
        found[own] = self.rows[sample[own]]
        return found[places.reshape(times.shape)]

    def _row(self, t: float) -> Array:
        """Return the row at one time; most of what several cost is to sort them."""
        sample = int(self._ahead.searchsorted(self._sign * t, side="right")) - 1
        if sample < 0 or not self._sign * t <= self._sign * self.end:
            raise self._outside(t)
        if self.t[sample] == t:
            return self.rows[sample].copy()
        reached = self._reached(sample, np.array([t]), alone=True)
        assert reached is not None
        return reached[0]

    def _outside(self, t: float) -> InputError:
        return InputError(
            f"t={t!r} is not between t = {float(self.t[0])!r} and {self.end!r}, which the solution covers."
        )

    def _met(self, group: NDArray[np.int64], reached: Array) -> int:
        """Return how many of some samples are met in a row: from them the method goes on as it is."""
        dim = self.problem.system.dim
        met = (np.abs((reached - self.rows[group])[:, :dim]) <= self._close).all(axis=1)
        met &= self._owner[group] == self._owner[group[0]]
        return group.size if met.all() else int(np.argmin(met))

    def _reached(self, sample: int, goals: Array, *, alone: bool) -> Array | None:
        """Return the rows at times from a sample on; ``None`` if the method fails beyond its interval.

        Not where the times are in this interval ``alone``: then that raises.
        """
        if not goals.size:
            return self.rows[:0]
        row, start, dim = self.rows[sample], float(self.t[sample]), self.problem.system.dim
        par = self.segments.par[self._owner[sample]]
        if self.pairs:
            double = cast("DoubleDouble", self.program)
            stepper: Any = double.start_pairs(np.stack([row[:dim], row[dim:]], axis=1), par, start)
        else:
            stepper = self.program.start(row[:dim], par, start)
        if self.tangent is not None:
            stepper.follow(row[dim:].reshape(dim, -1), self.tangent)
        advanced = stepper.advance(goals)
        if advanced.status.failed and not alone:
            return None
        if advanced.status.failed:
            raise InputError(f"{self.method!r} does not go on from t = {start!r}: {advanced.reason}")
        if self.tangent is not None:
            return np.concatenate([advanced.y, stepper.variations.reshape(goals.size, -1)], axis=1)
        return np.concatenate([advanced.y, stepper.low], axis=1) if self.pairs else advanced.y
