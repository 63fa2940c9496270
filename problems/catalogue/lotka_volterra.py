"""Three species of Lotka and Volterra, a Poisson system."""

from problems.entry import Expected, entry
from problems.picture import Curves
from problems.problem import Problem
from problems.systems.poisson import Poisson


def _energy(y, par, m):
    a, b = par.a, par.b
    return a * b * y[0] + y[1] - a * y[2] + par.nu * m.log(y[1]) - par.mu * m.log(y[2])


def _structure(y, par):
    xy = par.c * y[0] * y[1]
    xz = par.b * par.c * y[0] * y[2]
    yz = y[1] * y[2]
    return [[0, xy, xz], [-xy, 0, -yz], [-xz, yz, 0]]


def _casimir(y, par, m):
    return par.a * par.b * m.log(y[0]) - par.b * m.log(y[1]) + m.log(y[2])


@entry(
    title="three species of Lotka and Volterra",
    references=(
        "D. Cohen, E. Hairer, Linear energy-preserving integrators for Poisson systems, BIT 51 (2011) 91-101",
    ),
    notes="A Poisson system: the structure matrix depends on the state. A logarithmic Casimir.",
    picture=Curves(curves=((0, "y₁"), (1, "y₂"), (2, "y₃")), span=20.0, points=500),
    expected=Expected(h=0.1, energy=1e-15, default=4e-15),
)
def lotka_volterra(*, t_end: float = 100.0) -> Problem:
    """Return three species of predators and prey.

        B = [[0, c y1 y2, b c y1 y3], [-c y1 y2, 0, -y2 y3], [-b c y1 y3, y2 y3, 0]]
        H = a b y1 + y2 - a y3 + nu ln y2 - mu ln y3,   a b c = -1

    with a = -2, b = -1, c = -1/2, nu = 1, mu = 2, from (1.0, 1.9, 0.5). Tests a structure
    matrix that depends on the state; the orbit is periodic.

    Parameters
    ----------
    t_end : float
        End of the integration.

    Returns
    -------
    Problem
        State ``[y1, y2, y3]``; parameters as named; invariants: energy, and the
        Casimir ``a b ln y1 - b ln y2 + ln y3``, which is one only if a b c = -1.
    """
    system = Poisson(
        _energy,
        _structure,
        dim=3,
        parameters={"a": -2.0, "b": -1.0, "c": -0.5, "nu": 1.0, "mu": 2.0},
        invariants={"casimir": _casimir},
        name="lotka_volterra",
    )
    return Problem(system, y0=[1.0, 1.9, 0.5], t_end=t_end)
