"""The sine-Gordon equation on a periodic interval, discretised in space as `_waves` says."""

from typing import Annotated

from problems import limits
from problems.catalogue import _starts as starts
from problems.catalogue import _waves as waves
from problems.checks import Positive, at_least
from problems.entry import Expected, entry
from problems.picture import Lattice
from problems.problem import Problem


@entry(
    title="the sine-Gordon equation",
    references=waves.REFERENCES,
    notes="Many unknowns, trigonometric force; the explicit step is bounded by dx.",
    shows=("n", "gamma"),
    picture=Lattice(span=40.0, points=300),
    expected=Expected(h=0.2, energy=5e-16, default=2e-16, small={"n": 8}),
)
def sine_gordon(
    *,
    n: Annotated[int, at_least(3)] = 200,
    gamma: Positive = 1.5,
    length: Positive = 40.0,
    t_end: float = 100.0,
) -> Problem:
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
    """
    limits.check_problem("sine_gordon", 2 * n, n=n)

    def hump(mp):
        places = [length * (mp.mpf(i) / n - 0.5) for i in range(n)]
        return [4 / mp.mpf(gamma) * mp.sech(x / gamma) for x in places]

    system = waves.hamiltonian(
        n, lambda u, par, m: 1 - m.cos(u), "sine_gordon", stiffness=(n / length) * (n / length)
    )
    return Problem(system, q0=[0.0] * n, p0=starts.nearest(hump), t_end=t_end)
