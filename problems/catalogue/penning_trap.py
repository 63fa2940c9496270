"""A charged particle in a Penning trap.

    H(q, p) = |p - A(q)|^2/2 + phi(q),   unit mass and charge

with B = omega_c and the quadrupole phi = omega_z^2/2 (z^2 - (x^2 + y^2)/2), plus an
octupole c4 (z^4 - 3 z^2 (x^2 + y^2) + 3/8 (x^2 + y^2)^2).
"""

from problems.checks import Positive
from problems.entry import Expected, entry
from problems.errors import InputError
from problems.picture import Plane
from problems.problem import Problem
from problems.systems.hamiltonian import Hamiltonian


def _energy(q, p, par):
    x, y, z = q
    u, v = p[0] + par.omega_c * y / 2, p[1] - par.omega_c * x / 2
    rho, z2 = x * x + y * y, z * z
    kinetic = (u * u + v * v + p[2] * p[2]) / 2
    quadrupole = par.omega_z**2 / 2 * (z2 - rho / 2)
    return kinetic + quadrupole + par.c4 * (z2 * z2 - 3 * z2 * rho + 0.375 * (rho * rho))


@entry(
    title="a Penning trap",
    references=("L. S. Brown, G. Gabrielse, Geonium theory, Reviews of Modern Physics 58 (1986) 233-311",),
    notes="Three widely spaced frequencies; not separable; polynomial of degree 4.",
    picture=Plane(labels=("x", "y"), span=80.0, points=3000),
    expected=Expected(h=0.2, energy=4e-15, default=7e-14),
)
def penning_trap(
    *,
    omega_c: Positive = 5.0,
    omega_z: Positive = 1.0,
    c4: float = 0.01,
    t_end: float = 500.0,
) -> Problem:
    """Return a charged particle in a Penning trap.

    Tests three widely spaced frequencies in a Hamiltonian that is not separable:
    modified cyclotron, axial and magnetron motion, the last around a potential
    hill. With ``c4=0`` the system is linear and every Gauss method keeps its energy too.

    Parameters
    ----------
    omega_c, omega_z : float
        Cyclotron and axial frequency; the trap holds for omega_c^2 > 2 omega_z^2.
    c4 : float
        Strength of the octupole, which makes the energy a polynomial of degree 4.
    t_end : float
        End of the integration.

    Returns
    -------
    Problem
        State ``[x, y, z, p_x, p_y, p_z]``, from (1, 0, 1) with the velocity (0, 0.1, 0);
        parameters as named; invariants: energy, canonical angular momentum about the axis.

    Raises
    ------
    problems.errors.InputError
        For frequencies that do not hold the particle.
    """
    if omega_c * omega_c <= 2 * omega_z * omega_z:
        raise InputError(
            f"omega_c={omega_c!r} of penning_trap does not hold the particle; "
            f"it must exceed sqrt(2)*omega_z, omega_z={omega_z!r}."
        )
    system = Hamiltonian(
        _energy,
        dof=3,
        parameters={"omega_c": omega_c, "omega_z": omega_z, "c4": c4},
        invariants={"angular_momentum": lambda q, p: q[0] * p[1] - q[1] * p[0]},
        name="penning_trap",
    )
    return Problem(system, q0=[1.0, 0.0, 1.0], p0=[0.0, 0.1 + omega_c / 2, 0.0], t_end=t_end)
