"""Exact solutions and independent references, as functions from times to states."""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import integrators

from .shape import Array, Reference, Trajectory

AGREE = 1e-8  # of the size of a component: two runs of a reference that differ by more are none

NODES, WEIGHTS = np.polynomial.legendre.leggauss(20)


class NoReferenceError(Exception):
    """Two runs of a reference do not agree: a fault of the search, not of what it looks at."""


def exact(solution: Callable[[Array, Trajectory], Sequence[Array]]) -> Callable[[Trajectory], Reference]:
    """Return the reference of a closed form: components as a function of times and the trajectory."""

    def made(trajectory: Trajectory) -> Reference:
        def states(times: Array) -> Array:
            values = np.broadcast_arrays(times, *solution(times, trajectory))
            return np.column_stack([np.asarray(value, dtype=float) for value in values[1:]])

        return states

    return made


def primitive(
    f: Callable[[Array], Array], t0: float, times: Array, places: Sequence[float] = (), width: float = 0.0
) -> Array:
    """Return the integrals of f from t0 to each of the times (>= t0), by Gauss's rule on panels.

    Panels end at each of ``places``, and are short near them: half a ``width``, up to 40 widths away.
    """
    last = float(np.max(times, initial=t0))
    if last == t0:
        return np.zeros(np.shape(times))
    near = [place + width * np.arange(-40.0, 40.5, 0.5) for place in places] if width else []
    edges = np.unique(np.concatenate([np.linspace(t0, last, 201), times, places, *near]))
    edges = edges[(edges >= t0) & (edges <= last)]
    half = np.diff(edges) / 2.0
    nodes = edges[:-1, None] + half[:, None] * (1.0 + NODES)
    sums = np.append(0.0, np.cumsum((f(nodes) * WEIGHTS).sum(axis=1) * half))
    return sums[np.searchsorted(edges, times)]


def forced_oscillator(
    times: Array, t0: float, y0: Array, w: float, force: Callable[[Array], Array],
    places: Sequence[float] = (), width: float = 0.0,
) -> tuple[Array, Array]:  # fmt: skip
    """Return position and velocity of x'' = -w^2 x + force(t)."""
    s = times - t0
    cosine = primitive(lambda t: np.cos(w * (t - t0)) * force(t), t0, times, places, width)
    sine = primitive(lambda t: np.sin(w * (t - t0)) * force(t), t0, times, places, width)
    a, b = y0[0] - sine / w, y0[1] / w + cosine / w
    return a * np.cos(w * s) + b * np.sin(w * s), w * (b * np.cos(w * s) - a * np.sin(w * s))


def piecewise_oscillator(
    times: Array,
    t0: float,
    y0: Array,
    borders: Sequence[float],
    rates: Sequence[float],
    pulls: Sequence[float],
) -> tuple[Array, Array]:
    """Return position and velocity of x'' = -rates[i] x + pulls[i], region i between borders i - 1 and i."""
    order = np.argsort(times)
    x, v = float(y0[0]), float(y0[1])
    region = int(np.searchsorted(borders, x))
    now, found = t0, np.empty((2, times.size))
    i = 0
    while i < times.size:
        w, centre = math.sqrt(rates[region]), pulls[region] / rates[region]
        radius, angle = math.hypot(x - centre, v / w), math.atan2(-v / w, x - centre)
        wait, step = math.inf, 0
        for border, sign in ((region, 1), (region - 1, -1)):
            if 0 <= border < len(borders) and abs(borders[border] - centre) < radius:
                at = -sign * math.acos((borders[border] - centre) / radius)
                after = ((at - angle) % (2.0 * math.pi)) / w
                if after < wait:
                    wait, step = after, sign
        while i < times.size and times[order[i]] <= now + wait:
            phase = angle + w * (times[order[i]] - now)
            found[:, order[i]] = centre + radius * math.cos(phase), -radius * w * math.sin(phase)
            i += 1
        if i < times.size:
            phase = angle + w * wait
            x = borders[region if step > 0 else region - 1]
            v = -radius * w * math.sin(phase)
            now, region = now + wait, region + step
    return found[0], found[1]


