"""Random smooth autonomous systems of first order that settle."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from problems import Problem, VectorField

END = 100.0


@dataclass(frozen=True)
class System:
    """A field y' = -D y - b y^3 + A g(B y) + c, as Python and as text for the tracer."""

    seed: int
    dim: int
    damping: np.ndarray
    cubes: np.ndarray
    outer: np.ndarray
    inner: np.ndarray
    shifts: np.ndarray
    constants: np.ndarray
    functions: tuple[str, ...]
    start: np.ndarray

    def field(self, y: Any, m: Any) -> list[Any]:
        """Return the derivatives, of numbers by ``numpy`` or of traced values by the tracer's functions."""
        terms = []
        for j, name in enumerate(self.functions):
            x = sum(self.inner[j, i] * y[i] for i in range(self.dim)) + self.shifts[j]
            terms.append(FUNCTIONS[name](x, m))
        return [
            sum(self.outer[i, j] * term for j, term in enumerate(terms))
            - self.damping[i] * y[i]
            - self.cubes[i] * y[i] ** 3
            + self.constants[i]
            for i in range(self.dim)
        ]

    def problem(self) -> Problem:
        """Return the traced problem."""
        system = VectorField(lambda y, m: self.field(y, m), dim=self.dim, name=f"settling {self.seed}")
        return Problem(system, y0=self.start, t_end=END)

    def numbers(self, t: float, y: np.ndarray) -> list[Any]:
        """Return the derivatives for SciPy."""
        return self.field(y, np)


FUNCTIONS: dict[str, Callable[[Any, Any], Any]] = {
    "sin": lambda x, m: m.sin(x),
    "cos": lambda x, m: m.cos(x),
    "tanh": lambda x, m: m.tanh(x),
    "exp": lambda x, m: m.exp(-(x**2)),
    "root": lambda x, m: m.sqrt(1.0 + x**2),
    "rational": lambda x, m: x / (1.0 + x**2),
    "square": lambda x, m: 0.2 * x**2,
    "nested": lambda x, m: m.cos(m.sqrt(0.6 + m.cosh(m.sin(x)))),
}


def drawn(seed: int) -> System:
    """Return a system, which need not settle."""
    rng = np.random.default_rng(seed)
    dim, count = int(rng.integers(1, 5)), int(rng.integers(1, 4))
    return System(
        seed, dim,
        damping=rng.uniform(0.05, 1.5, dim), cubes=rng.choice([0.0, 0.2, 1.0], dim),
        outer=rng.normal(0.0, 1.0, (dim, count)), inner=rng.normal(0.0, 1.0, (count, dim)),
        shifts=rng.normal(0.0, 1.0, count), constants=rng.normal(0.0, 1.0, dim) * rng.integers(0, 2, dim),
        functions=tuple(rng.choice(list(FUNCTIONS), count)), start=rng.normal(0.0, 1.5, dim),
    )  # fmt: skip


class Grows:
    """Vanishes, for SciPy, where a solution leaves all that could still settle."""

    terminal = True

    def __call__(self, t: float, y: np.ndarray) -> float:
        return 1e3 - np.abs(y).max()


def settling(first: int, count: int) -> list[System]:
    """Return so many systems that settle, by seeds from ``first`` on."""
    systems, seed = [], first
    while len(systems) < count:
        system = drawn(seed)
        rough = solve_ivp(
            system.numbers, (0.0, END), system.start, method="DOP853", rtol=1e-6, atol=1e-9,
            events=Grows(),
        )  # fmt: skip
        slope = np.abs(system.numbers(END, rough.y[:, -1])).max()
        if rough.status == 0 and slope < 1e-3 * max(1.0, np.abs(rough.y[:, -1]).max()):
            systems.append(system)
        seed += 1
    return systems
