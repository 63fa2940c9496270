"""Random smooth systems, methods and noise: what runs must do with a field that is not smooth to rounding."""

import re
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from integrators import HBVM, Gauss, integrate
from integrators.protocol import MethodBase, Status
from problems import Opaque, Problem

END = 5.0

Field = Callable[[float, np.ndarray], np.ndarray]


def pendulum(t: float, y: np.ndarray) -> np.ndarray:
    """Return the field of a pendulum."""
    return np.array([y[1], -np.sin(y[0])])


def driven(t: float, y: np.ndarray) -> np.ndarray:
    """Return that of a driven and damped oscillator."""
    return np.array([y[1], np.cos(2.0 * t) - 0.3 * y[1] - y[0]])


def prey(t: float, y: np.ndarray) -> np.ndarray:
    """Return Lotka and Volterra's."""
    return np.array([y[0] * (1.0 - y[1]), y[1] * (y[0] - 1.0)])


def lorenz(t: float, y: np.ndarray) -> np.ndarray:
    """Return Lorenz's."""
    return np.array([10.0 * (y[1] - y[0]), y[0] * (28.0 - y[2]) - y[1], y[0] * y[1] - 8.0 / 3.0 * y[2]])


def decay(t: float, y: np.ndarray) -> np.ndarray:
    """Return that of a decay."""
    return -y


def chain(t: float, y: np.ndarray) -> np.ndarray:
    """Return that of four masses between springs."""
    q = np.concatenate([[0.0], y[:4], [0.0]])
    return np.concatenate([y[4:], q[2:] - 2.0 * q[1:-1] + q[:-2] - y[:4] ** 3])


SYSTEMS: dict[str, tuple[Field, Sequence[float]]] = {
    "pendulum": (pendulum, [1.0, 0.0]),
    "driven": (driven, [0.3, -0.2]),
    "prey": (prey, [1.5, 0.7]),
    "lorenz": (lorenz, [1.0, 2.0, 20.0]),
    "decay": (decay, [1.0]),
    "chain": (chain, [1.0, 0.2, -0.4, 0.0, 0.0, 0.5, 0.0, 0.1]),
}

# Without the bound on steps, which the run with the smooth field sets.
METHODS: list[Callable[..., MethodBase]] = [
    lambda **most: HBVM(**most),
    lambda **most: HBVM(tol=1e-6, **most),
    lambda **most: HBVM(tol=1e-10, **most),
    lambda **most: HBVM(tol=1e-3, **most),
    lambda **most: Gauss(s=4, tol=1e-8, **most),
    lambda **most: HBVM(k=8, s=4, tol=1e-6, solver="newton", **most),
    lambda **most: HBVM(solver="newton", **most),
    lambda **most: HBVM(k=8, s=4, h=0.02),
    lambda **most: Gauss(s=3, h=0.02),
    lambda **most: HBVM(k=4, s=2, h=0.02, solver="newton"),
]


@dataclass(frozen=True)
class Case:
    """A system, what is added to its field, and a method."""

    seed: int
    system: str
    kind: str
    size: float
    method: Callable[..., MethodBase]

    def problem(self) -> Problem:
        """Return the problem with the noisy field."""
        field, start = SYSTEMS[self.system]
        random = np.random.default_rng(self.seed)

        def drawn(t: float, y: np.ndarray) -> np.ndarray:
            return field(t, y) + self.size * random.normal(size=len(y))

        def fixed(t: float, y: np.ndarray) -> np.ndarray:  # noise that is a function of the state
            value = zlib.crc32(np.concatenate([[t], y]).tobytes()) / 2.0**32 - 0.5
            return field(t, y) + self.size * value

        def single(t: float, y: np.ndarray) -> np.ndarray:
            return field(t, y).astype(np.float32)

        def rounded(t: float, y: np.ndarray) -> np.ndarray:
            return np.round(field(t, y) / self.size) * self.size

        made = {"none": field, "drawn": drawn, "fixed": fixed, "single": single, "rounded": rounded}
        return Problem(Opaque(made[self.kind], dim=len(start)), y0=start, t_end=END)

    def smooth(self) -> Problem:
        """Return that with the smooth field."""
        return Case(self.seed, self.system, "none", 0.0, self.method).problem()


