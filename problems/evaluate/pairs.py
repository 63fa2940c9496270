"""Functions evaluated in double-double at many states: 32 digits."""

import operator

import numpy as np
from numpy.typing import ArrayLike

from problems.derive.function import Function
from problems.double_double import DD, as_dd
from problems.evaluate.evaluator import Array, Evaluator, Numbers
from problems.graph.arithmetic import ARITHMETIC
from problems.graph.functions import CALLED
from problems.graph.nodes import reachable

# Numbers held at once by a declared sum's terms, so that many states and many terms fit in memory.
_BLOCK = 2_000_000


def _rows(values: DD, n: int, columns: int) -> DD:
    shape = n, columns
    return DD(np.broadcast_to(values.hi, shape), np.broadcast_to(values.lo, shape))


def _total(terms: DD) -> DD:
    # In halves: with 32 digits the order does not matter, and this is fast.
    hi, lo = terms.hi, terms.lo
    while len(hi) > 1:
        half = len(hi) // 2
        paired = DD(hi[:half], lo[:half]) + DD(hi[half : 2 * half], lo[half : 2 * half])
        hi = np.concatenate([paired.hi, hi[2 * half :]])
        lo = np.concatenate([paired.lo, lo[2 * half :]])
    return DD(hi[0], lo[0])


PAIRS = Numbers(
    of=DD,
    operations={name: f.double_double for name, f in CALLED.items()}
    | {name: record.value for name, record in ARITHMETIC.items()}
    | {"pow": operator.pow},
    rows=_rows,
    total=_total,
    stacked=lambda rows: DD(np.stack([row.hi for row in rows]), np.stack([row.lo for row in rows])),
)
"""Pairs of doubles."""


def evaluate(function: Function, t: ArrayLike, y: Array | DD, par: Array) -> list[DD]:
    """Evaluate a function in double-double.

    Parameters
    ----------
    function : Function
        From `System.function`.
    t : array_like
        One time, or one per state.
    y : ndarray or DD, shape (dim, n)
        States, one per column.
    par : ndarray, shape (n_par,) or (n_par, n)
        Parameters, of all states or of each.

    Returns
    -------
    list of DD
        One array of shape (n,) per output.
    """
    inside = [len(node.loop) for node in reachable(function.roots) if node.loop is not None]
    largest = max([1, *inside, *(len(loop) for loop, _ in function.loops)])
    columns = max(1, _BLOCK // largest)
    y = as_dd(y)
    n = y.hi.shape[1]
    times = as_dd(np.broadcast_to(np.asarray(t, dtype=np.float64), (1, n)))
    own = as_dd(par if par.ndim == 2 else par[:, np.newaxis])
    parts = []
    for low in range(0, max(n, 1), columns):
        here = slice(low, low + columns)
        of_each = own[:, here] if par.ndim == 2 else own
        states = y[:, here]
        evaluator = Evaluator(PAIRS, times[:, here], states, of_each, states.hi.shape[1])
        parts.append(evaluator.outputs(function))
    return [
        DD(np.concatenate([p[i].hi for p in parts]), np.concatenate([p[i].lo for p in parts]))
        for i in range(len(function.outputs))
    ]
