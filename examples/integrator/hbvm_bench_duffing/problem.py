"""Duffing's oscillator without friction: a particle in a double well.

H(q, p) = p^2/2 - q^2/2 + q^4/4
"""

import math

from problems import Hamiltonian, Problem
from problems.checks import Positive
from problems.entry import entry
from problems.picture import Phase


def _energy(q, p):
    return p[0] ** 2 / 2 - q[0] ** 2 / 2 + q[0] ** 4 / 4


@entry(
    title="Duffing's double well",
    references=("G. Duffing, Erzwungene Schwingungen bei veraenderlicher Eigenfrequenz (1918)",),
    notes="An example from a package of its own.",
    shows=("energy",),
    picture=Phase(span=40.0),
)
def duffing(*, energy: Positive = 0.05, t_end: float = 200.0) -> Problem:
    """Return Duffing's oscillator, started at the top between its wells.

    Tests the passage near a saddle; the energy is a polynomial of degree 4.

    Parameters
    ----------
    energy : float
        Value of H, above 0; the orbit then visits both wells.
    t_end : float
        End of the integration.

    Raises
    ------
    problems.errors.InputError
        If the energy is not positive.
    """
    system = Hamiltonian(_energy, dof=1, name="duffing")
    return Problem(system, q0=[0.0], p0=[math.sqrt(2 * energy)], t_end=t_end)
