"""Triangular systems with the sparse factors of one real matrix, for eight vectors side by side."""

from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.lanes import fma
from integrators.kernel.simd.memory import get, put, spread
from integrators.kernel.simd.views import doubles, integers


@compiled
def entry(
    n, lower_starts, lower_columns, lower, upper_starts, upper_columns, upper, sources, targets, vectors,
    scratch,
):  # fmt: skip
    """Replace eight vectors x by the solutions of P' L U Q' x = b; return 1.

    Parameters
    ----------
    n : int
        Rows.
    lower_starts, lower_columns, lower : int
        Addresses of L by rows: where each begins, columns, entries; the last of a row is its diagonal, 1.
    upper_starts, upper_columns, upper : int
        Of U; the first of a row is its diagonal, of which the inverse is stored.
    sources, targets : int
        Addresses of n integers: the row of b that each row of L belongs to, and the row of U that has each
        unknown.
    vectors, scratch : int
        Addresses of n times eight doubles: b, then x; and of memory.
    """
    x, w = doubles(vectors), doubles(scratch)
    starts, columns, values, order = (
        integers(lower_starts), integers(lower_columns), doubles(lower), integers(sources),
    )  # fmt: skip
    for r in range(n):
        total = get(x, 8 * order[r])
        for e in range(starts[r], starts[r + 1] - 1):
            total = fma(-spread(values, e), get(w, 8 * columns[e]), total)
        put(w, 8 * r, total)
    starts, columns, values, order = (
        integers(upper_starts), integers(upper_columns), doubles(upper), integers(targets),
    )  # fmt: skip
    for r in range(n - 1, -1, -1):
        total = get(w, 8 * r)
        for e in range(starts[r] + 1, starts[r + 1]):
            total = fma(-spread(values, e), get(w, 8 * columns[e]), total)
        put(w, 8 * r, total * spread(values, starts[r]))
    for r in range(n):
        put(x, 8 * r, get(w, 8 * order[r]))
    return 1
