"""Three small problems that the conformance kit puts to every method."""

from typing import Any

import numpy as np

from problems import Bodies, Hamiltonian, Problem


def pendulum() -> Problem:
    """Return a swinging pendulum over about three periods: smooth, not linear, one degree of freedom."""

    def H(q: Any, p: Any, m: Any) -> Any:
        return p[0] * p[0] / 2 - m.cos(q[0])

    return Problem(Hamiltonian(H, dof=1, name="pendulum"), q0=[0.0], p0=[1.5], t_end=20.0)


def two_bodies() -> Problem:
    """Return two bodies in space on ellipses (e = 0.3) over about three periods, masses 1 and 1/2."""

    def H(q: Any, p: Any, par: Any, m: Any) -> Any:
        kinetic = sum(p[3 * i + a] * p[3 * i + a] / (2 * par.m[i]) for i in range(2) for a in range(3))
        r2 = (q[0] - q[3]) * (q[0] - q[3]) + (q[1] - q[4]) * (q[1] - q[4]) + (q[2] - q[5]) * (q[2] - q[5])
        return kinetic - par.m[0] * par.m[1] / m.sqrt(r2)

    system = Hamiltonian(
        H,
        dof=6,
        parameters={"m": (1.0, 0.5)},
        bodies=Bodies(masses="m", G=1.0, dimension=3),
        name="two_bodies",
    )
    # At pericentre of the relative orbit with a = 1: distance 0.7, speed sqrt(M (1 + e) / (1 - e)).
    speed = np.sqrt(1.5 * 1.3 / 0.7)
    q0 = [-0.7 / 3, 0.0, 0.0, 1.4 / 3, 0.0, 0.0]
    p0 = [0.0, -0.5 * speed * 2 / 3, 0.0, 0.0, 0.5 * speed * 2 / 3, 0.0]
    return Problem(system, q0=q0, p0=p0, t_end=15.0)


def blow_up() -> Problem:
    """Return q'' = 2 q^3 with q = 1/(1 - t): the solution ceases to exist at t = 1."""

    def H(q: Any, p: Any) -> Any:
        return p[0] * p[0] / 2 - q[0] * q[0] * q[0] * q[0] / 2

    return Problem(Hamiltonian(H, dof=1, name="blow_up"), q0=[1.0], p0=[1.0], t_end=2.0)
