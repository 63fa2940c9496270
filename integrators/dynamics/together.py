"""Tangent vectors along many trajectories at once: in SIMD lanes, with a fixed step size.

All are integrated over a round of sample times and then begin again with orthonormal vectors. A round has as
many samples as the growth seen before allows.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.protocol import Array, Batches, BatchesAlong, MethodBase, Status, offers
from integrators.running.integrate import prepared
from problems.problem import Problem

AIM = np.log(1e5)  # of the ratio of the longest vector to the shortest after a round,
LIMIT = np.log(1e9)  # and above which it is taken again, shorter
RANGE = 25.0  # the logarithm of a length itself may be so many times as large: doubles end at exp(709)
ROOM = 1 << 25  # bytes of the states and vectors of a round, at most
PIECE = 128  # trajectories of each thread that are integrated together


class Together:
    """Trajectories with k vectors each, sampled at the same times.

    Parameters
    ----------
    problem : Problem
        What to integrate; traced.
    method : MethodBase
        `Gauss` or `HBVM` with a fixed step size.
    vectors : ndarray, shape (dim, k)
        At each start, orthonormal.
    threads : int
        How many.

    Attributes
    ----------
    available : bool
        Whether there are lanes for them; without them nothing else may be called.
    """

    def __init__(self, problem: Problem, method: MethodBase, vectors: Array, threads: int):
        self._problem, self._vectors, self._threads = problem, vectors, threads
        self._h: Any = method.options(defaults=True).get("h")
        self.available = False
        if self._h and problem.system.traced:
            self._program: Any = prepared(method, problem.system)[0]
            self.available = (
                offers(self._program, Batches)
                and offers(self._program, BatchesAlong)
                and self._program.goes_along(self._directions(1))
            )

    def _directions(self, n: int) -> tuple[Array, Array]:
        none = np.zeros((n, self._problem.system.n_par, self._vectors.shape[1]))
        return np.tile(self._vectors, (n, 1, 1)), none

    @property
    def piece(self) -> int:
        """Number of trajectories that are integrated together."""
        return PIECE * self._threads

    def steps_until(self, times: Array) -> Array:
        """Return the ends of the last steps that end at or before times, each once."""
        steps = np.unique(np.floor((times - self._problem.t0) / self._h * (1.0 + 1e-12)))
        return self._problem.t0 + steps[steps > 0.0] * self._h

    def follow(self, rows: Array, par: Array, times: Array) -> "Followed":
        """Return an iteration over the growth of the vectors of trajectories, up to the last of times."""
        return Followed(self, rows, par, times)


class Followed:
    """What `Together.follow` returns.

    Attributes
    ----------
    status, reason : list
        How each trajectory stands.
    steps : ndarray of int, shape (n,)
        Steps until now.
    """

    def __init__(self, together: Together, rows: Array, par: Array, times: Array):
        self._program, self._threads, self._t0 = together._program, together._threads, together._problem.t0
        self._rows, self._par, self._times = rows.copy(), par, times
        self._vectors, self._none = together._directions(len(rows))
        self.status, self.reason = [Status.FINISHED] * len(rows), [""] * len(rows)
        self.steps = np.zeros(len(rows), dtype=np.int64)

    def __iter__(self) -> Iterator[tuple[slice, Array, Array]]:
        """Yield which times there were, the states, and logarithms of the growth since the round began.

        These have the shapes (n, m, dim) and (n, m, k); NaN where a trajectory has failed.
        """
        n, dim = self._rows.shape
        count = self._vectors.shape[2]
        most = max(1, ROOM // (8 * n * dim * (1 + count)))
        first, size, t = 0, 1, self._t0
        alive = np.arange(n)
        while first < self._times.size and alive.size:
            part = slice(first, first + size)
            found = self._program.batch_along(
                self._rows[alive], self._par[alive], times=self._times[part], t0=t,
                directions=(self._vectors[alive], self._none[alive]), threads=self._threads,
            )  # fmt: skip
            frames, logs = _orthonormal(found.variations)
            extent = self._extent(logs)
            if extent > LIMIT and size > 1:
                size //= 2
                continue
            growth = np.full((n, logs.shape[1], count), np.nan)
            growth[alive] = logs
            states = np.full((n, logs.shape[1], dim), np.nan)
            states[alive] = found.y
            self._rows[alive], self._vectors[alive] = found.y[:, -1], frames
            self.steps[alive] += found.steps
            for i, status, reason in zip(alive.tolist(), found.status, found.reason, strict=True):
                self.status[i], self.reason[i] = status, reason
            lost = alive[~np.isfinite(logs[:, -1]).all(axis=1)]
            for i in lost.tolist():
                if self.status[i] is Status.FINISHED:
                    self.status[i] = Status.NOT_FINITE
                    self.reason[i] = f"tangent vectors leave the range of doubles after t = {t!r}."
            yield part, states, growth
            alive = np.array([i for i in alive.tolist() if self.status[i] is Status.FINISHED], dtype=np.int64)
            first, t = first + logs.shape[1], float(self._times[part][-1])
            size = int(min(max(size * AIM / max(extent, 1e-9), 1.0), 4 * size, most))

    @staticmethod
    def _extent(logs: Array) -> float:
        """Return how much the vectors have grown, and differently, at the end of a round."""
        last = logs[:, -1][np.isfinite(logs[:, -1]).all(axis=1)]
        if not last.size:
            return 0.0
        return max(float(np.ptp(last, axis=1).max()), float(np.abs(last).max()) / RANGE)


def _orthonormal(vectors: NDArray[np.float64]) -> tuple[Array, Array]:
    """Return orthonormal vectors of the last samples, and logarithms of how much all have grown."""
    with np.errstate(all="ignore"):  # what has left the range of doubles is found by the result
        if vectors.shape[3] == 1:
            lengths = np.linalg.norm(vectors, axis=2)
            return vectors[:, -1] / lengths[:, -1, np.newaxis], np.log(lengths)
        good = np.where(np.isfinite(vectors).all(axis=(2, 3), keepdims=True), vectors, 0.0)
        frames, triangles = np.linalg.qr(good)
        logs = np.log(np.abs(np.diagonal(triangles, axis1=2, axis2=3)))
    return frames[:, -1], np.where(np.isfinite(logs), logs, np.nan)
