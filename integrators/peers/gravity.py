"""What a system of bodies says of itself to libraries that have Newton's attraction built in."""

import numpy as np

from integrators.protocol import Array
from problems.errors import InputError
from problems.problem import System

AGREES = 1e-9
"""Relative difference up to which Newton's attraction is the system's own vector field."""


def masses_and_constant(system: System, par: Array) -> tuple[Array, float]:
    """Return the masses of a system's bodies and the constant of gravitation, for one set of parameters."""
    bodies = system.bodies
    if bodies is None:
        raise InputError(f"{system.name} declares no bodies; see problems.Bodies.")
    values, G = system.unpack(par), bodies.G
    return np.asarray(values[bodies.masses]), float(values[G] if isinstance(G, str) else G)


def check_gravity(system: System, par: Array, t: float, y: Array) -> None:
    """Refuse a system whose forces are not the attraction of the bodies that it declares.

    Raises
    ------
    problems.errors.InputError
        Where they differ, in the state ``y`` of shape (dim,) at the time ``t``.
    """
    from problems import targets

    masses, G = masses_and_constant(system, par)
    dof = system.dim // 2
    x = y[:dof].reshape(masses.size, -1)
    apart = x[np.newaxis] - x[:, np.newaxis]
    cubed = np.sum(apart**2, axis=2) ** 1.5
    np.fill_diagonal(cubed, np.inf)
    with np.errstate(all="ignore"):
        theirs = G * masses[:, np.newaxis] * np.sum((masses / cubed)[..., np.newaxis] * apart, axis=1)
    ours = targets.numpy(system, "field")(t, y, par)[dof:]
    if not np.allclose(
        theirs.ravel(), ours, rtol=0.0, atol=AGREES * float(np.max(np.abs(ours))), equal_nan=True
    ):
        raise InputError(
            f"{system.name} declares bodies, but its forces are not their gravity; "
            "leave out bodies= to have its own vector field integrated."
        )
