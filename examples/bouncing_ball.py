"""A ball that bounces: an event that changes the state, beside SciPy's solve_ivp in a loop of one's own."""

from math import sqrt
from time import perf_counter

import numpy as np
from scipy.integrate import solve_ivp

import integrators
import problems

RESTITUTION = 0.999
END = 1000.0


def exact(end: float) -> np.ndarray:
    """Return the times of the impacts of a ball that falls from height 1 with g = 1."""
    times, speed = [sqrt(2.0)], RESTITUTION * sqrt(2.0)
    while times[-1] + 2.0 * speed < end:
        times.append(times[-1] + 2.0 * speed)
        speed *= RESTITUTION
    return np.array(times)


def by_event(problem: problems.Problem) -> np.ndarray:
    """Return the times of impacts, each an event whose action turns the speed around."""
    floor = integrators.Event(
        lambda q: q[0], direction=-1, then=lambda q, p: [q[0], -RESTITUTION * p[0]], name="floor"
    )
    return integrators.integrate(problem, integrators.HBVM(), [END], events=floor).events["floor"].t


def by_scipy() -> np.ndarray:
    """Return the same by a terminal event and a new start after each."""

    def floor(t: float, y: np.ndarray) -> float:
        return y[0]

    floor.terminal, floor.direction = True, -1.0  # pyright: ignore[reportFunctionMemberAccess]
    t, y, times = 0.0, np.array([1.0, 0.0]), []
    while t < END:
        piece = solve_ivp(
            lambda t, y: [y[1], -1.0], (t, END), y, method="DOP853", rtol=1e-12, atol=1e-14, events=floor
        )
        t, y = piece.t[-1], piece.y[:, -1]
        if piece.status == 1:
            times.append(t)
            y = np.array([0.0, -RESTITUTION * y[1]])
    return np.array(times)


def main() -> None:
    """Compare both with the exact times of impact, and with each other."""
    ball = problems.Hamiltonian(lambda q, p: p[0] ** 2 / 2 + q[0], dof=1, name="ball")
    problem = problems.Problem(ball, q0=[1.0], p0=[0.0], t_end=END)
    by_event(problem)  # compiles
    times = exact(END)
    for name, run in (("by an event", lambda: by_event(problem)), ("by SciPy", by_scipy)):
        began = perf_counter()
        found = run()
        seconds = perf_counter() - began
        same = found.size == times.size
        error = np.abs(found - times).max() if same else np.inf
        print(f"{name}: {found.size} impacts, {seconds / found.size * 1e6:.0f} us each, error {error:.1e}")
        print(f"{name}: each impact found:", same, "to 1e-9:", bool(error < 1e-9))


if __name__ == "__main__":
    main()
