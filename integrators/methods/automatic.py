"""Which HBVM(k, s) a tolerance calls for: the choice of `integrators.HBVM` without k and s."""

import math

from problems.analysis.structure import degree
from problems.systems.base import System

FEW, MANY = 8, 16
"""Stages that the field takes at a time: fewer cost as much."""

SPARE = 2
"""Nodes that are left over for the estimates."""

HIGHEST = MANY - SPARE
"""The highest degree."""

DEFECT = 3e-17
"""Largest error allowed to a step's quadrature, as the last coefficient that k nodes see estimates it.

The error itself is much smaller than this estimate."""


def exact_k(nu: int, s: int) -> int:
    """Return the least k with which HBVM(k, s) keeps a polynomial energy of degree nu exactly.

    ``k >= nu s/2`` makes the line integral exact (L. Brugnano, F. Iavernaro, T.
    Susca, "Numerical comparisons between Gauss-Legendre methods and Hamiltonian
    BVMs defined over Gauss points"); never less than s.

    Parameters
    ----------
    nu, s : int
        Degree of the energy, and of the method's polynomial.
    """
    return max(s, -(-nu * s // 2))


def choose(system: System, tol: float) -> tuple[int, int, float | None]:
    """Return k, s and what the quadrature's error is bounded by.

    With as many stages as the processor takes at a time, a higher degree costs nothing.
    But where Legendre coefficients fall off geometrically, a step at which gamma_s
    meets the tolerance, ``|gamma_s|^2 = tol``, leaves a quadrature error of about
    ``tol^(k/s)``: s is as high as this permits. A polynomial energy of degree nu is
    conserved exactly by k >= nu s/2 nodes, which may be fewer, and needs no bound.

    Parameters
    ----------
    system : System
        What to integrate.
    tol : float
        Local error per step.

    Returns
    -------
    k, s : int
        Of HBVM(k, s).
    defect : float or None
        Bound on the estimated error of a step's quadrature; ``None``: it is 0, or there is no
        energy to keep.
    """
    s = max(2, min(HIGHEST, math.ceil(HIGHEST * math.log(tol) / math.log(DEFECT))))
    if system.energy is None:
        return MANY, s, None
    nu = degree(system)
    if nu is not None:
        for k in (FEW, MANY):
            if k >= s + SPARE and exact_k(nu, s) <= k:
                return k, s, None
    return MANY, s, DEFECT
