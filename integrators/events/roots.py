"""All zeros of a function within one step: bracketed on the step's polynomial, solved on partial steps.

The polynomial sigma of a step is cheap and only of order s + 1. So it says where zeros
may be, and the states at the ends of partial steps say where they are.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from integrators.protocol import Array, UserError

FINE = 8  # places between two samples of the polynomial where zeros are looked for
NEAR = 0.1  # of the largest value in the step: an extremum below this may reach zero
SURE = 10.0  # an extremum this many times the polynomial's error away from zero does not reach it
UNRESOLVED = 1e-3  # of the largest coefficient: a tail as large says that there are too few samples
EXTREMUM = 1e-10  # of the step: where an extremum is, if the values near it can be told apart
BLUR = 1e-7  # of the step: how well a minimizer that compares values finds an extremum, with room
CORNER = 3.0  # times as much at twice the distance: where g is smooth it is 4, at a corner 2
BESIDE = 1e-6  # of the step: extrema as close to its end are looked for from both sides
EDGE, MOVES = 1e-3, 8  # part of a bracket that is its edge; how often it is moved
APART = 1e4  # units that times can be told apart by: a pole is looked at from a distance of as many
POLE, ROOM = 1e3, 10.0  # where g is as many times larger than beside it, its sign changes through infinity
BEYOND = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)  # of the step: how far beyond its end g may have a sign again


@dataclass(frozen=True)
class Zero:
    """A zero at the part ``x`` of a step, with the sign of g's change, 0 for a touch."""

    x: float
    direction: int


def nodes(degree: int) -> Array:
    """Return the places in [0, 1] where a polynomial of this degree is sampled: both ends and between."""
    x = (1.0 - np.cos(np.pi * np.arange(degree + 1) / degree)) / 2
    x[0], x[-1] = 0.0, 1.0
    return x


@lru_cache(maxsize=16)
def refinement(degree: int) -> tuple[Array, Array, Array]:
    """Return finer places, the matrix from values at `nodes` to values there, and that to the tail."""
    angles = np.pi * np.arange(degree + 1) / degree
    fine = np.pi * np.arange(FINE * degree + 1) / (FINE * degree)
    j = np.arange(degree + 1)
    # Chebyshev coefficients from values at the extrema, by the discrete cosine transform.
    half = np.ones(degree + 1)
    half[[0, -1]] = 0.5
    coefficients = 2.0 / degree * half[:, None] * np.cos(np.outer(j, angles)) * half[None, :]
    places = (1.0 - np.cos(fine)) / 2
    places[0], places[-1] = 0.0, 1.0
    return places, np.cos(np.outer(fine, j)) @ coefficients, coefficients


def refined(values: Array) -> tuple[Array, Array, Array]:
    """Return the polynomials through samples at finer places, and which of them need more samples.

    Parameters
    ----------
    values : ndarray, shape (n, degree + 1)
        Samples at `nodes`, one step per row.

    Returns
    -------
    places : ndarray, shape (m,)
        Parts of the step.
    fine : ndarray, shape (n, m)
        Values there; only the samples themselves where one of them is not finite.
    unresolved : ndarray of bool, shape (n,)
        Whether the coefficients have not decayed.
    """
    degree = values.shape[1] - 1
    places, matrix, transform = refinement(degree)
    with np.errstate(all="ignore"):
        fine = values @ matrix.T
        size = np.abs(values @ transform.T)
        unresolved = size[:, -2:].max(axis=1) > UNRESOLVED * size.max(axis=1)
    broken = ~np.isfinite(values).all(axis=1)
    fine[broken] = np.nan
    fine[:, ::FINE] = values  # own steps' ends have to be exact, to the sign
    return places, fine, unresolved & ~broken


def suspects(fine: Array) -> Array:
    """Return whether zeros are possible in each step, from `refined` values (n, m)."""
    known = np.isfinite(fine)
    low = np.where(known, fine, np.inf).min(axis=1)
    high = np.where(known, fine, -np.inf).max(axis=1)
    least = np.where(known, np.abs(fine), np.inf).min(axis=1)
    return (low <= 0.0) & (high >= 0.0) | (least < NEAR * np.maximum(np.abs(low), np.abs(high)))