def cases(first: int, count: int) -> list[Case]:
    """Return random cases, by seeds."""
    made = []
    for seed in range(first, first + count):
        random = np.random.default_rng(seed)
        system, kind = random.choice(list(SYSTEMS)), random.choice(["drawn", "fixed", "single", "rounded"])
        size = 10.0 ** random.uniform(-12.0, -1.0)
        made.append(Case(seed, str(system), str(kind), size, METHODS[random.integers(len(METHODS))]))
    return made


def smooth_problem(seed: int) -> Problem:
    """Return a random problem without noise that looks like some: stiff, fast, far from 0, with jumps."""
    random = np.random.default_rng(seed)
    stiff, fast, far = (10.0 ** random.uniform(*powers) for powers in ((-3, 6), (-1, 3), (0, 8)))
    turned = np.linalg.qr(random.normal(size=(5, 5)))[0]
    linear = turned @ np.diag(-(10.0 ** random.uniform(-1, 4, 5))) @ turned.T
    knots = np.linspace(-3.0, 3.0, int(random.integers(5, 40)))
    levels = np.sin(2.0 * knots)
    fields: list[tuple[Field, Any]] = [
        (lambda t, y: -stiff * (y - np.cos(t)), [0.3]),
        (lambda t, y: np.array([fast * np.cos(fast * t), -y[1]]), [0.0, 1.0]),
        (lambda t, y: np.array([y[1], -np.sin(y[0] - far)]), [far + 1.0, 0.0]),
        (lambda t, y: linear @ y, random.normal(size=5)),
        (lambda t, y: np.array([y[1], np.sign(np.sin(fast * t / 20.0)) - y[0]]), [0.1, 0.0]),
        (lambda t, y: np.array([y[1], -np.sign(y[0])]), [0.3, 0.0]),
        (lambda t, y: np.array([y[1], -np.interp(y[0], knots, levels)]), [1.0, 0.1]),
        (lambda t, y: np.array([y[1], -levels[np.abs(knots - y[0]).argmin()]]), [1.0, 0.1]),
        (lambda t, y: np.array([y[1], -max(0.0, y[0])]), [1.0, 0.1]),
        (lambda t, y: np.array([y[1], 1.0 - y[1] - y[0]]), [0.0, 0.0]),
        (lambda t, y: np.array([y[1], -stiff * (y[0] - 1.0)]), [1.001, 0.0]),
        (lambda t, y: np.array([np.floor(10.0 * t) / 10.0 - y[0]]), [0.0]),
        (lambda t, y: np.zeros(2), [1.0, 2.0]),
    ]
    field, start = fields[seed % len(fields)]
    return Problem(Opaque(field, dim=len(start)), y0=start, t_end=3.0)


def wrong(case: Case) -> tuple[Any, ...] | None:
    """Return what is wrong of the run of a case, if anything is."""
    usual = integrate(case.smooth(), case.method(), [END])
    most = 3 * usual.stats.steps + 30
    made = integrate(case.problem(), case.method(max_steps=most), [END])
    method = case.method()
    known = case.seed, case.system, case.kind, f"{case.size:.1e}", repr(method), made.status.name, made.t_stop
    if made.status == Status.FINISHED:
        return None
    if made.status != Status.NONLINEAR_DIVERGENCE or "have noise" not in made.reason:
        return *known, made.stats.steps, usual.stats.steps, made.reason
    if (made.stats.evaluations or 0) > 20 * (usual.stats.evaluations or 0) + 20_000:
        return *known, "evaluations", made.stats.evaluations, usual.stats.evaluations
    had = re.search(r"or tol=(\S+) or more", made.reason)
    if had and case.method().options().get("h") is None:
        # Measured: 176 of 168.
        again = integrate(case.problem(), HBVM(tol=float(had[1]), max_steps=2 * most), [END])
        if again.status != Status.FINISHED:
            return *known, had[0], again.reason
    return None
