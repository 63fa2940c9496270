"""Simplified Newton for the stage equations of a function in Python, and the Jacobian that it needs."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.integrate import OdeSolver
from scipy.linalg import lu_factor, lu_solve
from scipy.sparse.linalg import splu

from integrators.coefficients.legendre import x_matrix
from integrators.kernel.implicit.groups import SMALL, STEP, groups
from problems.errors import InputError

Array = NDArray[Any]


class Newton:
    """Simplified Newton for the stage equations: ``I - h X_s x J``, after diagonalising X_s.

    X_s has conjugate pairs of eigenvalues, so a real problem takes ceil(s/2)
    factorisations of size n, a complex one s.

    Parameters
    ----------
    solver : OdeSolver
        Whose equations they are; its ``njev`` and ``nlu`` count.
    s : int
        Degree.
    jac : None, array_like, sparse matrix or callable
        As for `scipy.integrate.Radau`; ``None``: by differences.
    sparsity : None, array_like or sparse matrix
        As ``jac_sparsity`` of `scipy.integrate.Radau`.

    Attributes
    ----------
    constant : bool
        Whether the user gave the Jacobian as a matrix.
    current : bool
        Whether the Jacobian in use is that of the present state.
    old : bool
        Whether there is none, or it is to be replaced.

    Raises
    ------
    problems.errors.InputError
        If ``jac`` or ``sparsity`` has another shape than (n, n).
    """

    def __init__(self, solver: OdeSolver, s: int, jac: Any, sparsity: Any) -> None:
        self._solver, self._given = solver, jac
        self.constant, self.current, self.old = jac is not None and not callable(jac), False, True
        if self.constant:
            self._given = self._checked(jac, "jac")
        self._pattern: Any = None
        if jac is None and sparsity is not None:
            self._pattern = sparse.coo_matrix(self._checked(sparsity, "jac_sparsity"))
        values, vectors = np.linalg.eig(x_matrix(s))
        inverse = np.linalg.inv(vectors)
        self._radius = float(np.abs(values).max())
        if not np.iscomplexobj(solver.y):
            # One of each pair; a pair's two terms are conjugate, so it counts twice.
            kept = np.imag(values) >= 0.0
            values, inverse = values[kept], inverse[kept]
            vectors = vectors[:, kept] * np.where(np.imag(values) > 0.0, 2.0, 1.0)
        self._values, self._vectors, self._inverse = values, vectors, inverse
        self._J: Any = None
        self._size = self._h = 0.0
        self._solvers: list[Callable[[Array], Array]] = []

    def linearize(self, t: float, y: Array, f: Array, h: float) -> None:
        """Take the Jacobian at a state, given f there and the length of the step."""
        if self.constant:
            self._J = self._given
        else:
            self._solver.njev += 1
            given = self._given
            self._J = self._differences(t, y, f, h) if given is None else self._checked(given(t, y), "jac")
        magnitude = abs(self._J)
        # A bound of the spectral radius: the smaller of the matrix's two simplest norms.
        self._size = float(min(magnitude.sum(axis=0).max(), magnitude.sum(axis=1).max()))
        self._h, self.current, self.old = 0.0, True, False

    def stiffness(self, h: float) -> float:
        """Return a bound of how a fixed-point iteration in a step of length h would multiply errors."""
        return abs(h) * self._size * self._radius

    def factorize(self, h: float) -> None:
        """Factorise for steps of length h, unless that was done last."""
        if h != self._h:
            self._h, self._solvers = h, [self._factorized(h * z) for z in self._values.tolist()]

    def correct(self, residual: Array) -> Array:
        """Return the correction of the coefficients for a residual (s, n)."""
        parts = self._inverse @ residual
        parts = np.array([solve(part) for solve, part in zip(self._solvers, parts, strict=True)])
        change = self._vectors @ parts
        return change if np.iscomplexobj(residual) else np.real(change)

    def _factorized(self, z: complex) -> Callable[[Array], Array]:
        """Return what solves with the matrix ``I - z J``."""
        self._solver.nlu += 1
        if sparse.issparse(self._J):
            # SuperLU works in the matrix's own type, so a complex right-hand side needs a complex matrix.
            unit = sparse.identity(self._solver.n, format="csc")
            return splu(sparse.csc_matrix(unit - z * self._J, dtype=complex)).solve
        factors = lu_factor(np.identity(self._solver.n) - z * self._J, check_finite=False)
        return lambda b: lu_solve(factors, b, check_finite=False)

    def _differences(self, t: float, y: Array, f: Array, h: float) -> Any:
        """Return the Jacobian by differences: of one column each, or of all columns of a group."""
        groups = self._groups
        largest = np.abs(y).max()
        size = np.maximum(np.abs(y), np.maximum(SMALL * largest, np.minimum(np.abs(h * f), largest)))
        width = y + STEP * np.where(size > 0.0, size, 1.0) - y
        members = groups[:, np.newaxis] == np.arange(groups.max() + 1)
        moved = y[:, np.newaxis] + members * width[:, np.newaxis]
        change = self._solver.fun_vectorized(t, moved) - f[:, np.newaxis]
        if self._pattern is None:
            return change / width
        i, j = self._pattern.row, self._pattern.col
        return sparse.csc_matrix((change[i, groups[j]] / width[j], (i, j)), shape=self._pattern.shape)

    @cached_property
    def _groups(self) -> NDArray[np.intp]:
        n, pattern = self._solver.n, self._pattern
        return np.arange(n) if pattern is None else groups(pattern.row, pattern.col, n)

    def _checked(self, matrix: Any, name: str) -> Any:
        kind, n = self._solver.y.dtype, self._solver.n
        checked = (sparse.csc_matrix if sparse.issparse(matrix) else np.asarray)(matrix, dtype=kind)
        if checked.shape != (n, n):
            raise InputError(
                f"`{name}` is expected to have shape {(n, n)}, but actually has {checked.shape}."
            )
        return checked
