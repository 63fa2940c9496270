"""heyoka's own model of gravitating bodies, ``heyoka.model.nbody``, faster than equations by hand."""

from collections.abc import Callable

import heyoka as hy
import numpy as np

import problems
from problems.bodies import bodies_of


def by_heyoka(problem: problems.Problem, times: np.ndarray, tol: float) -> Callable[[], np.ndarray]:
    """Return a function that integrates bodies to ``times``, and returns positions and momenta."""
    masses, positions, velocities = bodies_of(problem)
    start = np.hstack([positions, velocities]).ravel()
    made: list[hy.taylor_adaptive_dbl] = []

    def integrated() -> np.ndarray:
        if not made:
            G = problem.system.parameters.get("G", 1.0)
            gravity = hy.model.nbody(len(masses), masses=list(masses), Gconst=G)
            made.append(hy.taylor_adaptive(gravity, start, tol=tol, fast_math=True))
        ta = made[0]
        ta.time, ta.state[:] = problem.t0, start
        states = ta.propagate_grid(times)[5].reshape(len(times), len(masses), 2, 3)
        momenta = states[:, :, 1] * np.asarray(masses)[:, None]
        return np.hstack([states[:, :, 0].reshape(len(times), -1), momenta.reshape(len(times), -1)])

    return integrated
