"""A problem of one's own in a file: `hbvm-bench inspect "swing.py:swing(length=2)"`."""

from math import cos, sin

from problems import Hamiltonian, Problem


def swing(*, length: float = 1.0, angle: float = 1.0, t_end: float = 10.0) -> Problem:
    """Return a child on a swing that hangs on a spring, in metres, kilograms and seconds."""
    mass, stiffness, gravity = 30.0, 2e4, 9.81

    def H(q, p, m):
        radius = m.sqrt(q[0] ** 2 + q[1] ** 2)
        spring = stiffness * (radius - length) ** 2 / 2
        return (p[0] ** 2 + p[1] ** 2) / (2 * mass) + spring + mass * gravity * q[1]

    return Problem(
        Hamiltonian(H, dof=2),
        q0=[length * sin(angle), -length * cos(angle)],
        p0=[0.0, 0.0],
        t_end=t_end,
        title="a swing on a spring",
    )
