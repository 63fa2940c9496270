"""The Henon-Heiles experiment: who leaves the triangle, when, and from where."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from integrators import integrate
from integrators.methods.gauss import Gauss
from integrators.methods.hbvm import HBVM
from integrators.protocol import Array, MethodBase
from problems import Problem
from problems.catalogue.henon_heiles import henon_heiles, inside_triangle

from .departure import departure, first, step_states

H, T_END = 1.0, 5e4
GAUSS = Gauss(s=2, h=H)
HBVM_4 = HBVM(k=4, s=2, h=H)

PRINTED = 7000.0  # the paper's escape time, "t ≃ 7000"
GAP = 2e-4  # 1/6 - H0; the paper says "very close to 1/6" and gives no start
START = (0.0, 0.5, 0.5)  # q1, q2 and the momentum's angle
GONE = 2.0  # |q| from which no orbit comes back
NEIGHBOURS = 32

DIRECTIONS = tuple((np.arange(36) * 2 * math.pi / 36).tolist())
GAPS = tuple((10.0 ** np.linspace(-5.0, -2.0, 19)).tolist())
MAP_END = 2e4

STEPS = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0)
STEP_STARTS = 8
TRUTH = HBVM(k=15, s=10, h=0.25)
Floats = Sequence[float]
AGREES = 1e-2  # distance at which two orbits have parted


@dataclass(frozen=True, eq=False)
class Orbit:
    """A run at its steps."""

    method: str  # as it prints
    t: Array  # shape (n,)
    q: Array  # shape (n, 2)
    energy: Array  # shape (n,), values of H
    error: float  # largest relative error of H
    left: float | None  # when |q| exceeded `GONE`
    outside: int  # number of steps outside the triangle before that


@dataclass(frozen=True)
class StepRow:
    """What a method does with a step h."""

    h: float
    left: list[float | None]  # when the orbits from neighbouring initial conditions have left
    agrees: float  # time up to which the orbit is within `AGREES` of the true one


def start(t_end: float = T_END, gap: float = GAP, direction: float = START[2]) -> Problem:
    """Return the problem from our start, or with another energy 1/6 - gap or direction of the momentum."""
    return henon_heiles(energy=1 / 6 - gap, q1=START[0], q2=START[1], direction=direction, t_end=t_end)


def orbit(method: MethodBase, offset: int = 0, t_end: float = T_END) -> Orbit:
    """Integrate from the start, ``offset`` last bits away."""
    problem = start(t_end)
    t, y, stepper = step_states(problem, method, neighbour(problem.y0, offset), t_end)
    gone = np.flatnonzero(np.abs(y[:, :2]).max(axis=1) > GONE)
    if gone.size:
        t, y = t[: gone[0] + 1], y[: gone[0] + 1]
    return Orbit(
        method=repr(method),
        t=t,
        q=y[:, :2],
        energy=problem.invariants(y)["energy"],
        error=float(problem.errors(y)["energy"].max()),
        left=float(t[-1]) if gone.size else float(stepper.t) if stepper.status.failed else None,
        outside=int(np.count_nonzero(~inside_triangle(y))) - int(gone.size > 0),
    )


def neighbour(y0: Array, offset: int) -> Array:
    """Return the start whose second momentum is ``offset`` times 2^-53 larger."""
    y = y0.copy()
    y[3] += offset * 2.0**-53
    return y


def gauss_orbit() -> tuple[int, Orbit]:
    """Return the neighbouring start whose escape is nearest to the paper's time, and its orbit."""
    times = escapes(GAUSS, t_end=2 * PRINTED)
    nearest = min(range(len(times)), key=lambda i: abs((times[i] or np.inf) - PRINTED))
    return nearest, orbit(GAUSS, offset=nearest)


def escapes(
    method: MethodBase, offsets: Sequence[int] = range(NEIGHBOURS), t_end: float = T_END
) -> list[float | None]:
    """Return when the orbits from neighbouring initial conditions have left."""
    problem = start()
    program = method.compile(problem.system)
    starts = [neighbour(problem.y0, i) for i in offsets]
    return [departure(program.start(y0, problem.par), t_end, _gone, stretch=256 * H) for y0 in starts]


def by_step(family: str, steps: Sequence[float] = STEPS, starts: int = STEP_STARTS) -> list[StepRow]:
    """Return what ``gauss``, s = 2, or ``hbvm``, HBVM(4, 2), does with each step."""
    methods = [(h, Gauss(s=2, h=h) if family == "gauss" else HBVM(k=4, s=2, h=h)) for h in steps]
    return [StepRow(h, escapes(method, range(starts)), agreement(method)) for h, method in methods]


def agreement(method: MethodBase, t_end: float = 100.0) -> float:
    """Return the time of the first step at which the orbit is `AGREES` away from the true one."""
    problem = start(t_end)
    solution = integrate(problem, method, times=[t_end], sample="steps")
    truth = integrate(problem, TRUTH, times=solution.t)
    return parted(solution.t, solution.y, truth.y)


def parted(t: Array, y: Array, truth: Array) -> float:
    """Return the first time at which positions are `AGREES` away from the true ones, or else the last."""
    time = first(t, ~(np.hypot(*(y[:, :2] - truth[:, :2]).T) < AGREES))
    return float(t[-1]) if time is None else time


def escape_map(
    method: MethodBase, gaps: Floats = GAPS, directions: Floats = DIRECTIONS, t_end: float = MAP_END
) -> Array:
    """Return when orbits have left, shape (len(gaps), len(directions)); NaN where the orbit stays.

    A gap is 1/6 less the energy, a direction that of the momentum at the start.
    """
    program = method.compile(henon_heiles().system)

    def left(gap: float, direction: float) -> float | None:
        problem = start(t_end, gap, direction)
        return departure(program.start(problem.y0, problem.par), t_end, _gone, stretch=128 * H)

    return np.array([[left(gap, direction) for direction in directions] for gap in gaps], dtype=float)


def true_orbit(t_end: float = 300.0) -> Array:
    """Return positions of the true orbit, shape (n, 2), for a trace in the level curves."""
    problem = start(t_end)
    times = np.arange(0.0, t_end + 0.05, 0.1)
    return integrate(problem, HBVM(k=12, s=8, h=0.2), times=times).y[:, :2]


def potential(q1: Array, q2: Array) -> Array:
    """Return U(q1, q2)."""
    return (q1**2 + q2**2) / 2 + q1**2 * q2 - q2**3 / 3


def _gone(y: Array) -> NDArray[np.bool_]:
    return ~(np.abs(y[:, :2]).max(axis=1) <= GONE)