def dry_friction(times: Array, t0: float, y0: Array, mu: float) -> tuple[Array, Array, float]:
    """Return position and velocity of x'' = -x - mu sign(x'), and when it comes to rest; infinite: never.

    Up to the last of the times. Between two turns it is a cosine about -mu or mu.
    """
    order = np.argsort(times)
    x, v, now, rest = float(y0[0]), float(y0[1]), t0, math.inf
    found = np.empty((2, times.size))
    i = 0
    while i < times.size:
        if v == 0.0 and abs(x) <= mu:
            found[:, order[i:]] = [[x], [0.0]]
            rest = now
            break
        centre = -math.copysign(mu, v if v != 0.0 else -x)
        radius, angle = math.hypot(x - centre, v), math.atan2(-v, x - centre)
        wait = math.pi if v == 0.0 else -angle % math.pi
        while i < times.size and times[order[i]] <= now + wait:
            phase = angle + times[order[i]] - now
            found[:, order[i]] = centre + radius * math.cos(phase), -radius * math.sin(phase)
            i += 1
        x, v, now = centre + math.copysign(radius, -centre), 0.0, now + wait
    return found[0], found[1], rest


def heyoka(trajectory: Trajectory) -> Reference:
    """Return heyoka's Taylor integrator as the reference, where two tolerances agree."""

    def run(tol: float, times: Array) -> Array:
        ahead = np.unique(times)
        if trajectory.t_end < trajectory.t0:
            ahead = ahead[::-1]
        solution = integrators.integrate(trajectory.problem, integrators.Taylor(tol=tol), ahead)
        if solution.status.failed:
            raise NoReferenceError(solution.reason)
        place = {t: i for i, t in enumerate(solution.t)}
        return solution.y[[place[t] for t in times]]

    return _agreed(trajectory, lambda times: run(1e-16, times), lambda times: run(1e-13, times))


def dop853(
    field: Callable[..., Any], breaks: Callable[[Trajectory], Sequence[float]] = lambda _: ()
) -> Callable[[Trajectory], Reference]:
    """Return SciPy's DOP853 as the reference, told where in time the field is not smooth."""

    def made(trajectory: Trajectory) -> Reference:
        def run(tol: float, part: int) -> Reference:
            return _pieces(field, trajectory, sorted(breaks(trajectory)), tol, part)

        return _agreed(trajectory, run(1e-13, 400), run(1e-12, 250))

    return made


def _pieces(
    field: Callable[..., Any], trajectory: Trajectory, breaks: Sequence[float], tol: float, part: int
) -> Reference:
    t0, t_end = trajectory.t0, trajectory.t_end
    edges = [t0, *(t for t in breaks if t0 < t < t_end), t_end]
    y, found = trajectory.y0, []
    for start, end in pairwise(edges):
        solved = solve_ivp(
            lambda t, y: field(t, y, trajectory.par, NUMBERS), (start, end), y, method="DOP853",
            rtol=tol, atol=tol * 1e-6, dense_output=True, max_step=(t_end - t0) / part,
        )  # fmt: skip
        if not solved.success:
            raise NoReferenceError(solved.message)
        found.append(solved.sol)
        y = solved.y[:, -1]

    def states(times: Array) -> Array:
        piece = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, len(found) - 1)
        return np.array([found[i](t) for i, t in zip(piece, times, strict=True)])

    return states


def _agreed(trajectory: Trajectory, one: Reference, other: Reference) -> Reference:
    grid = np.linspace(trajectory.t0, trajectory.t_end, 11)
    first, second = one(grid), other(grid)
    sizes = np.abs(first).max(axis=0)
    if not (np.abs(first - second) <= AGREE * sizes).all():
        raise NoReferenceError(f"two references differ by {np.abs(first - second).max()}")
    return one


def _table(x: float, xs: Sequence[float], ys: Sequence[float]) -> float:
    return float(CubicSpline(xs, ys)(x))


NUMBERS = SimpleNamespace(
    sqrt=math.sqrt, sin=math.sin, cos=math.cos, exp=math.exp, log=math.log, tanh=math.tanh, abs=abs,
    cosh=math.cosh, where=lambda chosen, a, b: a if chosen else b, table=_table,
)  # fmt: skip
"""What a formula calls its ``m``, on numbers."""
