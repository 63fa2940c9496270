"""Factors of large matrices, kept by SciPy and asked for by compiled code."""

import ctypes
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from integrators.kernel.engines import triangular
from integrators.kernel.implicit.memory import FACTORIZE
from integrators.kernel.native.memory import aligned

Complex = NDArray[np.complex128]

DENSE = 0.3  # part of the entries that are stored from which a matrix is treated as dense


def is_dense(entries: int, n: int) -> bool:
    """Whether a matrix of n rows with so many entries is factored as a dense one."""
    return entries > DENSE * n * n


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
        self._one_real = len(values) == 1 and values[0].imag == 0.0
        self.error: BaseException | None = None
        self._dense = is_dense(rows.size, n)
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
            if not self._one_real:
                return lambda x: lu_solve(factors, x, check_finite=False)

            def solve(x: Any) -> None:
                x[:] = lu_solve(factors, x, check_finite=False)

            return solve
        from scipy.sparse.linalg import splu

        factors = splu(self._pattern.matrix(entries), permc_spec=self._pattern.order)
        return Triangular(factors) if self._one_real else factors.solve

    def _solve(self, group: int) -> None:
        """Replace eight vectors, real parts and then imaginary parts, by what their matrices make of them."""
        both, n = self._arrays.b.reshape(2, -1, 8), self._size
        for first in range(0, n * self._arrays.copies, n):
            self._solve_copy(group, *both[:, first : first + n])

    def _solve_copy(self, group: int, x: Any, y: Any) -> None:
        if self._one_real:  # all belong to the one matrix
            for vectors in (x, y):
                if vectors.any():  # an odd number of groups leaves nothing for the last one's second half
                    self._solvers[0](vectors)
            return
        for lane, pair in enumerate(range(8 * group, min(8 * group + 8, len(self._solvers)))):
            solve, real = self._solvers[pair], self._values[pair].imag == 0.0
            if real:
                solution = solve(np.stack([x[:, lane], y[:, lane]], axis=1))
                x[:, lane], y[:, lane] = solution[:, 0], solution[:, 1]
            else:
                solution = solve(x[:, lane] + 1j * y[:, lane])
                x[:, lane], y[:, lane] = solution.real, solution.imag


class Triangular:
    """The sparse factors of a real matrix, which replace eight vectors by the solutions.

    SuperLU's own solution for several vectors calls BLAS, whose threads cost more than they save.
    """

    def __init__(self, factors: Any) -> None:
        lower, upper = (part.tocsr() for part in (factors.L, factors.U))
        for part in (lower, upper):
            part.sort_indices()
        n = factors.shape[0]
        diagonal = upper.indptr[:-1]
        upper.data[diagonal] = 1.0 / upper.data[diagonal]
        self._kept = [
            array.astype(np.int64) if array.dtype.kind == "i" else array
            for part in (lower, upper)
            for array in (part.indptr, part.indices, part.data)
        ]
        self._kept += [np.argsort(factors.perm_r), factors.perm_c.astype(np.int64), aligned(8 * n)]
        self._words = [n, *(array.ctypes.data for array in self._kept)]

    def __call__(self, vectors: Any) -> None:
        """Replace vectors, shape (n, 8), by the solutions."""
        *words, scratch = self._words
        triangular(*words, vectors.ctypes.data, scratch)


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
