"""Sitnikov's problem as the paper ran it, and what its figures do not show."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import problems
from hbvm_bench.reference import solutions
from hbvm_bench.studies.paper.experiments.departure import departure, first
from integrators import Solution, integrate, registry
from integrators.gauss import Gauss
from integrators.hbvm import HBVM
from integrators.protocol import Array, MethodBase
from problems.errors import InputError

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
TRIALS = (
    ("Gauss, s = 2, h = 1/8", Gauss(s=2, h=1 / 8)),
    ("HBVM(18,2), h = 1/2", HBVM_18),
    ("HBVM(18,2), h = 1/8", HBVM(k=18, s=2, h=1 / 8)),
    ("HBVM(18,4), h = 1/4", HBVM(k=18, s=4, h=1 / 4)),
    ("HBVM(16,8), h = 1/8", TRUTH),
)


@dataclass(frozen=True, eq=False)
class Orbit:
    """A run at its own steps, reduced to what is drawn.

    Attributes
    ----------
    method : str
        As it prints.
    t : ndarray, shape (n,)
        Times, from 0.
    primaries : ndarray, shape (n, 2, 2)
        Step, body, (x, y).
    z : ndarray, shape (n,)
        The planetoid's height.
    energy, momentum : ndarray, shape (n,)
        Relative errors of H and of the angular momentum vector M.
    plane, off_axis : float
        Largest |z| of a primary, largest distance of the planetoid from the axis.
    reason : str
        Why it ended early; empty otherwise.
    """

    method: str
    t: Array
    primaries: Array
    z: Array
    energy: Array
    momentum: Array
    plane: float
    off_axis: float
    reason: str

    @property
    def distance(self) -> Array:
        """Distance of the primaries, shape (n,)."""
        return np.hypot(*(self.primaries[:, 0] - self.primaries[:, 1]).T)

    @property
    def lost(self) -> float | None:
        """When the planetoid has left, or ``None``."""
        return first(self.t, np.abs(self.z) > LOST)


@dataclass(frozen=True)
class StepRow:
    """What a method does with a step h over the paper's span.

    Attributes
    ----------
    method : str
        As it prints.
    family, s, h
        Family ("gauss" or "hbvm"), degree and step.
    lost : float or None
        When the planetoid has left.
    energy : float
        Largest relative error of H.
    z_error : float
        Of the planetoid at the end.
    turn, unsteady : float
        Rate at which the primaries' orbits turn, degrees per revolution, less the
        true one; rms of what a constant rate leaves, degrees.
    period : float
        Mean time between two apocentres of the primaries.
    slow : float
        Its relative error.
    reason : str
        Why it ended early; empty otherwise.
    """

    method: str
    family: str
    s: int
    h: float
    lost: float | None
    energy: float
    z_error: float
    turn: float
    unsteady: float
    period: float
    slow: float
    reason: str


def usable(row: StepRow) -> bool:
    """Whether the rates of a row describe the whole span of a bound planetoid."""
    return row.lost is None and not row.reason


def both_laws() -> MethodBase | None:
    """Return the method that keeps energy and angular momentum, where one is installed."""
    if "LineIntegral" not in registry.names():
        return None
    return registry.create("LineIntegral", k=24, s=4, h=H, invariants=["energy", "angular_momentum"])


def orbit(method: MethodBase, every: int = 1) -> Orbit:
    """Integrate over the paper's span; keep every ``every``-th of the method's own steps."""
    solution = _run(method)
    problem = solution.problem
    t = np.concatenate([[problem.t0], solution.t])[::every]
    y = np.vstack([problem.y0, solution.y])[::every]
    errors = problem.errors(y)
    return Orbit(
        method=repr(method),
        t=t,
        primaries=y[:, :6].reshape(-1, 2, 3)[:, :, :2],
        z=y[:, 8],
        energy=errors["energy"],
        momentum=errors["angular_momentum"],
        plane=float(np.abs(y[:, [2, 5]]).max()),
        off_axis=float(problem.guards(y)["off_axis"].max()),
        reason=solution.reason,
    )


def orbits() -> dict[str, Orbit]:
    """Return the paper's two runs and the true motion on the grid of step 1/2, and that on its own grid."""
    made = {
        "gauss": orbit(GAUSS),
        "hbvm": orbit(HBVM_18),
        "truth": orbit(TRUTH, every=4),
        "fine": orbit(TRUTH),
    }
    method = both_laws()
    if method is not None:
        made["both"] = orbit(method)
    return made


