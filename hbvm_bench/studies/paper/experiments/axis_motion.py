r"""Whether Sitnikov's motion is chaotic, and where: the planetoid on the axis and beside it.

The planetoid's mass is neglected, so the primaries move on fixed ellipses and the
eccentric anomaly E can take the place of time: dt = (1 - e cos E)/n dE. On the axis

    z'' = -2 z / (r(t)^2 + z^2)^{3/2},    r = a (1 - e cos E),    a = (d/2)/(1 + e).

Beside z the linearised motion is carried along, as a unit vector u and the
logarithm of its length: along the axis (2 components) and off the axis (4), where
the primaries' pull is a quadrupole that turns with them. Half the growth rate of
the logarithm over a long time is no approximation of anything: the rate itself is
the largest Lyapunov exponent in that direction.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from integrators.methods.gauss import Gauss
from integrators.protocol import Array
from problems import Hamiltonian, VectorField

HALF_DISTANCE = 2.5  # of the primaries at apocentre: the paper's d/2
PULL = 2.0  # of both primaries: G (m1 + m2)
SCALE = 3.0  # a typical frequency: makes the components of u comparable, so that steps converge
TURN = 2 * math.pi
PER_TURN = 96  # steps in a revolution
STEP = TURN / PER_TURN
METHOD = Gauss(s=5, h=STEP)
START = (1e-9, 0.5)  # the paper's z and velocity
FAR = 100.0  # |z| of a planetoid that is not coming back soon

TURNS = (70, 1000)  # the paper's span, and a long one
ECCENTRICITIES = (*np.round(np.linspace(0.0, 0.8, 17), 3).tolist(), 0.82, 0.84, 0.86, 0.87, 0.88, 0.89, 0.9)
SECTION_SPEEDS = (0.5, *np.round(np.linspace(0.06, 1.32, 43), 3).tolist())


@dataclass(frozen=True)
class Growth:
    """Growth rates of small offsets from the paper's start, or from another speed, per unit of time."""

    e: float
    along: list[tuple[int, float]]  # revolutions, and the rate along the axis
    across: float  # rate off the axis, over the last of these spans
    left: int | None  # revolution in which |z| exceeded `FAR`, if it did; the rates end there


def period(e: float) -> float:
    """Return the primaries' period."""
    a = HALF_DISTANCE / (1 + e)
    return TURN / math.sqrt(0.25 / a**3)


def _ellipse(t: Any, par: Any, m: Any) -> tuple[Any, Any, Any, Any]:
    """Return dt/dE, squared distance from the axis, and the direction (x, y) of a primary, at E = t."""
    a = HALF_DISTANCE / (1 + par.e)
    shrink = 1 - par.e * m.cos(t)
    rate = shrink * m.sqrt(4 * a * a * a)
    return rate, (a * shrink) ** 2, a * (m.cos(t) - par.e), a * m.sqrt(1 - par.e * par.e) * m.sin(t)


def _energy(t: Any, q: Any, p: Any, par: Any, m: Any) -> Any:
    rate, r2, _, _ = _ellipse(t, par, m)
    return rate * (p[0] ** 2 / 2 - PULL / m.sqrt(r2 + q[0] ** 2))


def _with_offsets(t: Any, y: Any, par: Any, m: Any) -> list[Any]:
    rate, r2, x, x2 = _ellipse(t, par, m)
    z, v, u, w = y[0], y[1], (y[2], y[3]), (y[5], y[6], y[7], y[8])
    d2 = r2 + z * z
    pull = PULL / (d2 * m.sqrt(d2))
    stretch = rate * SCALE
    bend = rate / SCALE
    along = (stretch * u[1], bend * pull * (3 * z * z / d2 - 1) * u[0])
    tide = 3 * pull * (x * w[0] + x2 * w[1]) / d2
    across = (
        stretch * w[2],
        stretch * w[3],
        bend * (tide * x - pull * w[0]),
        bend * (tide * x2 - pull * w[1]),
    )
    return [rate * v, -rate * pull * z, *_direction(u, along), *_direction(w, across)]


def _direction(u: Any, du: Any) -> list[Any]:
    """Return the derivatives of the unit vector and of the logarithm of its length."""
    growth = sum(a * b for a, b in zip(u, du, strict=True)) / sum(a * a for a in u)
    return [b - growth * a for a, b in zip(u, du, strict=True)] + [growth]


AXIS = Hamiltonian(_energy, dof=1, parameters={"e": 0.75}, name="axis")
OFFSETS = VectorField(_with_offsets, dim=10, parameters={"e": 0.75}, name="axis_with_offsets")


def growth(e: float, speed: float = START[1], turns: Sequence[int] = TURNS) -> Growth:
    """Return how fast offsets along the axis and off it grow, from the apocentre on."""
    y0 = [START[0], speed, 0.6, 0.8, 0.0, 0.5, 0.5, 0.5, 0.5, 0.0]
    y, left = _every_turn(OFFSETS, e, y0, max(turns))
    length = period(e)
    return Growth(
        e=e,
        along=[
            (turn, float(y[turn - 1, 4] / (turn * length)))
            for turn in sorted({min(turn, len(y)) for turn in turns} - {0})
        ],
        across=float(y[-1, 9] / (len(y) * length)) if len(y) else math.nan,
        left=left,
    )


def growth_by_eccentricity(es: Sequence[float] = ECCENTRICITIES) -> list[Growth]:
    """Return `growth` for the paper's start."""
    return [growth(e) for e in es]


def section(
    e: float, speeds: Sequence[float] = SECTION_SPEEDS, turns: int = 400
) -> list[tuple[float, Array]]:
    """Return the speeds at the start, each with (z, velocity) at every apocentre of the primaries, (n, 2).

    The points end with the last one where |z| is below `FAR`.
    """
    starts = [(START[0], speed) for speed in speeds]
    return [(start[1], np.vstack([start, _every_turn(AXIS, e, start, turns)[0]])) for start in starts]


def stays(es: Sequence[float], speeds: Sequence[float], turns: int) -> Array:
    """Return after how many revolutions planetoids have gone far away, (len(es), len(speeds)); NaN: never."""
    rows = [[_every_turn(AXIS, e, (START[0], speed), turns)[1] for speed in speeds] for e in es]
    return np.array(rows, dtype=float)


def _every_turn(
    system: Hamiltonian | VectorField, e: float, y0: Sequence[float], turns: int
) -> tuple[Array, int | None]:
    """Return the states at the apocentres 1 .. turns, and where the planetoid went far away."""
    stepper = METHOD.compile(system).start(np.array(y0), system.pack({"e": e}), math.pi)
    states = np.empty((0, len(y0)))
    while len(states) < turns:
        ahead = np.arange(len(states) + 1.0, min(len(states) + 50, turns) + 1)
        samples = stepper.advance(math.pi + ahead * PER_TURN * STEP)
        states = np.vstack([states, samples.y])
        far = np.flatnonzero(~(np.abs(states[:, 0]) < FAR))
        if far.size or samples.status.failed:
            n = int(far[0]) if far.size else len(states)
            return states[:n], n + 1
    return states, None
