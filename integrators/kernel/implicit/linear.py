"""Factors of small matrices: eight complex ones side by side in lanes, and a real one.

Of the eight, entry (r, c) is two vectors, the real and the imaginary parts of all. They belong to one
Jacobian, so they have their entries in the same places and, near enough, their largest ones too:
rows are exchanged in all eight alike. Each row knows where its entries begin and end, so that a band
costs what its width asks for.
"""

from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.lanes import fma
from integrators.kernel.simd.memory import get, put, splat8, total

INFINITY = float("inf")


@compiled
def exchange(matrix, width, i, j):
    """Exchange two rows of ``width`` doubles."""
    for c in range(0, width, 8):
        first, other = get(matrix, width * i + c), get(matrix, width * j + c)
        put(matrix, width * i + c, other)
        put(matrix, width * j + c, first)


@compiled
def factor(lu, pivots, begins, ends, n):
    """Factor eight matrices in place, with the inverse of each pivot; return whether that is possible.

    Parameters
    ----------
    lu : (n, n, 2, 8) doubles
        The matrices, from the first to the last entry of each row; then their factors.
    pivots : n integers
        For the row that each row was exchanged for.
    begins, ends : n integers
        Columns of the first and the last entry of each row; then of its factors.
    """
    width = 16 * n
    for c in range(n):
        best, pivot = 0.0, c
        for r in range(c, n):
            if begins[r] <= c:
                x, y = get(lu, width * r + 16 * c), get(lu, width * r + 16 * c + 8)
                size = total(fma(x, x, y * y))
                if size > best:
                    best, pivot = size, r
        if not 0.0 < best < INFINITY:
            return False
        pivots[c] = pivot
        if pivot != c:
            exchange(lu, width, c, pivot)
            begins[c], begins[pivot] = begins[pivot], begins[c]
            ends[c], ends[pivot] = ends[pivot], ends[c]
        top, end = width * c, ends[c]
        x, y = get(lu, top + 16 * c), get(lu, top + 16 * c + 8)
        size = fma(x, x, y * y)
        inverse_re, inverse_im = x / size, -y / size
        put(lu, top + 16 * c, inverse_re)
        put(lu, top + 16 * c + 8, inverse_im)
        for r in range(c + 1, n):
            if begins[r] > c:
                continue
            row = width * r
            for j in range(16 * (ends[r] + 1), 16 * (end + 1), 8):
                put(lu, row + j, splat8(0.0))
            ends[r] = max(ends[r], end)
            x, y = get(lu, row + 16 * c), get(lu, row + 16 * c + 8)
            a, b = fma(x, inverse_re, -y * inverse_im), fma(x, inverse_im, y * inverse_re)
            put(lu, row + 16 * c, a)
            put(lu, row + 16 * c + 8, b)
            for j in range(16 * (c + 1), 16 * (end + 1), 16):
                u, v = get(lu, top + j), get(lu, top + j + 8)
                put(lu, row + j, fma(b, v, fma(-a, u, get(lu, row + j))))
                put(lu, row + j + 8, fma(-b, u, fma(-a, v, get(lu, row + j + 8))))
    return True


@compiled
def solve(lu, pivots, begins, ends, n, x, y):
    """Replace the eight vectors x + i y by the solutions, with the factors from `factor`."""
    width = 16 * n
    for c in range(n):
        exchange(x, 8, c, pivots[c])
        exchange(y, 8, c, pivots[c])
    for r in range(1, n):
        a, b, a_cross, b_cross = get(x, 8 * r), get(y, 8 * r), splat8(0.0), splat8(0.0)
        for c in range(begins[r], r):
            i = width * r + 16 * c
            u, v, p, q = get(lu, i), get(lu, i + 8), get(x, 8 * c), get(y, 8 * c)
            a, a_cross = fma(-u, p, a), fma(v, q, a_cross)
            b, b_cross = fma(-u, q, b), fma(-v, p, b_cross)
        put(x, 8 * r, a + a_cross)
        put(y, 8 * r, b + b_cross)
    for r in range(n - 1, -1, -1):
        a, b, a_cross, b_cross = get(x, 8 * r), get(y, 8 * r), splat8(0.0), splat8(0.0)
        for c in range(r + 1, ends[r] + 1):
            i = width * r + 16 * c
            u, v, p, q = get(lu, i), get(lu, i + 8), get(x, 8 * c), get(y, 8 * c)
            a, a_cross = fma(-u, p, a), fma(v, q, a_cross)
            b, b_cross = fma(-u, q, b), fma(-v, p, b_cross)
        a, b = a + a_cross, b + b_cross
        u, v = get(lu, width * r + 16 * r), get(lu, width * r + 16 * r + 8)
        put(x, 8 * r, fma(a, u, -b * v))
        put(y, 8 * r, fma(a, v, b * u))


@compiled
def eliminate(matrix, n, width, x):
    """Replace x by the solution of a real system; return whether that is possible. The matrix is used up.

    Parameters
    ----------
    matrix : (n, width) doubles
        ``width``: n rounded up to a multiple of 8.
    x : n doubles
        The right-hand side.
    """
    for c in range(n):
        best, pivot = 0.0, c
        for r in range(c, n):
            size = abs(matrix[width * r + c])
            if size > best:
                best, pivot = size, r
        if not 0.0 < best < INFINITY:
            return False
        exchange(matrix, width, c, pivot)
        x[c], x[pivot] = x[pivot], x[c]
        top = width * c
        inverse = 1.0 / matrix[top + c]
        matrix[top + c] = inverse
        for r in range(c + 1, n):
            row = width * r
            a = matrix[row + c] * inverse
            x[r] -= a * x[c]
            for j in range(8 * (c // 8), width, 8):  # what is to the left of column c is not needed any more
                put(matrix, row + j, fma(splat8(-a), get(matrix, top + j), get(matrix, row + j)))
    for r in range(n - 1, -1, -1):
        value = x[r]
        for c in range(r + 1, n):
            value -= matrix[width * r + c] * x[c]
        x[r] = value * matrix[width * r + r]
    return True
