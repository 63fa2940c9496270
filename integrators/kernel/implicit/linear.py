"""Factorization of small dense complex matrices, real and imaginary parts apart."""

from integrators.kernel.native.jit import compiled


@compiled
def factor(re, im, pivots, start, n):
    """Factor the matrix in rows ``start ... start + n - 1`` in place; return whether that is possible."""
    end = start + n
    for c in range(n):
        top = start + c
        best, pivot = -1.0, top
        for r in range(top, end):
            size = re[r, c] * re[r, c] + im[r, c] * im[r, c]
            if size > best:
                best, pivot = size, r
        if not 0.0 < best < float("inf"):
            return False
        pivots[top] = pivot - start
        if pivot != top:
            for j in range(n):
                re[top, j], re[pivot, j] = re[pivot, j], re[top, j]
                im[top, j], im[pivot, j] = im[pivot, j], im[top, j]
        inverse_re, inverse_im = re[top, c] / best, -im[top, c] / best
        for r in range(top + 1, end):
            a, b = re[r, c], im[r, c]
            if a == 0.0 and b == 0.0:
                continue
            x = a * inverse_re - b * inverse_im
            y = a * inverse_im + b * inverse_re
            re[r, c], im[r, c] = x, y
            for j in range(c + 1, n):
                re[r, j] -= x * re[top, j] - y * im[top, j]
                im[r, j] -= x * im[top, j] + y * re[top, j]
    return True


@compiled
def solve(re, im, pivots, start, x, y):
    """Replace the vector x + i y by the solution, with the factors from `factor`."""
    n = x.size
    for c in range(n):
        r = pivots[start + c]
        x[c], x[r] = x[r], x[c]
        y[c], y[r] = y[r], y[c]
    for r in range(1, n):
        a, b = x[r], y[r]
        for c in range(r):
            a -= re[start + r, c] * x[c] - im[start + r, c] * y[c]
            b -= re[start + r, c] * y[c] + im[start + r, c] * x[c]
        x[r], y[r] = a, b
    for r in range(n - 1, -1, -1):
        a, b = x[r], y[r]
        for c in range(r + 1, n):
            a -= re[start + r, c] * x[c] - im[start + r, c] * y[c]
            b -= re[start + r, c] * y[c] + im[start + r, c] * x[c]
        u, v = re[start + r, r], im[start + r, r]
        size = u * u + v * v
        x[r] = (a * u + b * v) / size
        y[r] = (b * u - a * v) / size
