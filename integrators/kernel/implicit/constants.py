"""What the implicit solver takes from HBVM(k, s): stage tables, and X_s by its eigenvectors."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from integrators.kernel.implicit.memory import BLENDED
from integrators.kernel.native import binary, store
from integrators.kernel.tables import Constants, constants

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

MOST_EIGENVECTORS = 22  # degree up to which X_s has usable eigenvectors: their condition number is 1e12 there
LOW = 3


@dataclass(frozen=True, eq=False)
class Method:
    """HBVM(k, s) for an implicit solver.

    Attributes
    ----------
    shared : Constants
        The kernel's own.
    integrals : ndarray, shape (k, s)
        Coefficients to stages.
    integrals_low : ndarray, shape (k, min(s, 3))
        What rounding took from the first columns.
    basis : ndarray, shape (k, s)
        ``P_j(c_l)``.
    eigenvalues : ndarray of complex, shape (p,)
        Of X_s, one of each pair of conjugates; for blended iteration, rho.
    left, right : ndarray of complex, shapes (p, s), (s, p)
        ``f(X_s) = Re(right diag(f(eigenvalues)) left)`` for any real function f.
    x, inverse : ndarray, shape (s, s)
        ``X_s`` and ``X_s^{-1}``.
    radius : float
        Spectral radius of X_s (of X_s^2 in the second-order form).
    """

    shared: Constants
    integrals: Array
    integrals_low: Array
    basis: Array
    eigenvalues: Complex
    left: Complex
    right: Complex
    x: Array
    inverse: Array
    radius: float


def solver_of(s: int, wanted: int) -> int:
    """Return the kind of correction that degree s allows: beyond `MOST_EIGENVECTORS` it is blended."""
    return wanted if s <= MOST_EIGENVECTORS else BLENDED


@lru_cache(maxsize=64)
def method(k: int, s: int, second: bool, lanes: int, kind: int) -> Method:
    """Return the constants of HBVM(k, s) for corrections of a kind, `NEWTON` or `BLENDED`."""
    integrals, low, basis, x = _tables(k, s)
    values, vectors = (array.astype(np.complex128) for array in np.linalg.eig(x))
    if kind == BLENDED:
        left = np.zeros((1, s), dtype=np.complex128)
        eigenvalues, right = np.array([np.abs(values).min() + 0j]), left.T
    else:
        # Real up to rounding: the one eigenvalue of odd degree that has no conjugate.
        alone = np.abs(values.imag) < 1e-12 * np.abs(values)
        upper = alone | (values.imag > 0.0)
        eigenvalues = np.where(alone, values.real + 0j, values)[upper]
        left = np.linalg.inv(vectors)[upper].astype(np.complex128)
        right = vectors[:, upper] * np.where(alone, 1.0, 2.0)[upper]
    inverse = np.linalg.inv(x).astype(np.float64)
    radius = float(np.abs(values).max()) ** (2 if second else 1)
    return Method(
        constants(k, s, second, lanes), integrals, low, basis, eigenvalues, left, right, x, inverse, radius
    )


@lru_cache(maxsize=64)
def _tables(k: int, s: int) -> tuple[Array, Array, Array, Array]:
    """Return integrals, the low parts of their first columns, the basis and X_s, kept on disk."""
    shapes = [(k, s), (k, min(LOW, s)), (k, s), (s, s)]

    def make() -> list[Array]:
        from integrators.coefficients import legendre  # 50 digits, which take their time to be imported

        t = legendre.tables(k, s)
        return [t.integrals.hi, t.integrals.lo[:, : min(LOW, s)], t.basis.hi, t.x.hi]

    name = store.key("implicit", f"{k} {s}", binary.sources(__name__))
    integrals, low, basis, x = store.arrays(name, shapes, make)
    return integrals, low, basis, x
