"""Nonlinear wave equations on a periodic interval, discretised in space.

    H(q, p) = sum_i p_i^2/2 + (q_{i+1} - q_i)^2/(2 dx^2) + f(q_i),   q_n = q_0

which times dx is the energy of u_tt = u_xx - f'(u) with centred differences:
q_i = u(x_i), p_i = u_t(x_i). L. Brugnano, G. Frasca Caccia, F. Iavernaro, "Energy
conservation issues in the numerical solution of the semilinear wave equation",
Applied Mathematics and Computation 270 (2015) 842-870.
"""

from collections.abc import Callable
from typing import Any

from problems.catalogue import _given as given
from problems.problem import Problem
from problems.registry import changed
from problems.systems.hamiltonian import Hamiltonian

_REFERENCES = (
    "L. Brugnano, G. Frasca Caccia, F. Iavernaro, Energy conservation issues in the numerical solution "
    "of the semilinear wave equation, Applied Mathematics and Computation 270 (2015) 842-870",
)


def _lattice(
    n: int, potential: Callable[[Any, Any, Any], Any], name: str, **parameters: float
) -> Hamiltonian:
    """Return the system; ``stiffness`` is 1/dx^2, and ``potential(u, par, m)`` is f."""

    def energy(q: Any, p: Any, par: Any, m: Any) -> Any:
        def link(i: Any, j: Any) -> Any:
            rise = q[j] - q[i]
            return rise * rise

        neighbours = [(i, (i + 1) % n) for i in range(n)]
        kinetic = m.sum(lambda i: p[i] * p[i] / 2, range(n))
        bent = par.stiffness / 2 * m.sum(link, neighbours)
        return kinetic + (bent + m.sum(lambda i: potential(q[i], par, m), range(n)))

    return Hamiltonian(energy, dof=n, parameters={"stiffness": 1.0, **parameters}, name=f"{name}_{n}")


def sine_gordon(*, n: int = 200, gamma: float = 1.5, length: float = 40.0, t_end: float = 100.0) -> Problem:
    """Return the sine-Gordon equation u_tt = u_xx - sin u, discretised.

    From u = 0, u_t = (4/gamma) sech(x/gamma): a breather for gamma > 1, the double pole
    for gamma = 1, a kink and an antikink that part for gamma < 1. Tests many unknowns with
    nearest-neighbour coupling, and stiffness as n grows.

    Parameters
    ----------
    n : int
        Number of points, at least 3; thousands are compiled as a loop.
    gamma : float
        Shape of the start, positive.
    length : float
        Length of the interval, -length/2 <= x < length/2.
    t_end : float
        End of the integration.

    Returns
    -------
    Problem
        State ``[u_0 .. u_{n-1}, u'_0 .. u'_{n-1}]``; parameter ``stiffness`` = 1/dx^2;
        invariant: energy (that of the equation divided by dx).

    Raises
    ------
    problems.errors.InputError
        For values out of range.
    """
    given.whole("sine_gordon", 3, n=n)
    given.size("sine_gordon", 2 * n, n=n)
    given.positive("sine_gordon", gamma=gamma, length=length)
    given.finite("sine_gordon", t_end=t_end)
    return Problem(
        _lattice(n, lambda u, par, m: 1 - m.cos(u), "sine_gordon"),
        q0=[0.0] * n,
        p0=[given.nearest(lambda i=i: _hump(i, n, gamma, length)) for i in range(n)],
        parameters={"stiffness": (n / length) ** 2},
        t_end=t_end,
        name="sine_gordon",
        title="the sine-Gordon equation",
        arguments={"n": n, "gamma": gamma} | changed(sine_gordon, length=length, t_end=t_end),
        references=_REFERENCES,
        notes="Many unknowns, trigonometric force; the explicit step is bounded by dx.",
    )


def _hump(i: int, n: int, gamma: float, length: float) -> Any:
    import mpmath

    x = mpmath.mpf(length) * (mpmath.mpf(i) / n - mpmath.mpf(1) / 2)
    return 4 / mpmath.mpf(gamma) * mpmath.sech(x / mpmath.mpf(gamma))


def nonlinear_wave(
    *, n: int = 128, mass: float = 1.0, kappa: float = 1.0, amplitude: float = 1.0, t_end: float = 100.0
) -> Problem:
    """Return the nonlinear Klein-Gordon equation u_tt = u_xx - mass u - kappa u^3, discretised.

    On the interval 0 <= x < 2 pi, from u = amplitude sin x, at rest. Tests exact
    conservation of a polynomial energy of degree 4 in many unknowns.

    Parameters
    ----------
    n : int
        Number of points, at least 3; thousands are compiled as a loop.
    mass, kappa : float
        Linear and cubic strength of the force.
    amplitude : float
        Of the start.
    t_end : float
        End of the integration.

    Returns
    -------
    Problem
        State ``[u_0 .. u_{n-1}, u'_0 .. u'_{n-1}]``; parameters ``stiffness`` = 1/dx^2,
        ``mass``, ``kappa``; invariant: energy (that of the equation divided by dx).

    Raises
    ------
    problems.errors.InputError
        For values out of range.
    """
    given.whole("nonlinear_wave", 3, n=n)
    given.size("nonlinear_wave", 2 * n, n=n)
    given.finite("nonlinear_wave", mass=mass, kappa=kappa, amplitude=amplitude, t_end=t_end)

    def potential(u: Any, par: Any, m: Any) -> Any:
        square = u * u
        return par.mass / 2 * square + par.kappa / 4 * (square * square)

    return Problem(
        _lattice(n, potential, "nonlinear_wave", mass=1.0, kappa=1.0),
        q0=[given.nearest(lambda i=i: _sine(i, n, amplitude)) for i in range(n)],
        p0=[0.0] * n,
        parameters={
            "stiffness": given.nearest(lambda: _inverse_square_step(n)),
            "mass": mass,
            "kappa": kappa,
        },
        t_end=t_end,
        name="nonlinear_wave",
        title="a nonlinear wave equation",
        arguments={"n": n}
        | changed(nonlinear_wave, mass=mass, kappa=kappa, amplitude=amplitude, t_end=t_end),
        references=_REFERENCES,
        notes="A polynomial energy of degree 4 in many unknowns; the explicit step is bounded by dx.",
    )


def _sine(i: int, n: int, amplitude: float) -> Any:
    import mpmath

    return mpmath.mpf(amplitude) * mpmath.sinpi(mpmath.mpf(2 * i) / n)


def _inverse_square_step(n: int) -> Any:
    import mpmath

    return (n / (2 * mpmath.pi)) ** 2
