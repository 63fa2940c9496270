"""How far invariants have moved from what they were at a start.

The differences are computed in double-double. Values that pairs of doubles cannot hold are
computed by `problems.evaluate.wide`.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from problems.analysis.invariants import Array, along, as_states
from problems.analysis.sizes import with_sizes
from problems.derive.function import Function
from problems.double_double import DD
from problems.graph.nodes import reachable
from problems.systems.base import System

_SMALLEST, _LARGEST = 1e-270, 1e290  # sizes between which pairs of doubles have their 32 digits
_TINY = 1e-60  # a product of four states that are as large is not below the smallest double


def errors(
    system: System,
    par: Array,
    y: ArrayLike | DD,
    t: ArrayLike | None,
    *,
    starts: tuple[ArrayLike, ArrayLike | DD],
    owner: NDArray[np.int64] | None = None,
    names: Iterable[str] | None = None,
    signed: bool = False,
) -> dict[str, Array]:
    """Return how far the invariants are from those at the start of each state.

    Errors are relative to the largest sum of absolute terms (`problems.analysis.sizes`) of the invariant
    at the start and at all states that have this start; where all terms vanish there, they are absolute.
    Vectors are measured in the 2-norm.

    Parameters
    ----------
    system : System
        Whose invariants.
    par : ndarray, shape (n_par,) or (n_par, k)
        Parameters, of all starts and their states or of each.
    y, t : array_like, shapes (n, dim), (n,)
        States and times.
    starts : pair of array_like, shapes (k,), (k, dim)
        Times and states that they are compared with.
    owner : ndarray of int, shape (n,)
        The number of each state's start; by default there is one.
    names : iterable of str, optional
        Of which invariants; by default all.
    signed : bool
        Whether errors of scalars keep their sign.

    Returns
    -------
    dict of str to ndarray, shape (n,)
    """
    states, begin = as_states(system, y), as_states(system, starts[1])
    n, k = len(states.hi), len(begin.hi)
    owner = np.zeros(n, dtype=np.int64) if owner is None else owner
    each = par if par.ndim == 2 else np.broadcast_to(par[:, np.newaxis], (par.size, k))
    finite = np.isfinite(states.hi).all(axis=1)
    tiny = _tiny(begin.hi) | _tiny(each.T)  # of these, terms that are 0 may be too small for doubles
    np.logical_or.at(tiny, owner, _tiny(states.hi))
    by_name: dict[str, Array] = {}
    for name in system.invariants if names is None else names:
        function = system.invariants[name]
        both, m = with_sizes(function), len(function.outputs)
        first = along(both, par, begin, starts[0])
        values = along(both, par if par.ndim == 1 else par[:, owner], states, t)
        with np.errstate(all="ignore"):
            largest, sizes = (_norm([size.rounded() for size in of[m:]]) for of in (first, values))
            np.fmax.at(largest, owner[finite], sizes[finite])
            gaps = [
                (now - before[owner]).rounded() for now, before in zip(values[:m], first[:m], strict=True)
            ]
            gap = gaps[0] if signed and m == 1 else _norm(gaps)
            relative = gap / np.where(largest == 0.0, 1.0, largest)[owner]
        ordinary = (largest >= _SMALLEST) & (largest <= _LARGEST) | (largest == 0.0) & ~(
            tiny | _tiny(_constants(both))
        )
        again = finite & ~(ordinary[owner] & np.isfinite(relative))
        times, begins = (
            np.broadcast_to(0.0 if x is None else x, size) for x, size in ((t, n), (starts[0], k))
        )
        for start in np.unique(owner[again]):
            which = np.flatnonzero(again & (owner == start))
            points = [(begins[start], begin.hi[start]), *((times[i], states.hi[i]) for i in which)]
            size = float(largest[start]) if ordinary[start] else 0.0
            relative[which] = _wide(both, m, each[:, start], points, size, signed)
        by_name[name] = relative
    return by_name


def _norm(components: Sequence[Array]) -> Array:
    """Return the 2-norm, whose squares neither under- nor overflow."""
    return np.hypot.reduce(np.abs(components), axis=0)


def _tiny(states: Array) -> Any:
    return np.any(np.where(states == 0.0, 1.0, np.abs(states)) < _TINY, axis=-1)


def _constants(function: Function) -> Array:
    return np.array([node.data for node in reachable(function.roots) if node.op == "const"])


def _wide(
    both: Function, m: int, par: Array, points: Sequence[tuple[float, Array]], size: float, signed: bool
) -> list[float]:
    """Return the errors at points, the first of which is their start; relative to ``size`` at least."""
    from problems.evaluate import wide  # which loads mpmath

    first, *others = (wide.evaluate(both, t, y, par) for t, y in points)
    norms = (wide.norm(values[m:]) for values in (first, *others))
    largest = max([size, *(norm for norm in norms if norm == norm)])  # which no NaN is
    gaps = ([now - before for now, before in zip(values[:m], first[:m], strict=True)] for values in others)
    return [wide.quotient(gap[0] if signed and m == 1 else wide.norm(gap), largest) for gap in gaps]
