"""A Klein-Gordon equation with a cubic force on a periodic interval, discretised as `_waves` says."""

from typing import Any

from problems.catalogue import _given as given
from problems.catalogue import _waves as waves
from problems.problem import Problem
from problems.registry import changed


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
        waves.hamiltonian(n, potential, "nonlinear_wave", mass=1.0, kappa=1.0),
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
        references=waves.REFERENCES,
        notes="A polynomial energy of degree 4 in many unknowns; the explicit step is bounded by dx.",
    )


def _sine(i: int, n: int, amplitude: float) -> Any:
    import mpmath

    return mpmath.mpf(amplitude) * mpmath.sinpi(mpmath.mpf(2 * i) / n)


def _inverse_square_step(n: int) -> Any:
    import mpmath

    return (n / (2 * mpmath.pi)) ** 2
