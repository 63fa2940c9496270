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
