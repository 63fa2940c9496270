"""Starts of systems with constraints: whether they are on the manifold, and the nearest one that is."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from problems.analysis.invariants import along
from problems.analysis.sizes import with_sizes
from problems.derive.function import Function
from problems.double_double import DD
from problems.errors import InputError
from problems.systems.constrained import Constrained

Array = NDArray[np.float64]

ALLOWED = 1e-12
"""What a start may violate a constraint by, relative to the size of its terms."""
SINGULAR = 1e-13
"""Smallest eigenvalue, of the matrix with diagonal 1, of constraints that are independent."""
ROUNDING = 2.0**-53
ITERATIONS = 100
TERMS = ("constraints", "constraint_rates")


def on_manifold(system: Constrained, par: Array, t0: float, y: Array, *, project: bool) -> Array:
    """Return a start that satisfies the constraints: the one given, or the nearest one.

    The nearest positions are those with the smallest change in the metric of the kinetic energy, by
    iterations that are linear in the constraints; the momenta then have the smallest change of kinetic
    energy.

    Parameters
    ----------
    system : Constrained
        Whose constraints.
    par, t0, y
        Parameters, time and state, shape (dim,).
    project : bool
        Whether the start may be moved.

    Raises
    ------
    problems.errors.InputError
        For a start off the manifold that may not be moved, or near which there is none on it; and for
        constraints that are dependent there, which are named.
    """
    at = _At(system, par, t0)
    if project:
        nearest = at.nearest(y)
        at.check_independent(nearest)
        return nearest
    at.check_independent(y)
    for name in TERMS:
        values, sizes = at.with_sizes(name, y)
        off = np.abs(values) > ALLOWED * sizes
        if off.any():
            i = int(np.argmax(np.where(off, np.abs(values) / np.where(sizes == 0.0, 1.0, sizes), -1.0)))
            what = "is" if name == TERMS[0] else "changes at the rate"
            raise InputError(
                f"the start violates constraints[{i}], which {what} {values[i]:.3g} instead of 0; give "
                "another start, or project=True to take the nearest one."
            )
    return y


class _At:
    """Constraints and their derivatives at states."""

    def __init__(self, system: Constrained, par: Array, t0: float):
        self._system, self._par, self._t0 = system, par, t0
        self._n, self._dof = len(system.multipliers.outputs), system.dim // 2

    def _values(self, function: Function, y: Array) -> Array:
        found = along(function, self._par, DD(y[np.newaxis]), np.array([self._t0]))
        return np.array([float(value.rounded()[0]) for value in found])

    def with_sizes(self, name: str, y: Array) -> tuple[Array, Array]:
        """Return the constraints or their rates, and sizes that these are judged by.

        Those are the sums of their absolute terms; of a rate w = G u at least the bound
        ``w^2 <= (G M^-1 G') (u M u)``, as all terms vanish where other constraints allow no motion.
        """
        both = self._values(with_sizes(self._system.invariants[name]), y)
        values, sizes = both[: self._n], both[self._n :]
        if name == TERMS[1]:
            G, by_momentum = self._matrices(y)
            u = self._values(self._system.function("field").part(0, self._dof), y)
            energy = np.abs(u * y[self._dof :]).sum()
            sizes = np.maximum(sizes, np.sqrt(np.abs((by_momentum * G).sum(axis=1)) * energy))
        return values, sizes

    def _slopes(self, name: str, y: Array) -> Array:
        slopes = self._system.slopes(name)
        matrix = np.zeros(slopes.shape)
        matrix[slopes.rows, slopes.columns] = self._values(slopes.function, y)
        return matrix

    def _matrices(self, y: Array) -> tuple[Array, Array]:
        """Return G and dw/dp."""
        return self._slopes(TERMS[0], y)[:, : self._dof], self._slopes(TERMS[1], y)[:, self._dof :]

    def check_independent(self, y: Array) -> None:
        """Raise for constraints of which some follow from others."""
        G, by_momentum = self._matrices(y)
        matrix = by_momentum @ G.T
        scale = np.sqrt(np.abs(np.diagonal(matrix)))
        none = np.flatnonzero(~(scale > 0.0))
        if none.size:
            raise InputError(
                f"constraints[{none[0]}] moves nothing at the start, as its derivatives vanish there; write "
                "it in another form, or leave it out."
            )
        values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
        if not values[0] > SINGULAR:
            share = np.abs(vectors[:, 0])
            names = [f"constraints[{i}]" for i in np.flatnonzero(share > 1e-3 * share.max())]
            raise InputError(
                f"{_listed(names)} are dependent at the start: each follows from the others; leave one out."
            )

    def nearest(self, y: Array) -> Array:
        """Return the nearest state on the manifold."""
        dof, at = self._dof, y.copy()
        for name in TERMS:
            error = last = np.inf
            largest = np.zeros(self._n)
            for _ in range(ITERATIONS):
                values, sizes = self.with_sizes(name, at)
                G, by_momentum = self._matrices(at)
                largest = np.maximum(largest, sizes)
                error = float(np.max(np.abs(values) / np.where(largest == 0.0, 1.0, largest)))
                if error <= ROUNDING or last <= error <= ALLOWED:
                    break
                last = error
                if name == TERMS[0]:
                    right = values + G @ (y[:dof] - at[:dof])
                    moved = y[:dof] - by_momentum.T @ self._solved(by_momentum @ G.T, right)
                    at = np.concatenate([moved, at[dof:]])
                else:
                    moved = at[dof:] - G.T @ self._solved(by_momentum @ G.T, values)
                    at = np.concatenate([at[:dof], moved])
            else:
                raise InputError(
                    f"no state on the constraints was found near the start in {ITERATIONS} iterations (the "
                    f"largest violation is {error:.1e}); give a start that is nearer."
                )
        return at

    def _solved(self, matrix: Array, right: Array) -> Array:
        if not np.isfinite(matrix).all():
            raise InputError("constraints are not finite near the start; give another start.")
        return np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0], dtype=np.float64)


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]
