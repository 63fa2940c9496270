"""Fields that are affine on both sides of a plane, and what their trajectories do where they meet it."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from problems import Problem, VectorField

END = 6.0
SAMPLES = 600  # in the interval, between which the reference brackets its crossings
CLEAR = 0.02  # speeds and distances between this and 0 are not drawn: a reference does not decide there


@cache
def system(dim):
    """Return the field of so many components, which has all numbers as parameters."""

    def f(y, par, m):
        def side(rows, i):
            return sum(rows[(dim + 1) * i + j] * y[j] for j in range(dim)) + rows[(dim + 1) * i + dim]

        g = sum(par.normal[j] * y[j] for j in range(dim)) - par.level
        return [m.where(g > 0, side(par.above, i), side(par.below, i)) for i in range(dim)]

    rows = (0.0,) * (dim * (dim + 1))
    return VectorField(
        f,
        dim=dim,
        parameters={"below": rows, "above": rows, "normal": (0.0,) * dim, "level": 0.0},
        name=f"two affine fields, {dim}",
    )


@dataclass(frozen=True)
class Drawn:
    """A field y' = A y + b with other A and b where normal @ y > level, and a start.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    below, above : ndarray, shape (dim, dim + 1)
        A and b, side by side.
    """

    kind: str
    below: np.ndarray
    above: np.ndarray
    normal: np.ndarray
    level: float
    start: np.ndarray

    @property
    def problem(self):
        """The problem, with its parameters."""
        values = {
            "below": tuple(self.below.ravel()), "above": tuple(self.above.ravel()),
            "normal": tuple(self.normal), "level": self.level,
        }  # fmt: skip
        return Problem(system(len(self.start)), y0=self.start, t_end=END, parameters=values)

    def distance(self, y):
        """Return the function that is 0 on the plane."""
        return self.normal @ y - self.level

    def speed(self, y, side):
        """Return its derivative along the field of a side."""
        field = self.above if side > 0 else self.below
        return self.normal @ (field[:, :-1] @ y + field[:, -1])

    def along(self, y, side, step, count):
        """Return the distances at so many equidistant times."""
        matrix, state, values = self.generator(side), np.append(y, 1.0), []
        power = expm(step * matrix)
        for _ in range(count):
            state = power @ state
            values.append(self.distance(state[:-1]))
        return np.array(values)

    def generator(self, side):
        """Return the matrix of y' and 1' behind the field of a side."""
        matrix = np.zeros((len(self.start) + 1, len(self.start) + 1))
        matrix[:-1] = self.above if side > 0 else self.below
        return matrix

    def after(self, y, side, t):
        """Return the solution of the field of a side."""
        return (expm(t * self.generator(side)) @ np.append(y, 1.0))[:-1]

    def solve(self):
        """Return the time and the state at the end, and whether that is where it begins to slide.

        ``None`` where the reference itself could not tell: what it does depends on very little.
        """
        t, y, step = 0.0, self.start, END / SAMPLES
        side = 1.0 if self.distance(y) > 0.0 else -1.0
        for _ in range(40):
            offsets = step * np.arange(1, int((END - t) / step) + 1)
            g = side * self.along(y, side, step, len(offsets))
            first = next((i for i, value in enumerate(g) if value < 0.0), len(g))
            if first <= 1 or (min(g[2:first], default=1.0) < CLEAR * step and self.kind != "still"):
                return None
            found = None
            if first < len(g):
                bracket = offsets[first - 1], offsets[first]
                found = brentq(lambda s, y=y, side=side: self.distance(self.after(y, side, s)), *bracket)
            if found is None:
                return END, self.after(y, side, END - t), False
            t, y = t + found, self.after(y, side, found)
            before, ahead = side * self.speed(y, side), side * self.speed(y, -side)
            if self.kind == "still":
                return END, y if not np.any(self.above) else None, False
            if abs(before) < CLEAR or abs(ahead) < CLEAR:
                return None
            if ahead > 0.0:
                return t, y, True
            side = -side
        return None


KINDS = ("jump", "kink", "tangent", "still")


def draw(rng, kind):
    """Draw a field and a start."""
    dim = int(rng.integers(1, 4)) if kind in ("jump", "still") else int(rng.integers(2, 4))
    below = rng.normal(0.0, 1.0, (dim, dim + 1))
    below[:, :dim] -= 0.3 * np.eye(dim)
    normal = np.round(rng.normal(0.0, 1.0, dim), 2) + 0.1
    level = float(np.round(rng.normal(0.0, 0.5), 2))
    start = rng.normal(0.0, 1.0, dim)
    plane = np.append(normal, -level)
    if kind == "jump":
        above = below + rng.normal(0.0, 1.0, (dim, dim + 1))
    elif kind == "kink":  # continuous there
        above = below + np.outer(rng.normal(0.0, 2.0, dim), plane)
    elif kind == "tangent":  # jumps along the plane
        along = rng.normal(0.0, 2.0, dim)
        along -= normal * (normal @ along) / (normal @ normal)
        above = below.copy()
        above[:, -1] += along
    else:  # nothing moves beyond
        above = np.zeros((dim, dim + 1))
        if normal @ start > level:
            start = start - 2.0 * (normal @ start - level) / (normal @ normal) * normal
    return Drawn(kind, below, above, normal, level, start)
