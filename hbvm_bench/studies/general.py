"""The systems of the campaign ``general.toml`` that are not of the catalogue: they conserve nothing."""

import math

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


def decay_chain(fast: bool = False) -> Problem:
    """Return a chain of ten decays (DETEST C1), or with rates that rise from 1 to 9 along it (C2)."""
    rates = list(range(1, 10)) if fast else [1] * 9
    system = VectorField(
        lambda y: [-y[0], *(rates[i - 1] * y[i - 1] - rates[i] * y[i] for i in range(1, 9)), rates[8] * y[8]],
        dim=10,
        name="decay_chain",
    )
    return Problem(system, y0=[1.0] + [0.0] * 9, t_end=20.0, title="a chain of decays")


def diffusion(n: int = 10) -> Problem:
    """Return the heat equation on n points, heated at one end (DETEST C3: 10, C4: 51)."""

    def field(y):
        row = [0.0, *(y[i] for i in range(n)), 0.0]
        return [row[i - 1] - 2 * row[i] + row[i + 1] for i in range(1, n + 1)]

    system = VectorField(field, dim=n, name=f"diffusion_{n}")
    return Problem(system, y0=[1.0] + [0.0] * (n - 1), t_end=20.0, title=f"heat equation, {n} points")


def hires() -> Problem:
    """Return the eight reactions of HIRES, a plant's response to light."""
    system = VectorField(
        lambda y: [
            -1.71 * y[0] + 0.43 * y[1] + 8.32 * y[2] + 0.0007,
            1.71 * y[0] - 8.75 * y[1],
            -10.03 * y[2] + 0.43 * y[3] + 0.035 * y[4],
            8.32 * y[1] + 1.71 * y[2] - 1.12 * y[3],
            -1.745 * y[4] + 0.43 * y[5] + 0.43 * y[6],
            -280.0 * y[5] * y[7] + 0.69 * y[3] + 1.71 * y[4] - 0.43 * y[5] + 0.69 * y[6],
            280.0 * y[5] * y[7] - 1.81 * y[6],
            -280.0 * y[5] * y[7] + 1.81 * y[6],
        ],
        dim=8,
        name="hires",
    )
    return Problem(system, y0=[1.0, 0, 0, 0, 0, 0, 0, 0.0057], t_end=321.8122, title="HIRES")


def reaction_diffusion(n: int = 40) -> Problem:
    """Return the Brusselator with diffusion on n points of a line: five diagonals of the Jacobian.

    The system BRUSS of E. Hairer and G. Wanner, Solving Ordinary Differential Equations II, section IV.10,
    with the two concentrations of a point side by side.
    """
    rate = (n + 1) ** 2 / 50

    def field(y):
        u, v = [1.0, *(y[2 * i] for i in range(n)), 1.0], [3.0, *(y[2 * i + 1] for i in range(n)), 3.0]
        return [
            slope
            for i in range(1, n + 1)
            for slope in (
                1 + u[i] ** 2 * v[i] - 4 * u[i] + rate * (u[i - 1] - 2 * u[i] + u[i + 1]),
                3 * u[i] - u[i] ** 2 * v[i] + rate * (v[i - 1] - 2 * v[i] + v[i + 1]),
            )
        ]

    system = VectorField(field, dim=2 * n, name=f"reaction_diffusion_{n}")
    points = [i / (n + 1) for i in range(1, n + 1)]
    start = [value for x in points for value in (1 + math.sin(2 * math.pi * x), 3.0)]
    return Problem(system, y0=start, t_end=10.0, title=f"Brusselator with diffusion, {n} points")


def plate(n: int = 9) -> Problem:
    """Return u' = (u_xx + u_yy) / 2 + 40 u (1 - u), a reaction that spreads, on n times n points."""
    rate = 0.5 * (n + 1) ** 2

    def field(y):
        def at(i, j):
            return y[n * i + j] if 0 <= i < n and 0 <= j < n else 0.0

        return [
            rate * (at(i - 1, j) + at(i + 1, j) + at(i, j - 1) + at(i, j + 1) - 4 * at(i, j))
            + 40 * at(i, j) * (1 - at(i, j))
            for i in range(n)
            for j in range(n)
        ]

    system = VectorField(field, dim=n * n, name=f"plate_{n}")
    start = [1.0 if i < n // 2 and j < n // 2 else 0.1 for i in range(n) for j in range(n)]
    return Problem(system, y0=start, t_end=0.2, title=f"a reaction on {n} x {n} points")


def lorenz() -> Problem:
    """Return Lorenz's three equations, with 10, 28 and 8/3."""
    system = VectorField(
        lambda y: [10 * (y[1] - y[0]), y[0] * (28 - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]],
        dim=3,
        name="lorenz",
    )
    return Problem(system, y0=[1.0, 1.0, 1.0], t_end=10.0, title="Lorenz's equations")


def brusselator() -> Problem:
    """Return the two reactions of the Brusselator, with 1 and 3."""
    system = VectorField(
        lambda y: [1 + y[0] ** 2 * y[1] - 4 * y[0], 3 * y[0] - y[0] ** 2 * y[1]], dim=2, name="brusselator"
    )
    return Problem(system, y0=[1.5, 3.0], t_end=20.0, title="Brusselator")
