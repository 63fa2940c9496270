"""Duffing's oscillator without friction: a particle in a double well.

H(q, p) = p^2/2 - q^2/2 + q^4/4
"""

import math

from problems import Hamiltonian, InputError, Problem


def _energy(q, p):
    return p[0] ** 2 / 2 - q[0] ** 2 / 2 + q[0] ** 4 / 4


def duffing(*, energy: float = 0.05, t_end: float = 200.0) -> Problem:
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
    if not isinstance(energy, int | float) or isinstance(energy, bool) or not 0 < energy < math.inf:
        raise InputError(f"energy={energy!r} of duffing must be a positive number.")
    return Problem(
        Hamiltonian(_energy, dof=1, name="duffing"),
        q0=[0.0],
        p0=[math.sqrt(2 * energy)],
        t_end=t_end,
        name="duffing",
        title="Duffing's double well",
        arguments={"energy": energy, "t_end": t_end},
        references=("G. Duffing, Erzwungene Schwingungen bei veraenderlicher Eigenfrequenz (1918)",),
        notes="An example from a package of its own.",
    )
