"""Which of several invariants are independent of each other along a trajectory."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from integrators.kernel.line.pattern import Pattern
from integrators.protocol import Array
from problems import targets
from problems.problem import System

SHIFT = 3e-3  # of the time in which the state changes by its own size: how far the neighbours are
DEPENDENT = 1e-9  # what is left of a gradient, relative to it, when it depends on others
# The first of the invariants is taken whose remainder is no smaller than this part of the largest
NEARLY = 0.1
DAMPING, TIMES = 1e-14, 3  # of the diagonal; how often what is left is solved for again


def independent(
    system: System,
    quantity: targets.Quantity,
    pattern: Pattern,
    metric: Array,
    y: Array,
    par: Array,
    t: float,
    known: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Tell which invariants to keep so that all are kept, one gradient orthogonalized after another.

    Of Kepler's energy, angular momentum and Lenz vector (e_1, e_2) one component of
    the last follows from the others: the second if e_2 is not 0, and the first if
    it is. A method that enforces a dependent one loses its order, since off the
    solution its gradient is not quite a combination of the others. So the gradients
    are compared at the start and at two neighbours on the solution.

    Parameters
    ----------
    system : System
        Whose invariants they are.
    quantity : Function
        The field and the entries of the gradients of n scalar invariants, for the emitters.
    pattern : Pattern
        Where these are.
    metric : ndarray, shape (dim,)
        Diagonal of the metric in which gradients are compared.
    y, par, t
        State, parameters and time.
    known : ndarray of bool, shape (n,)
        Invariants that are independent of each other, which need not be found out: they are kept.

    Returns
    -------
    ndarray of bool, shape (n,)
        All true where anything is not finite.
    """
    function = targets.numpy(system, quantity)
    dim = y.size
    with np.errstate(all="ignore"):
        slope = function(t, y, par)[:dim]
        rate = float(np.abs(slope).max() / np.abs(y).max())
        shift = SHIFT / rate if 0.0 < rate < np.inf else 0.0
        points = [y, *(_moved(lambda s, x: function(s, x, par)[:dim], t, y, h) for h in (shift, -shift))]
        remainders = np.stack(
            [pattern.gradients(function(t, point, par)[dim : dim + pattern.count]) for point in points]
        )
        remainders = remainders * np.sqrt(metric)
        # So that squares have doubles
        remainders /= _power_of_two(np.abs(remainders).max(axis=(0, 2)))[:, None]
    chosen = known.copy()
    if not np.isfinite(remainders).all():
        return np.ones_like(chosen)
    sizes = np.linalg.norm(remainders, axis=2)
    sizes[sizes == 0.0] = 1.0
    others = np.flatnonzero(~known)
    sizes, remainders = sizes[:, others], _beside(remainders, known)
    for _ in range(others.size):
        left = np.where(chosen[others], 0.0, (np.linalg.norm(remainders, axis=2) / sizes).max(axis=0))
        if left.max() <= DEPENDENT:
            break
        pick = int(np.flatnonzero(left >= NEARLY * left.max())[0])
        chosen[others[pick]] = True
        for point in remainders:
            length = np.linalg.norm(point[pick])
            if length > 0.0:
                unit = point[pick] / length
                for _ in range(2):  # twice is enough
                    point -= np.outer(point @ unit, unit)
    return chosen


def _beside(remainders: Array, known: NDArray[np.bool_]) -> Array:
    """Return the other gradients, without their parts along the known ones.

    By the normal equations, which are sparse, and again for what is left. They are damped, for a state where
    known gradients depend on each other (J. D. Riley, Math. Tables Aids Comput. 9 (1955) 96-101).
    """
    others = remainders[:, ~known]
    if known.any():
        from scipy.sparse import csr_array, diags_array
        from scipy.sparse.linalg import splu

        for point, other in zip(remainders[:, known], others, strict=True):
            gradients = csr_array(point)
            products = gradients @ gradients.T
            factors = splu((products + diags_array(DAMPING * products.diagonal())).tocsc())
            for _ in range(TIMES):
                other -= (gradients.T @ factors.solve(gradients @ other.T)).T
    return others


def _power_of_two(sizes: Array) -> Array:
    """Return a power of two of each size, by which it is divided without rounding; 1 for 0."""
    return np.ldexp(1.0, np.frexp(sizes)[1])


def _moved(slope: Callable[[float, Array], Array], t: float, y: Array, h: float) -> Array:
    """Return the state h later, by one step of the classical Runge-Kutta method."""
    a = slope(t, y)
    b = slope(t + h / 2, y + h / 2 * a)
    c = slope(t + h / 2, y + h / 2 * b)
    d = slope(t + h, y + h * c)
    return y + h / 6 * (a + 2 * b + 2 * c + d)
