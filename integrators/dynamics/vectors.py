"""Tangent vectors along a trajectory, over any time: their directions, and the logarithms of their lengths.

Vectors that grow exponentially leave the range of doubles. So after each chunk of samples they are divided by
powers of 2 near their lengths, which rounds nothing; a chunk is as long as the growth seen before allows.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil, floor
from typing import Any

import numpy as np

from integrators.protocol import Array, MethodBase, Status, Variations, check_problem, offers
from integrators.running.integrate import prepared
from problems.errors import InputError
from problems.problem import Problem

LONG = 128.0  # binary logarithm of a growth in a chunk after which the next one is shorter,
SHORT = 16.0  # and longer
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

    @property
    def steps(self) -> int:
        """Steps until now."""
        return self._stepper.stats.steps

    def through(self, times: Array) -> Iterator[Chunk]:
        """Yield the vectors at times, in order, as far as the trajectory gets."""
        first, size, exponents = 0, 1, 0.0
        while first < times.size and self.status is Status.FINISHED:
            samples = self._stepper.advance(times[first : first + size])
            self.status, self.reason = samples.status, samples.reason
            vectors = self._stepper.variations
            lengths = np.linalg.norm(vectors, axis=1)
            good = (np.isfinite(lengths) & (lengths > 0.0)).all(axis=1)
            if not good.all():
                vectors, lengths = (part[: int(np.argmin(good))] for part in (vectors, lengths))
                self.status = Status.NOT_FINITE
                self.reason = (
                    f"tangent vectors leave the range of doubles after t = {self._stepper.t!r}; "
                    "take more samples."
                )
            if not len(lengths):
                return
            logarithms = np.log(lengths) + exponents * np.log(2.0)
            yield Chunk(samples.t[: len(lengths)], vectors / lengths[:, np.newaxis], logarithms)
            shift = np.rint(np.log2(lengths[-1]))
            self._stepper.scale(np.exp2(-shift))
            exponents = exponents + shift
            first += len(lengths)
            growth = float(np.abs(shift).max())
            size = max(size // 2, 1) if growth > LONG else 2 * size if growth < SHORT else size


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

    There their distance is proportional to the time since the start: as vectors grow like the time, sums over
    the samples then have the same small error for any end. With a fixed step size all are multiples of it.

    Raises
    ------
    problems.errors.InputError
        If the end is not after the start, or a step goes beyond it.
    """
    end = problem.t_end if t_end is None else t_end
    if not (np.isfinite(end) and end > problem.t0):
        raise InputError(f"t_end={end!r} must be after t0={problem.t0!r}.")
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
