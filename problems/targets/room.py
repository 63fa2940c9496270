"""Room for intermediate values in generated code, for doubles and for whatever other numbers it runs on."""

import numpy as np
from numba import types
from numba.extending import overload


def room(like, n):
    """Return an array of n numbers of the kind that is in ``like``; numba knows it for arrays."""
    return np.empty(n, like.dtype)


@overload(room)
def _room(like, n):
    return (lambda like, n: np.empty(n, like.dtype)) if isinstance(like, types.Array) else None
