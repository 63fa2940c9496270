"""The Jacobian of a function in Python: as the user gives it, or by SciPy's finite differences."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.integrate._ivp.common import num_jac
from scipy.linalg import lu_factor, lu_solve
from scipy.optimize._numdiff import group_columns
from scipy.sparse import linalg as sparse_linalg

from problems.errors import InputError

Array = NDArray[Any]


class Jacobian:
    """df/dy at a state, dense or sparse, with counters and factorisations.

    Parameters
    ----------
    fun : callable
        ``fun(t, y (n, m)) -> (n, m)``, for finite differences.
    n : int
        Length of the state.
    dtype : type
        float or complex.
    threshold : float or ndarray
        Size below which components of the state count as this, for finite differences.
    given : None, array_like, sparse matrix or callable
        As ``jac`` of `scipy.integrate.solve_ivp`.
    sparsity : None, array_like or sparse matrix
        As ``jac_sparsity`` of `scipy.integrate.solve_ivp`.

    Attributes
    ----------
    evaluations, factorizations : int
        Counters.
    """

    def __init__(
        self, fun: Callable[..., Array], n: int, dtype: type, threshold: Any, given: Any, sparsity: Any
    ) -> None:
        self.evaluations = self.factorizations = 0
        self._fun, self._n, self._dtype, self._threshold = fun, n, dtype, threshold
        self._given = given
        self._factor: Array | None = None
        self._sparsity: Any = None
        self._matrix: Any = None
        if given is None:
            if sparsity is not None:
                pattern = sparse.csc_matrix(sparsity) if sparse.issparse(sparsity) else np.asarray(sparsity)
                self._sparsity = (sparse.csc_matrix(sparsity), group_columns(pattern))
        elif not callable(given):
            self._matrix = self._checked(given)

    @property
    def constant(self) -> bool:
        """Whether the user gave a matrix."""
        return self._given is not None and not callable(self._given)

    def __call__(self, t: float, y: Array, f: Array) -> Any:
        """Return the matrix at a state, given f there."""
        if self.constant:
            return self._matrix
        self.evaluations += 1
        if self._given is not None:
            return self._checked(self._given(t, y))
        J, self._factor = num_jac(self._fun, t, y, f, self._threshold, self._factor, self._sparsity)
        return J

    def factorize(self, J: Any, z: complex) -> Callable[[Array], Array]:
        """Return what solves with the matrix ``I - z J``."""
        self.factorizations += 1
        if sparse.issparse(J):
            # SuperLU works in the matrix's own type, so a complex right-hand side needs a complex matrix.
            matrix = sparse.csc_matrix(sparse.identity(self._n, format="csc") - z * J, dtype=complex)
            return sparse_linalg.splu(matrix).solve
        factors = lu_factor(np.identity(self._n) - z * J, check_finite=False)
        return lambda b: lu_solve(factors, b, check_finite=False)

    def _checked(self, matrix: Any) -> Any:
        if sparse.issparse(matrix):
            matrix = sparse.csc_matrix(matrix, dtype=self._dtype)
        else:
            matrix = np.asarray(matrix, dtype=self._dtype)
        if matrix.shape != (self._n, self._n):
            raise InputError(
                f"`jac` is expected to have shape {(self._n, self._n)}, but actually has {matrix.shape}."
            )
        return matrix


def size(J: Any) -> float:
    """Return a bound of the matrix's spectral radius: the smaller of its two simplest norms."""
    magnitude = abs(J)
    return float(min(magnitude.sum(axis=0).max(), magnitude.sum(axis=1).max()))
