"""Two Poisson systems: three species of Lotka and Volterra, and the free rigid body.

The three-species system is that of D. Cohen, E. Hairer, "Linear energy-preserving
integrators for Poisson systems", BIT 51 (2011) 91-101; the rigid body that of
E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration, 2nd edition
(Springer 2006), section VII.5.
"""

from typing import Any

from problems.catalogue import _given as given
from problems.problem import Problem
from problems.registry import changed
from problems.systems.poisson import Poisson


def _lotka_volterra_energy(y: Any, par: Any, m: Any) -> Any:
    a, b = par.a, par.b
    return a * b * y[0] + y[1] - a * y[2] + par.nu * m.log(y[1]) - par.mu * m.log(y[2])


def _lotka_volterra_structure(y: Any, par: Any) -> Any:
    xy = par.c * y[0] * y[1]
    xz = par.b * par.c * y[0] * y[2]
    yz = y[1] * y[2]
    return [[0, xy, xz], [-xy, 0, -yz], [-xz, yz, 0]]


def _lotka_volterra_casimir(y: Any, par: Any, m: Any) -> Any:
    return par.a * par.b * m.log(y[0]) - par.b * m.log(y[1]) + m.log(y[2])


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

    Raises
    ------
    problems.errors.InputError
        If ``t_end`` is not finite.
    """
    given.finite("lotka_volterra", t_end=t_end)
    system = Poisson(
        _lotka_volterra_energy,
        _lotka_volterra_structure,
        dim=3,
        parameters={"a": -2.0, "b": -1.0, "c": -0.5, "nu": 1.0, "mu": 2.0},
        invariants={"casimir": _lotka_volterra_casimir},
        name="lotka_volterra",
    )
    return Problem(
        system,
        y0=[1.0, 1.9, 0.5],
        t_end=t_end,
        name="lotka_volterra",
        title="three species of Lotka and Volterra",
        arguments=changed(lotka_volterra, t_end=t_end),
        references=(
            "D. Cohen, E. Hairer, Linear energy-preserving integrators for Poisson systems, "
            "BIT 51 (2011) 91-101",
        ),
        notes="A Poisson system: the structure matrix depends on the state. A logarithmic Casimir.",
    )


def _rigid_body_energy(y: Any, par: Any) -> Any:
    squares = [y[i] * y[i] for i in range(3)]
    turning = sum(squares[i] / (2 * par.inertia[i]) for i in range(3))
    return turning + par.quartic / 4 * sum(square * square for square in squares)


def _rigid_body_structure(y: Any) -> Any:
    return [[0, -y[2], y[1]], [y[2], 0, -y[0]], [-y[1], y[0], 0]]


def _rigid_body_casimir(y: Any) -> Any:
    return (y[0] * y[0] + y[1] * y[1] + y[2] * y[2]) / 2


def rigid_body(*, quartic: float = 0.0, t_end: float = 200.0) -> Problem:
    """Return the free rigid body in body axes, or one with a quartic energy.

        B = [[0, -y3, y2], [y3, 0, -y1], [-y2, y1, 0]]
        H = sum_i y_i^2/(2 I_i) + quartic/4 sum_i y_i^4

    with the moments of inertia I = (2, 1, 2/3), from (cos 1.1, 0, sin 1.1). Tests a
    Casimir beside the energy: with ``quartic=0`` both are quadratic and every Gauss
    method keeps them; otherwise only methods that keep the energy by design do.

    Parameters
    ----------
    quartic : float
        Strength of the quartic energy.
    t_end : float
        End of the integration.

    Returns
    -------
    Problem
        State: angular momentum ``[y1, y2, y3]``; parameters ``inertia``, ``quartic``;
        invariants: energy, and the Casimir |y|^2/2.

    Raises
    ------
    problems.errors.InputError
        For values that are not finite.
    """
    given.finite("rigid_body", quartic=quartic, t_end=t_end)
    system = Poisson(
        _rigid_body_energy,
        _rigid_body_structure,
        dim=3,
        parameters={"inertia": (2.0, 1.0, 2 / 3), "quartic": 0.0},
        invariants={"casimir": _rigid_body_casimir},
        name="rigid_body",
    )
    return Problem(
        system,
        y0=[given.nearest(lambda: _start(0)), 0.0, given.nearest(lambda: _start(1))],
        parameters={"quartic": quartic},
        t_end=t_end,
        name="rigid_body",
        title="the free rigid body",
        arguments={"quartic": quartic} | changed(rigid_body, t_end=t_end),
        references=(
            "E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration, 2nd edition, "
            "Springer 2006, section VII.5",
        ),
        notes="A Poisson system with a quadratic Casimir; a quartic energy on request.",
    )


def _start(component: int) -> Any:
    import mpmath

    angle = mpmath.mpf("1.1")
    return mpmath.sin(angle) if component else mpmath.cos(angle)
