"""A Klein-Gordon equation with a cubic force on a periodic interval, discretised as `_waves` says."""

from typing import Annotated

from problems import limits
from problems.catalogue import _starts as starts
from problems.catalogue import _waves as waves
from problems.checks import at_least
from problems.entry import Expected, entry
from problems.picture import Lattice
from problems.problem import Problem


@entry(
    title="a nonlinear wave equation",
    references=waves.REFERENCES,
    notes="A polynomial energy of degree 4 in many unknowns; the explicit step is bounded by dx.",
    shows=("n",),
    picture=Lattice(span=30.0, points=300),
    expected=Expected(h=0.02, energy=1e-15, default=2e-16, small={"n": 8}),
)
def nonlinear_wave(
    *,
    n: Annotated[int, at_least(3)] = 128,
    mass: float = 1.0,
    kappa: float = 1.0,
    amplitude: float = 1.0,
    t_end: float = 100.0,
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
    """
    limits.check_problem("nonlinear_wave", 2 * n, n=n)

    def potential(u, par, m):
        square = u * u
        return par.mass / 2 * square + par.kappa / 4 * (square * square)

    [stiffness] = starts.nearest(lambda mp: [(n / (2 * mp.pi)) ** 2])
    system = waves.hamiltonian(n, potential, "nonlinear_wave", stiffness=stiffness, mass=mass, kappa=kappa)
    sine = starts.nearest(lambda mp: [amplitude * mp.sinpi(mp.mpf(2 * i) / n) for i in range(n)])
    return Problem(system, q0=sine, p0=[0.0] * n, t_end=t_end)
