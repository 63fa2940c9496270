"""Sitnikov's problem as the paper ran it, and what its figures do not show."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import problems
from integrators import Solution, integrate, registry
from integrators.methods.gauss import Gauss
from integrators.methods.hbvm import HBVM
from integrators.protocol import Array, MethodBase
from problems import Problem

from .departure import departure, first

E, D = 0.75, 5.0
H, T_END = 0.5, 1500.0
NODES, DEGREE = 18, 2
PERIOD = 2 * np.pi * (D / (1 + E)) ** 1.5 / np.sqrt(2.0)  # of the primaries: 21.457
LOST = 10.0  # |z| of a planetoid that has left; bound ones stay below 2.3

GAUSS = Gauss(s=DEGREE, h=H)
HBVM_18 = HBVM(k=NODES, s=DEGREE, h=H)
TRUTH = HBVM(k=16, s=8, h=H / 4)

STEPS = (1 / 32, 1 / 16, 1 / 12, 0.1, 1 / 8, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.7, 0.8)
STEPS_SHORT = (1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 2)
NEIGHBOURS = 32
REVOLUTIONS = (1, 16, 31)  # drawn as lines, to see the ellipses turn


@dataclass(frozen=True, eq=False)
class Orbit:
    """A run at its steps, reduced to what is drawn."""

    method: str  # as it prints
    t: Array  # shape (n,), from 0
    primaries: Array  # shape (n, 2, 2): step, body, (x, y)
    z: Array  # shape (n,), the planetoid's height
    energy: Array  # shape (n,), relative error of H
    momentum: Array  # shape (n,), relative error of the angular momentum vector M
    plane: float  # largest |z| of a primary
    off_axis: float  # largest distance of the planetoid from the axis

    @property
    def distance(self) -> Array:
        """Distance of the primaries, shape (n,)."""
        return np.hypot(*(self.primaries[:, 0] - self.primaries[:, 1]).T)

    @property
    def apocentres(self) -> tuple[float, float]:
        """The smallest and the largest maximum of the primaries' distance, each from a parabola."""
        _, a, b, c = _maxima(self.distance)
        peaks = b - (a - c) ** 2 / (8 * (a - 2 * b + c))
        return float(peaks.min()), float(peaks.max())

    @property
    def lost(self) -> float | None:
        """When the planetoid has left, or ``None``."""
        return first(self.t, np.abs(self.z) > LOST)


@dataclass(frozen=True)
class StepRow:
    """What a method does with a step h over the paper's span."""

    family: str  # "gauss", "hbvm" or "truth"
    s: int
    h: float
    lost: float | None  # when the planetoid has left
    energy: float  # largest relative error of H
    z_error: float  # of the planetoid at the end
    turn: float  # degrees per revolution at which the primaries' orbits turn, less the true rate
    unsteady: float  # rms of what a constant rate leaves, degrees
    period: float  # mean time between two apocentres of the primaries
    slow: float  # its relative error
    reason: str  # why it ended early; empty otherwise

    @property
    def usable(self) -> bool:
        """Whether the rates describe the whole integration interval of a bound planetoid."""
        return self.lost is None and not self.reason

    @property
    def beat(self) -> float:
        """After how long the steps fall on the same places of the revolution again."""
        steps = self.period / self.h
        return self.period / abs(steps - round(steps))


def problem(e: float = E) -> Problem:
    """Return the problem with the paper's numbers."""
    return problems.load("sitnikov", e=e, d=D, t_end=T_END)


def orbit(method: MethodBase, every: int = 1) -> Orbit:
    """Integrate over the paper's span; keep every ``every``-th of the steps of the method."""
    solution = _run(method)
    start = solution.problem
    y = np.vstack([start.y0, solution.y])[::every]
    errors = start.errors(y)
    return Orbit(
        method=repr(method),
        t=np.concatenate([[start.t0], solution.t])[::every],
        primaries=y[:, :6].reshape(-1, 2, 3)[:, :, :2],
        z=y[:, 8],
        energy=errors["energy"],
        momentum=errors["angular_momentum"],
        plane=float(np.abs(y[:, [2, 5]]).max()),
        off_axis=float(start.guards(y)["off_axis"].max()),
    )


def orbits() -> dict[str, Orbit]:
    """Return the paper's two runs and the reference on the grid of step 1/2, and that on its own grid.

    Where a method is installed that keeps both energy and angular momentum, ``both`` is its run.
    """
    orbits_ = {"gauss": orbit(GAUSS), "hbvm": orbit(HBVM_18), "fine": orbit(TRUTH)}
    orbits_["truth"] = orbit(TRUTH, every=4)
    if "LineIntegral" in registry.names():
        both = ["energy", "angular_momentum"]
        orbits_["both"] = orbit(registry.create("LineIntegral", k=24, s=4, h=H, invariants=both))
    return orbits_


