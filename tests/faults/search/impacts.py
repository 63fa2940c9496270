"""Billiards with exact references: a point between straight walls, and inside an ellipse."""

from dataclasses import dataclass
from math import pi

import numpy as np

from integrators import Event
from problems import Problem, VectorField

END = 12.0
MOST = 6  # walls
FREE = VectorField(
    lambda y: [y[2], y[3], 0.0 * y[0], 0.0 * y[0]],
    dim=4,
    parameters={"normals": (0.0,) * (2 * MOST)},
    name="free flight",
)


def _wall(i):
    def g(y, par):
        return par.normals[2 * i] * y[0] + par.normals[2 * i + 1] * y[1] - 1.0

    def then(y, par):
        a, b = par.normals[2 * i], par.normals[2 * i + 1]
        k = 2.0 * (a * y[2] + b * y[3]) / (a * a + b * b)
        return [y[0], y[1], y[2] - k * a, y[3] - k * b]

    return Event(g, direction=1, then=then, name=f"wall_{i}")


WALLS = [_wall(i) for i in range(MOST)]  # a wall without a normal is never met


@dataclass(frozen=True)
class Polygon:
    """A convex polygon of walls: normal @ x <= 1."""

    normals: np.ndarray

    def problem(self, y0):
        """Return the flight from a state."""
        normals = np.zeros((MOST, 2))
        normals[: len(self.normals)] = self.normals
        return Problem(FREE, y0=y0, t_end=END, parameters={"normals": tuple(normals.ravel())})

    def follow(self, y, end):
        """Return the times and walls of all impacts, and the last state."""
        t, impacts = 0.0, []
        x, v = np.array(y[:2]), np.array(y[2:])
        while True:
            speeds = self.normals @ v
            with np.errstate(divide="ignore"):
                times = np.where(speeds > 0.0, (1.0 - self.normals @ x) / speeds, np.inf)
            wall = int(np.argmin(times))
            if t + times[wall] > end:
                return impacts, np.concatenate([x + (end - t) * v, v])
            x, t = x + max(times[wall], 0.0) * v, t + max(times[wall], 0.0)
            n = self.normals[wall]
            v = v - 2.0 * (n @ v) / (n @ n) * n
            impacts.append((t, wall))


def draw_polygon(rng):
    """Draw a polygon around the origin, with corners of any angle."""
    angles = np.sort(rng.uniform(0.0, 2.0 * pi, rng.integers(3, MOST + 1)))
    gaps = np.diff(np.append(angles, angles[0] + 2.0 * pi))
    if gaps.max() > 0.95 * pi:  # it would not be bounded
        return draw_polygon(rng)
    sizes = rng.uniform(0.7, 1.3, len(angles))
    return Polygon(np.stack([np.cos(angles), np.sin(angles)], axis=1) * sizes[:, None])


def draw_start(rng, polygon, *, on_wall):
    """Draw a state at the origin, or on a wall, exactly but for rounding, from where it goes any way."""
    angle, speed, x = rng.uniform(0.0, 2.0 * pi), rng.uniform(0.5, 4.0), np.zeros(2)
    if on_wall:
        impacts, _ = polygon.follow(np.array([0.0, 0.0, np.cos(angle), np.sin(angle)]), END)
        x = impacts[0][0] * np.array([np.cos(angle), np.sin(angle)])
        angle = rng.uniform(0.0, 2.0 * pi)
    return np.array([*x, speed * np.cos(angle), speed * np.sin(angle)])
