"""HBVM(k, s) as a Runge-Kutta method: the Butcher tableau, for teaching and for tests.

The kernel never forms these matrices: it iterates on s coefficients, not on k stages.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from integrators.coefficients.legendre import tables
from integrators.protocol import Array
from problems.errors import InputError, shown

# Measured for all s <= k <= 40: the rows' sums are within 3.4e-16 of c, the weights' sum within 2.3e-16 of 1.
CONSISTENT = 1e-13


@dataclass(frozen=True, eq=False)
class Tableau:
    """A Runge-Kutta method ``Y = y0 + h A f(Y), y1 = y0 + h b' f(Y)``.

    Attributes
    ----------
    A : ndarray, shape (k, k)
        Stage coefficients.
    b, c : ndarray, shape (k,)
        Weights and nodes.
    order : int
        The order that theory claims; the tests compare it with the rooted trees.

    Raises
    ------
    ValueError
        If the rows of A do not sum to c, or b not to 1.
    """

    A: Array
    b: Array
    c: Array
    order: int

    def __post_init__(self) -> None:
        k = self.b.size
        if self.A.shape != (k, k) or self.c.shape != (k,):
            raise ValueError(
                f"A, b, c of shapes {self.A.shape}, {self.b.shape}, {self.c.shape} do not fit together."
            )
        if np.abs(self.A.sum(axis=1) - self.c).max() > CONSISTENT:
            raise ValueError("the rows of A must sum to c.")
        if abs(self.b.sum() - 1.0) > CONSISTENT:
            raise ValueError("the weights b must sum to 1.")

    def stability(self, z: ArrayLike) -> NDArray[np.complex128]:
        """Return the stability function R(z) = 1 + z b' (I - z A)^{-1} 1.

        One step of y' = lambda y multiplies y by R(h lambda). For HBVM(k, s) it is
        the diagonal Padé approximation of exp(z) of degree s, whatever k.

        Parameters
        ----------
        z : array_like
            Complex numbers, any shape.

        Returns
        -------
        ndarray of complex, shape of ``z``
        """
        try:
            points = np.asarray(z, dtype=np.complex128)
        except (TypeError, ValueError, OverflowError):
            raise InputError(f"z={shown(z)} of stability must be complex numbers.") from None
        k = self.b.size
        systems = np.eye(k) - points[..., None, None] * self.A
        ones = np.ones((*points.shape, k, 1), dtype=np.complex128)
        return 1.0 + points * (np.linalg.solve(systems, ones)[..., 0] @ self.b)


def tableau(k: int, s: int) -> Tableau:
    """Return the tableau of HBVM(k, s): ``A = I P' Omega``, of rank s.

    Parameters
    ----------
    k, s : int
        k >= s >= 1; k = s gives the Gauss-Legendre tableau.

    Raises
    ------
    problems.errors.InputError
        If not k >= s >= 1.
    """
    table = tables(k, s)
    return Tableau(
        A=table.integrals.hi @ table.projection.hi, b=table.weights.hi, c=table.nodes.hi, order=2 * s
    )
