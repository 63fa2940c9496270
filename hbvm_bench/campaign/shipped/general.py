"""The systems of the campaign ``general.toml`` that are not of the catalogue: they conserve nothing."""

from problems import Hamiltonian, Problem, VectorField


def van_der_pol() -> Problem:
    """Return van der Pol's equation with mu = 1000, time in units of mu."""
    system = VectorField(
        lambda y, par: [y[1], par.stiffness * ((1 - y[0] ** 2) * y[1] - y[0])],
        dim=2,
        parameters={"stiffness": 1e6},
        name="van_der_pol",
    )
    return Problem(system, y0=[2.0, 0.0], t_end=2.0, title="van der Pol's equation, mu = 1000")


def robertson() -> Problem:
    """Return Robertson's three reactions, with rates 0.04, 1e4 and 3e7."""
    system = VectorField(
        lambda y: [
            -0.04 * y[0] + 1e4 * y[1] * y[2],
            0.04 * y[0] - 1e4 * y[1] * y[2] - 3e7 * y[1] ** 2,
            3e7 * y[1] ** 2,
        ],
        dim=3,
        name="robertson",
    )
    return Problem(system, y0=[1.0, 0.0, 0.0], t_end=40.0, title="Robertson's chemistry")


def driven_pendulum() -> Problem:
    """Return a pendulum that a torque 0.9 cos(2t/3) drives."""
    system = Hamiltonian(
        lambda q, p, t, m: p[0] ** 2 / 2 - m.cos(q[0]) - 0.9 * q[0] * m.cos(2 * t / 3),
        dof=1,
        name="driven_pendulum",
    )
    return Problem(system, y0=[0.2, 0.0], t_end=20.0, title="driven pendulum")
