"""Bodies that merge where they touch."""

from collections.abc import Callable, Iterator
from itertools import combinations
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from problems.bodies.states import masses_of, rows_of
from problems.checks import at_least, checked_arguments
from problems.errors import InputError, shown

__all__ = ["Merged", "contacts", "merge"]

Array = NDArray[np.float64]
TOUCHING = 1e-9  # of the sum of two radii: what a distance at a contact may differ from it by rounding


class Merged(NamedTuple):
    """Bodies after a merger, as `merge` returns them.

    Attributes
    ----------
    masses : ndarray
        Masses of those with mass, the first ones.
    positions, velocities : ndarray, shape (n, 3)
        Of all.
    radii : ndarray, shape (n,)
        Of all.
    kept : ndarray of int, shape (n,)
        What the index of each was before; of a merged one the lowest of its parts.
    """

    masses: Array
    positions: Array
    velocities: Array
    radii: Array
    kept: NDArray[np.int64]


@checked_arguments
def contacts(radii: ArrayLike, massless: Annotated[int, at_least(0)] = 0) -> list[Callable[..., Any]]:
    """Return functions that are zero where two bodies touch, one for each pair, for events.

    They are functions of the state of a problem of `nbody`: the square of the distance of two bodies, less
    that of the sum of their radii. Their names, such as ``contact_0_2``, are those of the events.
    Bodies that overlap at the start do not come into contact there; see `merge`.

    Parameters
    ----------
    radii : array_like, shape (n,)
        Radii of the bodies, >= 0. Two that are 0 never touch.
    massless : int
        Number of massless bodies, the last ones, which do not touch each other; less than n.

    Returns
    -------
    list of callable

    Raises
    ------
    problems.errors.InputError
        For radii that are negative or not finite, and where no body has a mass.

    Examples
    --------
    >>> from integrators import Event, HBVM, start
    >>> from problems import nbody
    >>> from problems.bodies import contacts
    >>> bodies = nbody([1.0, 1.0], [[-1, 0, 0], [1, 0, 0]], [[0, 0.1, 0], [0, -0.1, 0]], t_end=9.0)
    >>> events = [Event(g, direction=-1, terminal=True) for g in contacts([0.1, 0.1])]
    >>> run = start(bodies, HBVM(), events)
    >>> y = run.until(9.0)
    >>> run.status, round(run.t, 3), round(float(((y[3:6] - y[:3])**2).sum()), 12)
    (<Status.EVENT: 'event'>, 2.251, 0.04)
    """
    sizes = _radii(radii)
    n = sizes.size
    if massless >= n:
        raise InputError(f"massless={massless} of contacts must be less than the number of radii, {n}.")
    return [
        _contact(i, j, float(sizes[i] + sizes[j]))
        for i, j in combinations(range(n), 2)
        if sizes[i] + sizes[j] > 0.0 and i < n - massless
    ]


def _contact(i: int, j: int, reach: float) -> Callable[..., Any]:
    def contact(y: Any) -> Any:
        a, b, c = (y[3 * j + axis] - y[3 * i + axis] for axis in range(3))
        return a * a + b * b + c * c - reach * reach

    contact.__name__ = f"contact_{i}_{j}"
    return contact


def merge(masses: ArrayLike, positions: ArrayLike, velocities: ArrayLike, radii: ArrayLike) -> Merged:
    """Return the bodies after those that touch have merged, two by two, until no two touch.

    A merged body has the mass, the momentum, the centre of mass and the volume of its two parts. It takes the
    lower index, and the others move up; this is REBOUND's ``collision_resolve="merge"`` with its order kept.
    Kinetic energy is lost, and so is the spin that the two bodies had about their centre.

    Parameters
    ----------
    masses : array_like, shape (m,)
        Masses of the first m bodies; the others are massless.
    positions, velocities : array_like, shape (n, 3)
        Of all bodies.
    radii : array_like, shape (n,)
        Of all bodies. Two massless ones do not merge.

    Returns
    -------
    Merged

    Raises
    ------
    problems.errors.InputError
        For arrays of other shapes, and values that are not finite.

    Examples
    --------
    >>> from problems.bodies import merge
    >>> merged = merge([3.0, 1.0], [[0, 0, 0], [0.2, 0, 0]], [[0, 0, 0], [0, 4.0, 0]], [0.1, 0.1])
    >>> merged.masses.tolist(), merged.positions.tolist(), merged.velocities.tolist()
    ([4.0], [[0.05, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    """
    sizes = _radii(radii)
    n, heavy = sizes.size, masses_of(masses)
    if heavy.size > n:
        raise InputError(f"radii={shown(radii)} are {n} numbers for {heavy.size} bodies with mass.")
    x, v = rows_of("positions", positions, n), rows_of("velocities", velocities, n)
    m = np.concatenate([heavy, np.zeros(n - heavy.size)])
    kept = np.arange(n)
    while (pair := next(_touching(m, x, sizes), None)) is not None:
        i, j = pair
        total = m[i] + m[j]
        for row in (x, v):
            row[i] = (m[i] * row[i] + m[j] * row[j]) / total
        m[i], sizes[i] = total, np.cbrt(sizes[i] ** 3 + sizes[j] ** 3)
        left = np.arange(m.size) != j
        m, x, v, sizes, kept = m[left], x[left], v[left], sizes[left], kept[left]
    return Merged(m[m > 0.0], x, v, sizes, kept)


def _touching(m: Array, x: Array, sizes: Array) -> Iterator[tuple[int, int]]:
    """Yield the pairs of bodies that touch, one of which has a mass."""
    for i, j in combinations(range(m.size), 2):
        reach = sizes[i] + sizes[j]
        if m[i] + m[j] > 0.0 and reach > 0.0 and np.linalg.norm(x[i] - x[j]) <= reach * (1.0 + TOUCHING):
            yield i, j


def _radii(radii: ArrayLike) -> Array:
    """Return a copy of radii that are checked."""
    try:
        values = np.array(radii, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.empty((0, 0))
    if values.ndim != 1 or not (np.isfinite(values) & (values >= 0.0)).all():
        raise InputError(f"radii={shown(radii)} must be a list of numbers that are not negative.")
    return values
