"""What generated code calls, for doubles and for whatever other numbers it runs on.

Each is one call, however long it is: branches in the text of a field would be as many blocks, and where
there are hundreds of them numba and LLVM take minutes.
"""

import numpy as np
from numba import types
from numba.extending import lower_builtin, overload, type_callable


def room(like, n):
    """Return an array of n numbers of the kind that is in ``like``; numba knows it for arrays."""
    return np.empty(n, like.dtype)


def release(array, n):
    """Give back what ``room(like, n)`` has returned; Python and numba do so by themselves."""


def where(condition, a, b):
    """Return ``a`` where the condition is above 0, else ``b``."""
    return a if condition > 0.0 else b


def table(knots, rows, x):
    """Return the value of a `problems.graph.nodes.Table`: the piece by bisection, then Horner's scheme."""
    piece, above = 0, rows.shape[0]
    while above - piece > 1:
        middle = (piece + above) >> 1
        if knots[middle] <= x:
            piece = middle
        else:
            above = middle
    rest, value = x - knots[piece], rows[piece, 0]
    for power in range(1, rows.shape[1]):
        value = value * rest + rows[piece, power]
    return value


@overload(room)
def _room(like, n):
    return (lambda like, n: np.empty(n, like.dtype)) if isinstance(like, types.Array) else None


@overload(release)
def _release(array, n):
    return (lambda array, n: None) if isinstance(array, types.Array) else None


@type_callable(where)
def _type_where(context):
    def typed(condition, a, b):
        kinds = (condition, a, b)
        return types.float64(*kinds) if kinds == (types.float64,) * 3 else None

    return typed


@lower_builtin(where, types.float64, types.float64, types.float64)
def _where(context, builder, sig, args):
    condition, a, b = args
    return builder.select(builder.fcmp_ordered(">", condition, condition.type(0.0)), a, b)


@overload(table)
def _table(knots, rows, x):
    return table if isinstance(x, types.Float) else None
