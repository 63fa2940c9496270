"""Small problems with known properties, written as a user would write them."""

from collections.abc import Callable

import numpy as np
import pytest

from problems import Hamiltonian, Problem


@pytest.fixture(scope="session")
def kepler() -> Callable[[float], Problem]:
    """Kepler's problem from pericentre, semi-major axis 1, period 2 pi, for an eccentricity."""

    def H(q, p, m):
        return (p[0] * p[0] + p[1] * p[1]) / 2 - 1 / m.sqrt(q[0] * q[0] + q[1] * q[1])

    def angular_momentum(q, p):
        return q[0] * p[1] - q[1] * p[0]

    system = Hamiltonian(H, dof=2, invariants={"angular_momentum": angular_momentum}, name="kepler")

    def make(e: float) -> Problem:
        return Problem(system, q0=[1 - e, 0.0], p0=[0.0, np.sqrt((1 + e) / (1 - e))], t_end=2 * np.pi)

    return make


@pytest.fixture(scope="session")
def kepler_exact() -> Callable[[float, np.ndarray], np.ndarray]:
    """The solution of `kepler`, from Kepler's equation."""

    def exact(e: float, t: np.ndarray) -> np.ndarray:
        t = np.asarray(t, dtype=float)
        E = t + e * np.sin(t)
        for _ in range(50):
            E -= (E - e * np.sin(E) - t) / (1 - e * np.cos(E))
        side, rate = np.sqrt(1 - e * e), 1 / (1 - e * np.cos(E))
        return np.stack(
            [np.cos(E) - e, side * np.sin(E), -np.sin(E) * rate, side * np.cos(E) * rate], axis=-1
        )

    return exact


@pytest.fixture(scope="session")
def henon_heiles() -> Problem:
    """Henon-Heiles at energy 1/8: polynomial of degree 3, not integrable."""

    def H(q, p):
        kinetic = (p[0] * p[0] + p[1] * p[1]) / 2
        return kinetic + (q[0] * q[0] + q[1] * q[1]) / 2 + q[0] * q[0] * q[1] - q[1] * q[1] * q[1] / 3

    # p_1 from H = 1/8 at q = (0, 0.1), p_2 = 0.2.
    p1 = np.sqrt(2 * (1 / 8 - 0.01 / 2 + 0.001 / 3) - 0.04)
    return Problem(Hamiltonian(H, dof=2, name="henon_heiles"), q0=[0.0, 0.1], p0=[p1, 0.2], t_end=50.0)