def ellipses() -> list[Array]:
    """Return the paths (2, n) of the second primary under HBVM(18, 2) in the `REVOLUTIONS`."""
    problem = problems.load("sitnikov", e=E, d=D, t_end=T_END)
    stepper = HBVM_18.compile(problem.system).start(problem.y0, problem.par, 0.0)
    paths = []
    for number in REVOLUTIONS:
        times = PERIOD * (number - 1 + np.linspace(0.0, 1.0, 401))
        paths.append(stepper.advance(times).y[:, 3:5].T)
    return paths


def neighbours() -> list[float | None]:
    """Return when Gauss loses the planetoid from starts that differ in the last bits of e."""
    program = None
    times: list[float | None] = []
    for i in range(NEIGHBOURS):
        problem = problems.load("sitnikov", e=E + i * 2.0**-53)
        program = program or GAUSS.compile(problem.system)
        stepper = program.start(problem.y0, problem.par, problem.t0)
        times.append(departure(stepper, T_END, lambda y: np.abs(y[:, 8]) > LOST, stretch=64 * H))
    return times


def energy_by_nodes(h: float, ks: Sequence[int] = range(DEGREE, 25)) -> list[tuple[int, float, float | None]]:
    """Return k, largest relative error of H and the time of loss, for HBVM(k, 2) with step h."""
    rows = []
    for k in ks:
        solution = _run(HBVM(k=k, s=DEGREE, h=h))
        error = float(solution.errors()["energy"].max())
        rows.append((k, error, first(solution.t, np.abs(solution.y[:, 8]) > LOST)))
    return rows


def by_step(s: int, steps: Sequence[float] = STEPS) -> list[StepRow]:
    """Return what Gauss(s) and HBVM(k, s) with many nodes do with each step, the true motion first."""
    truth = _run(TRUTH)
    rate, _ = turning(truth)
    rows = [_row(truth, "truth", rate, truth)]
    for h in steps:
        rows.append(_row(_run(Gauss(s=s, h=h)), "gauss", rate, truth))
        rows.append(_row(_run(HBVM(k=max(NODES, 5 * s), s=s, h=h)), "hbvm", rate, truth))
    return rows


def turning(solution: Solution) -> tuple[float, float]:
    """Return the rate at which the primaries' orbit turns, and how unevenly.

    The direction is that of the Laplace-Runge-Lenz vector of the relative motion.

    Returns
    -------
    rate, unsteady : float
        Degrees per revolution of a straight fit; rms of its residuals, degrees.
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
    t, distance = solution.t, np.hypot(*(solution.y[:, 3:5] - solution.y[:, 0:2]).T)
    i = 1 + np.flatnonzero((distance[1:-1] > distance[:-2]) & (distance[1:-1] >= distance[2:]))
    if i.size < 2:
        return float("nan")
    before, at, after = distance[i - 1], distance[i], distance[i + 1]
    peaks = t[i] + 0.5 * (t[1] - t[0]) * (before - after) / (before - 2 * at + after)
    return float((peaks[-1] - peaks[0]) / (i.size - 1))


def _run(method: MethodBase) -> Solution:
    problem = problems.load("sitnikov", e=E, d=D, t_end=T_END)
    return integrate(problem, method, times=[T_END], sample="steps")


def _row(solution: Solution, family: str, true_rate: float, truth: Solution) -> StepRow:
    method: Any = solution.method
    rate, unsteady = turning(solution)
    finished = not solution.status.failed
    period = radial_period(solution)
    return StepRow(
        method=repr(method),
        family=family,
        s=method.s,
        h=method.h,
        lost=first(solution.t, np.abs(solution.y[:, 8]) > LOST),
        energy=float(solution.errors()["energy"].max()),
        z_error=float(abs(solution.y[-1, 8] - truth.y[-1, 8])) if finished else float("nan"),
        turn=rate - (0.0 if family == "truth" else true_rate),
        unsteady=unsteady,
        period=period,
        slow=period / radial_period(truth) - 1.0,
        reason=solution.reason,
    )


def against_truth() -> list[tuple[str, str, Array, Array]]:
    """Return label, family, times and |z - true z| of several runs, at the times of the 128-bit reference."""
    problem = problems.load("sitnikov", e=E, d=D, t_end=T_END)
    known = solutions.find(problem)
    if known is None:
        raise InputError(
            "the stored reference of sitnikov() is missing: run hbvm-bench reference 'sitnikov()'."
        )
    made = []
    for label, method in TRIALS:
        solution = integrate(problem, method, times=known.t)
        made.append(
            (label, method.family, solution.t, np.abs(solution.y[:, 8] - known.high[: solution.t.size, 8]))
        )
    return made