def ellipses() -> list[Array]:
    """Return the paths (2, n) of the second primary under HBVM(18, 2) in the `REVOLUTIONS`."""
    start = problem()
    stepper = HBVM_18.compile(start.system).start(start.y0, start.par, 0.0)
    grids = [PERIOD * (number - 1 + np.linspace(0.0, 1.0, 401)) for number in REVOLUTIONS]
    return [stepper.advance(times).y[:, 3:5].T for times in grids]


def neighbours() -> list[float | None]:
    """Return when Gauss loses the planetoid from starts that differ in the last bits of e."""
    starts = [problem(E + i * 2.0**-53) for i in range(NEIGHBOURS)]
    program = GAUSS.compile(starts[0].system)
    return [
        departure(
            program.start(neighbour.y0, neighbour.par),
            T_END,
            lambda y: np.abs(y[:, 8]) > LOST,
            stretch=64 * H,
        )
        for neighbour in starts
    ]


def energy_by_nodes(h: float, ks: Sequence[int] = range(DEGREE, 25)) -> list[tuple[int, float, float | None]]:
    """Return k, largest relative error of H and the time of loss, for HBVM(k, 2) with step h."""
    runs = [(k, _run(HBVM(k=k, s=DEGREE, h=h))) for k in ks]
    return [(k, float(run.errors()["energy"].max()), _lost(run)) for k, run in runs]


def by_step(s: int, steps: Sequence[float] = STEPS) -> list[StepRow]:
    """Return what Gauss(s) and HBVM(k, s) with many nodes do with each step, the reference solution first."""
    truth = _run(TRUTH)
    rate, _ = turning(truth)
    rows = [_row(truth, "truth", 0.0, truth)]
    for h in steps:
        rows.append(_row(_run(Gauss(s=s, h=h)), "gauss", rate, truth))
        rows.append(_row(_run(HBVM(k=max(NODES, 5 * s), s=s, h=h)), "hbvm", rate, truth))
    return rows


def turning(solution: Solution) -> tuple[float, float]:
    """Return the rate at which the primaries' orbit turns, degrees per revolution, and how unevenly.

    The direction is that of the Laplace-Runge-Lenz vector of the relative motion; the rate is that of a
    straight fit, whose residuals have the rms that is returned, in degrees.
    """
    m1, m2 = solution.problem.par[:2]
    r = solution.y[:, 3:5] - solution.y[:, 0:2]
    v = solution.y[:, 12:14] / m2 - solution.y[:, 9:11] / m1
    area = r[:, 0] * v[:, 1] - r[:, 1] * v[:, 0]
    distance = np.hypot(r[:, 0], r[:, 1])
    x = v[:, 1] * area / (m1 + m2) - r[:, 0] / distance
    y = -v[:, 0] * area / (m1 + m2) - r[:, 1] / distance
    angle = np.degrees(np.unwrap(np.arctan2(y, x)))
    slope, start = np.polyfit(solution.t, angle, 1)
    return float(slope * PERIOD), float(np.std(angle - start - slope * solution.t))


def radial_period(solution: Solution) -> float:
    """Return the mean time between two apocentres of the primaries, each found by a parabola."""
    t = solution.t
    i, before, at, after = _maxima(np.hypot(*(solution.y[:, 3:5] - solution.y[:, 0:2]).T))
    if i.size < 2:
        return float("nan")
    peaks = t[i] + 0.5 * (t[1] - t[0]) * (before - after) / (before - 2 * at + after)
    return float((peaks[-1] - peaks[0]) / (i.size - 1))


def _run(method: MethodBase) -> Solution:
    return integrate(problem(), method, times=[T_END], sample="steps")


def _lost(solution: Solution) -> float | None:
    return first(solution.t, np.abs(solution.y[:, 8]) > LOST)


def _maxima(values: Array) -> tuple[Any, Array, Array, Array]:
    """Return where values are larger than their neighbours; the values before, at and after these places."""
    i = 1 + np.flatnonzero((values[1:-1] > values[:-2]) & (values[1:-1] >= values[2:]))
    return i, values[i - 1], values[i], values[i + 1]


def _row(solution: Solution, family: str, true_rate: float, truth: Solution) -> StepRow:
    method: Any = solution.method
    rate, unsteady = turning(solution)
    period = radial_period(solution)
    end = float(abs(solution.y[-1, 8] - truth.y[-1, 8]))
    return StepRow(
        family=family,
        s=method.s,
        h=method.h,
        lost=_lost(solution),
        energy=float(solution.errors()["energy"].max()),
        z_error=float("nan") if solution.status.failed else end,
        turn=rate - true_rate,
        unsteady=unsteady,
        period=period,
        slow=period / radial_period(truth) - 1.0,
        reason=solution.reason,
    )