class Finder:
    """Finds the zeros of g in one step.

    Parameters
    ----------
    x, p : ndarray, shape (m,)
        Parts of the step, 0 and 1 included, and values there: exact at 0 and 1, those of
        the polynomial between; NaN where there is none.
    g : callable
        The exact value at a part of the step, or a little beyond it, by a partial step; NaN where there
        is none.
    noise : callable
        The value that rounding may make at a part of the step.
    resolution : float
        The part of a step that rounding of time leaves to be told apart.
    """

    def __init__(
        self,
        x: Array,
        p: Array,
        g: Callable[[float], float],
        noise: Callable[[float], float],
        resolution: float,
    ):
        known = np.isfinite(p)
        self.x, self.p = x[known], p[known]
        self._noise = noise
        self._resolution = resolution
        self._g = g
        self._values = {float(x[i]): float(p[i]) for i in (0, -1) if np.isfinite(p[i])}

    def zeros(self) -> list[Zero]:
        """Return the zeros in (0, 1], in order."""
        if not self.p.any():  # zero all along, or known nowhere
            return []
        marks: list[tuple[float, int]] = []  # where the sign of g is known
        touches: list[Zero] = []
        for first, last in self._runs():
            self._mark_run(first, last, marks, touches)
        for i in (np.flatnonzero(self.p[1:-1] == 0.0) + 1).tolist():
            before, after = np.sign(self.p[i - 1]), np.sign(self.p[i + 1])
            if before == after != 0.0:  # a sample right at a touch
                self._mark_low(i, int(before), marks, touches)
        if self.x[0] == 0.0 and self.p[0] != 0.0:
            marks.append((0.0, int(np.sign(self.p[0]))))
        marks.sort()
        found = touches
        for (a, before), (b, after) in pairwise(marks):
            if before != after:
                found += self._solve(a, b, after)
        if self.x[-1] == 1.0 and self.p[-1] == 0.0 and marks:
            found.append(Zero(1.0, self._at_end(marks[-1][1])))
        elif marks and self.x[-1] == 1.0 and marks[-1][1] != np.sign(self.p[-1]):
            found += self._solve(marks[-1][0], 1.0, int(np.sign(self.p[-1])))
        crossings = [zero.x for zero in found if zero.direction]
        return sorted(
            (
                zero
                for zero in found
                if zero.direction
                or all(abs(zero.x - x) > BESIDE for x in crossings)  # else the crossing's own
            ),
            key=lambda zero: zero.x,
        )

    def _runs(self) -> list[tuple[int, int]]:
        """Return first and last places of the stretches of one sign; zeros are in none."""
        signs = np.sign(self.p)
        cuts = np.flatnonzero(np.diff(signs)) + 1
        edges = [0, *cuts.tolist(), signs.size]
        return [(a, b - 1) for a, b in pairwise(edges) if signs[a] != 0.0]

    def _mark_run(self, first: int, last: int, marks: list[tuple[float, int]], touches: list[Zero]) -> None:
        """Note where g has which sign in a run: at its largest values, and at extrema near zero."""
        size = np.abs(self.p)
        sign = int(np.sign(self.p[first]))
        lows = self._near_zero(first, last)
        starts = first == 0 and self.x[0] == 0.0
        ends = last == size.size - 1 and self.x[-1] == 1.0
        if (starts or ends) and not lows:  # the sign is that of the step's end
            return
        edges = [first, *lows, last]
        for i, (a, b) in enumerate(pairwise(edges)):
            x = float(self.x[a + int(np.argmax(size[a : b + 1]))])
            if 0.0 < x < 1.0:
                value = self.value(x)
                if np.sign(value) in (0, -sign):  # the polynomial errs: g may still get there nearby
                    x, value = self._extremum(self._around(a, b), sign)
                    if np.sign(value) != sign and abs(value) <= self._blur(x):
                        touches.append(Zero(x, 0))
                if np.isfinite(value) and value != 0.0:
                    marks.append((x, int(np.sign(value))))
            if i < len(lows):
                self._mark_low(lows[i], sign, marks, touches)

    def _mark_low(self, low: int, sign: int, marks: list[tuple[float, int]], touches: list[Zero]) -> None:
        """Note what g does at an extremum where the polynomial comes near zero and turns back."""
        x, p = float(self.x[low]), float(self.p[low])
        value = self.value(x)
        # Between these it may fall by as much as it rises, at a corner.
        near = self.p[max(low - 1, 0) : low + 2]
        reach = float(np.abs(near - p).max()) + SURE * abs(value - p)
        if not np.isfinite(value) or (np.sign(value) == sign and abs(value) > reach):
            return
        if np.sign(value) != -sign:
            x, value = self._extremum(self._around(low, low), -sign)
        if np.sign(value) == -sign and abs(value) > self._noise(x):
            marks.append((x, -sign))
        elif np.isfinite(value) and abs(value) <= max(self._noise(x), self._blur(x)):
            touches.append(Zero(x, 0))

    def _near_zero(self, first: int, last: int) -> list[int]:
        """Return the places inside a run where the polynomial turns back from near zero."""
        size = np.abs(self.p[first : last + 1])
        if size.size < 3:
            return []
        inner = size[1:-1]
        least = NEAR * np.abs(self.p).max()
        turns = (inner <= size[:-2]) & (inner < size[2:]) & (inner < least)
        lows = (first + 1 + np.flatnonzero(turns)).tolist()
        end = self.x.size - 1
        if first == 0 and size[0] < least and self._turns_between(1, -BESIDE, float(self.x[1])):
            lows.insert(0, 0)
        if last == end and size[-1] < least and self._turns_between(end - 1, float(self.x[-2]), 1.0 + BESIDE):
            lows.append(end)
        return lows

    def _turns_between(self, i: int, a: float, b: float) -> bool:
        """Whether the parabola through place i and its neighbours turns back from zero between two parts."""
        x, p = self.x[i - 1 : i + 2], self.p[i - 1 : i + 2]
        left, right = (p[1] - p[0]) / (x[1] - x[0]), (p[2] - p[1]) / (x[2] - x[1])
        bend = (right - left) / (x[2] - x[0])
        if bend * p[1] <= 0.0:
            return False
        slope = left + bend * (x[1] - x[0])
        return bool(a < x[1] - slope / (2.0 * bend) < b)

    def _beside(self, x: float, distance: float) -> list[float]:
        """Return the values of g at a distance from a part of the step, where it has any."""
        values = [self.value(place) for place in (x - distance, x + distance) if 0.0 <= place <= 1.0]
        return [value for value in values if np.isfinite(value)]

    def _blur(self, x: float) -> float:
        """Return by how much the value at an extremum of g may differ from that where a minimizer ended.

        At a corner the minimizer ends closer: there g is as different beside it as it is steep.
        """

        def change(distance: float) -> float:
            return max((abs(value - self.value(x)) for value in self._beside(x, distance)), default=0.0)

        near = max(BLUR, APART * self._resolution / 100.0)
        corner = change(2.0 * near) < CORNER * change(near)
        return change(max(10.0 * EXTREMUM, 10.0 * self._resolution)) if corner else change(near)

    def _around(self, a: int, b: int) -> tuple[float, float]:
        return float(self.x[max(a - 1, 0)]), float(self.x[min(b + 1, self.x.size - 1)])

    def _at_end(self, before: int) -> int:
        """Return the direction of a zero at the very end of the step: by the sign of g just beyond it."""
        for distance in BEYOND:
            x = 1.0 + max(distance, 100.0 * self._resolution)
            try:
                value, noise = self.value(x), self._noise(x)
            except UserError:  # a function that goes no farther than the integration
                break
            if abs(value) > noise:
                return 0 if np.sign(value) == before else -before
        return -before

    def value(self, x: float) -> float:
        """Return g at a part of the step."""
        if x not in self._values:
            self._values[x] = float(self._g(x))
        return self._values[x]

    def _solve(self, a: float, b: float, after: int) -> list[Zero]:
        """Return the zero between two parts of the step where g has different signs, none at a pole."""
        from scipy.optimize import brentq

        def continued(x: float) -> float:
            value = self.value(x)
            # A hole between two known signs: nothing is known there, so look to the left of it.
            return value if np.isfinite(value) else self.value(b)

        options: dict[str, Any] = {"xtol": self._resolution, "rtol": 1e-15, "maxiter": 200}
        x = float(brentq(continued, a, b, **options))  # type: ignore[arg-type]
        distance = min(max(BESIDE, APART * self._resolution), (b - a) / 2)
        sides = [abs(value) for value in self._beside(x, distance)]
        most = min(POLE, distance / (ROOM * self._resolution))  # times cannot be closer to the pole
        return [] if sides and not abs(self.value(x)) <= most * max(sides) else [Zero(x, after)]

    def _extremum(self, between: tuple[float, float], sign: int) -> tuple[float, float]:
        """Return where ``sign * g`` is largest between two parts, or the first found where it is positive.

        Where it is largest at one of the two, the polynomial has misplaced them, and they are moved.
        """
        from scipy.optimize import minimize_scalar

        def falling(x: float) -> float:
            value = sign * self.value(x)
            if value > 0.0:
                raise _Crossed(x, self.value(x))
            return -value if np.isfinite(value) else np.inf

        options = {"xatol": EXTREMUM}
        a, b = between
        x = a
        try:
            for _ in range(MOVES):
                least: Any = minimize_scalar(falling, bounds=(a, b), method="bounded", options=options)
                x, width = float(least.x), b - a
                if min(x - a, b - x) > EDGE * width:
                    break
                a, b = (a - width, a + width) if x - a < b - x else (b - width, b + width)
                a, b = max(a, 0.0), min(b, 1.0)
                if x - a <= EDGE * width or b - x <= EDGE * width:  # the end of the step
                    break
        except _Crossed as crossed:
            return crossed.x, crossed.value
        return x, self.value(x)


class _Crossed(Exception):  # noqa: N818 -- no error, an answer
    def __init__(self, x: float, value: float):
        super().__init__()
        self.x, self.value = x, value
