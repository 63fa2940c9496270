"""heyoka's own model of gravitating bodies, for a system that declares them."""

from typing import Any

import numpy as np

from integrators.peers import load
from integrators.peers.gravity import masses_and_constant
from integrators.protocol import Array
from problems import targets
from problems.problem import System


def refuses(system: System, par: Array) -> str | None:
    """Return why heyoka has no model of a system's bodies, or None."""
    if system.bodies is None or system.bodies.dimension != 3:
        return "nbody=True is for bodies in space, such as problems.nbody makes; leave it out."
    if not np.all(masses_and_constant(system, par)[0] > 0.0):
        return "nbody=True needs positive masses, since the momentum of a massless body is 0; leave it out."
    return None


def equations(system: System, par: Array) -> list[Any]:
    """Return pairs of variable and right-hand side for bodies, in the system's positions and momenta.

    Parameters
    ----------
    system : System
        What moves.
    par : ndarray, shape (n_par,)
        Its parameters, which become numbers in the equations.

    Notes
    -----
    The accelerations are those of ``heyoka.model.nbody``, with the masses as numbers. heyoka's
    derivatives of its powers are cheaper than those of a square root and quotients. In momenta p = m v
    it takes fewer steps than in velocities, for its step size is relative to the largest component.
    """
    hy = load("heyoka")
    masses, G = masses_and_constant(system, par)
    variables = targets.heyoka_variables(system)
    dof = len(variables) // 2
    q, p = variables[:dof], variables[dof:]
    model = {
        str(name): value for name, value in hy.model.nbody(len(masses), masses=masses.tolist(), Gconst=G)
    }
    axes = [f"{axis}_{i}" for i in range(len(masses)) for axis in "xyz"]
    accelerations = hy.subs([model[f"v{axis}"] for axis in axes], dict(zip(axes, q, strict=True)))
    mass = np.repeat(masses, 3).tolist()
    return [
        *((x, momentum / m) for x, momentum, m in zip(q, p, mass, strict=True)),
        *((momentum, m * a) for momentum, m, a in zip(p, mass, accelerations, strict=True)),
    ]
