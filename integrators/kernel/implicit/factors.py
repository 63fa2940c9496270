"""Factors of large matrices, kept by SciPy and asked for by compiled code."""

import ctypes
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Complex = NDArray[np.complex128]

FACTORIZE, SOLVE = range(2)
"""What is asked of the function at `Factors.address`."""

DENSE = 0.3  # part of the entries that are stored from which a matrix is treated as dense


class Matrices(Protocol):
    """What of a solver's memory `Factors` works on; see `integrators.kernel.implicit.workspace`."""

    entry_rows: Any
    entry_columns: Any
    entries: Any
    factor: Any
    state: Any
    copies: Any
    b: Any


class Factors:
    """Factors of I - z_i h J for all pairs of eigenvalues z_i, sparse or dense.

    Parameters
    ----------
    arrays : Matrices
        The solver's memory.
    values : ndarray of complex
        The eigenvalues; in the second-order form, where the matrices are I - z_i^2 h^2 J diag(q'/p), their
        squares. A single one is real.

    Attributes
    ----------
    address : int
        Of the C function ``int64(operation, group)`` that works on it.
    calls_back : bool
        True: it is a function of Python's.
    error : BaseException or None
        What went wrong last in a call, which compiled code takes for a failure.
    """

    calls_back = True

    def __init__(self, arrays: Matrices, values: Complex):
        self._arrays, self._values = arrays, values
        rows, columns = arrays.entry_rows, arrays.entry_columns
        n = arrays.state.size
        self._size = n
        self._solvers: list[Any] = []
        self.error: BaseException | None = None
        self._dense = rows.size > DENSE * n * n
        if not self._dense:
            self._pattern = _Pattern(rows, columns, n)
        self._callback = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)(self._called)
        self.address: int = ctypes.cast(self._callback, ctypes.c_void_p).value or 0

    def _called(self, operation: int, group: int) -> int:
        try:
            if operation == FACTORIZE:
                self._factorize()
            else:
                self._solve(group)
        except BaseException as error:  # nothing may be raised through compiled code
            self.error = error
            return 0
        return 1

    def _factorize(self) -> None:
        a = self._arrays
        slopes = a.entries * a.factor[a.entry_columns]
        if not np.isfinite(slopes).all():
            raise FloatingPointError("the Jacobian is not finite")
        self._solvers = []
        for value in self._values:
            real = value.imag == 0.0
            factor = -value.real if real else -value
            self._solvers.append(self._factors(factor * slopes))

    def _factors(self, entries: Complex) -> Any:
        if self._dense:
            from scipy.linalg import lu_factor, lu_solve

            matrix = np.eye(self._size, dtype=entries.dtype)
            matrix[self._arrays.entry_rows, self._arrays.entry_columns] += entries
            factors = lu_factor(matrix, overwrite_a=True, check_finite=False)
            return lambda x: lu_solve(factors, x, check_finite=False)
        from scipy.sparse.linalg import splu

        return splu(self._pattern.matrix(entries), permc_spec=self._pattern.order).solve

    def _solve(self, group: int) -> None:
        """Replace eight vectors, real parts and then imaginary parts, by what their matrices make of them."""
        both, n = self._arrays.b.reshape(2, -1, 8), self._size
        for first in range(0, n * self._arrays.copies, n):
            self._solve_copy(group, *both[:, first : first + n])

    def _solve_copy(self, group: int, x: Any, y: Any) -> None:
        if len(self._solvers) == 1 and self._values[0].imag == 0.0:  # all belong to the one matrix
            solution = self._solvers[0](np.concatenate([x, y], axis=1))
            x[:], y[:] = solution[:, :8], solution[:, 8:]
            return
        for lane, pair in enumerate(range(8 * group, min(8 * group + 8, len(self._solvers)))):
            solve, real = self._solvers[pair], self._values[pair].imag == 0.0
            if real:
                solution = solve(np.stack([x[:, lane], y[:, lane]], axis=1))
                x[:, lane], y[:, lane] = solution[:, 0], solution[:, 1]
            else:
                solution = solve(x[:, lane] + 1j * y[:, lane])
                x[:, lane], y[:, lane] = solution.real, solution.imag


class _Pattern:
    """Where the entries of I + a J go in a matrix stored by columns."""

    def __init__(self, rows: Any, columns: Any, n: int):
        diagonal = np.arange(n)
        flat = np.concatenate([columns * n + rows, diagonal * (n + 1)])
        positions, where = np.unique(flat, return_inverse=True)
        self._entries, self._diagonal = where[: rows.size], where[rows.size :]
        self._indices = (positions % n).astype(np.int32)
        self._starts = np.searchsorted(positions, np.arange(n + 1) * n).astype(np.int32)
        self._n = n
        # An ordering for A^T + A fills in half as much where the pattern is that of a symmetric matrix.
        transposed = np.unique((positions % n) * n + positions // n)
        self.order = "MMD_AT_PLUS_A" if np.array_equal(transposed, positions) else "COLAMD"

    def matrix(self, entries: Any) -> Any:
        """Return I plus the entries as a sparse matrix."""
        from scipy.sparse import csc_matrix

        data = np.zeros(self._indices.size, dtype=entries.dtype)
        data[self._entries] = entries
        data[self._diagonal] += 1.0
        return csc_matrix((data, self._indices, self._starts), shape=(self._n, self._n))
