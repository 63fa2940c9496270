"""Tangent vectors along a trajectory, over any time: their directions, and the logarithms of their lengths.

Vectors that grow exponentially leave the range of doubles. So after each chunk of samples or steps they are
divided by powers of 2 near their lengths, which rounds nothing; a chunk is as long as the growth seen before
allows.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil, floor
from typing import Any

import numpy as np

from integrators.protocol import Array, MethodBase, Samples, Status, Variations, check_problem, offers
from integrators.refusals import check_interval
from integrators.running.integrate import prepared
from problems.errors import InputError
from problems.problem import Problem

LONG = 128.0  # binary logarithm of a growth in a chunk after which the next one is shorter,
SHORT = 16.0  # and longer
ROOM = 1 << 21  # bytes of the vectors of a chunk of steps, at most
FINENESS = 16  # at the beginning, times between samples are this part of the time since the start,
FIRST = 1e-3  # and the first sample comes after this part of the distance that they have later


@dataclass(frozen=True, eq=False)
class Chunk:
    """Some samples.

    Attributes
    ----------
    t : ndarray, shape (m,)
        Their times.
    directions : ndarray, shape (m, dim, n)
        The vectors there, of length 1.
    logarithms : ndarray, shape (m, n)
        Of the lengths, relative to those at the start.
    """

    t: Array
    directions: Array
    logarithms: Array


class Course:
    """A trajectory with vectors, sampled at given times.

    Parameters
    ----------
    problem : Problem
        What to integrate; traced.
    method : MethodBase
        One with variations: `Gauss` or `HBVM`.
    vectors : ndarray, shape (dim, n)
        At the start, of length 1.

    Attributes
    ----------
    status, reason
        How it stands.

    Raises
    ------
    problems.errors.InputError
        For a method or a system without variations.
    """

    def __init__(self, problem: Problem, method: MethodBase, vectors: Array):
        self._stepper = with_variations(problem, method)
        self._stepper.follow(vectors, np.zeros((problem.system.n_par, vectors.shape[1])))
        self.status, self.reason = Status.FINISHED, ""
        self._bytes, self._exponents, self._growth = vectors.nbytes, np.zeros(vectors.shape[1]), 0.0

    @property
    def steps(self) -> int:
        """Steps until now."""
        return self._stepper.stats.steps

    def through(self, times: Array) -> Iterator[Chunk]:
        """Yield the vectors at times, in order, as far as the trajectory gets."""
        first, size = 0, 1
        while first < times.size and self.status is Status.FINISHED:
            chunk = self._chunk(self._stepper.advance(times[first : first + size]))
            if chunk is None:
                return
            yield chunk
            first += chunk.t.size
            size = self._next_size(size)

    def by_steps(self, end: float) -> Iterator[Chunk]:
        """Yield the vectors at the end of each step up to a time, and at that time."""
        size, most = 1, max(1, ROOM // self._bytes)
        while self.status is Status.FINISHED:
            chunk = self._chunk(self._stepper.march(end, size))
            if chunk is not None:
                yield chunk
            if chunk is None or chunk.t.size < size:
                break
            size = min(self._next_size(size), most)
        if self.status is Status.FINISHED and self._stepper.t != end:
            chunk = self._chunk(self._stepper.advance([end]))
            if chunk is not None:
                yield chunk

    def _chunk(self, samples: Samples) -> Chunk | None:
        """Return the vectors of samples, ``None`` if there are none, and scale those that go on."""
        self.status, self.reason = samples.status, samples.reason
        vectors = self._stepper.variations
        lengths = np.linalg.norm(vectors, axis=1)
        good = (np.isfinite(lengths) & (lengths > 0.0)).all(axis=1)
        if not good.all():
            vectors, lengths = (part[: int(np.argmin(good))] for part in (vectors, lengths))
            self.status = Status.NOT_FINITE
            self.reason = (
                f"tangent vectors leave the range of doubles after t = {self._stepper.t!r}; "
                "take more samples or shorter steps."
            )
        if not len(lengths):
            return None
        logarithms = np.log(lengths) + self._exponents * np.log(2.0)
        chunk = Chunk(samples.t[: len(lengths)], vectors / lengths[:, np.newaxis], logarithms)
        shift = np.rint(np.log2(lengths[-1]))
        self._stepper.scale(np.exp2(-shift))
        self._exponents = self._exponents + shift
        self._growth = float(np.abs(shift).max())
        return chunk

    def _next_size(self, size: int) -> int:
        """Return how many samples the next chunk has, after one of so many."""
        return max(size // 2, 1) if self._growth > LONG else 2 * size if self._growth < SHORT else size


def with_variations(problem: Problem, method: MethodBase) -> Any:
    """Return a stepper at the start, which vectors can follow.

    Raises
    ------
    problems.errors.InputError
        If the method does not accept the problem, or has no variations.
    """
    check_problem(problem, method)
    program, _ = prepared(method, problem.system)
    stepper: Any = program.start(problem.y0, problem.par, problem.t0)
    if not offers(stepper, Variations):
        raise InputError(f"{method!r} has no variations; use Gauss or HBVM.")
    return stepper


def sampling_times(problem: Problem, method: MethodBase, t_end: float | None, samples: int) -> Array:
    """Return equidistant times to the end, about so many, and denser ones at the beginning.

    There their distance is proportional to the time since the start, as vectors grow like the time on regular
    orbits. With a fixed step size all are multiples of it.

    Raises
    ------
    problems.errors.InputError
        If the end is not after the start, or a step goes beyond it, or doubles are too coarse for the
        interval.
    """
    end = problem.t_end if t_end is None else t_end
    if not (np.isfinite(end) and end > problem.t0):
        raise InputError(f"t_end={end!r} must be after t0={problem.t0!r}.")
    check_interval(problem.t0, end)
    span = end - problem.t0
    regular = np.arange(1, samples + 1) / samples
    count = ceil(np.log(FINENESS / FIRST) * FINENESS)
    first = np.geomspace(FIRST / samples, min(FINENESS / samples, 1.0), count)
    parts = np.union1d(first, regular[regular > first[-1]])
    h = method.options(defaults=True).get("h")
    if not h:
        return problem.t0 + span * parts
    last = floor(span / h * (1.0 + 1e-12))
    if last < 1:
        raise InputError(f"t_end={end!r} leaves no room for a step of h={h!r}.")
    return problem.t0 + h * np.unique(np.clip(np.rint(parts * last), 1, last))


def random_vectors(dim: int, count: int) -> Array:
    """Return orthonormal vectors in directions that nothing of a problem prefers; always the same."""
    return np.linalg.qr(np.random.default_rng(0).standard_normal((dim, dim)))[0][:, :count]
