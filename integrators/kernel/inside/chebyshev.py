"""The polynomial through the samples of a function, as a sum of Chebyshev polynomials."""

from integrators.kernel.inside.memory import FINE, FINEST
from integrators.kernel.inside.sample import is_finite, node
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.lanes import fma
from integrators.kernel.simd.memory import get, largest, put, splat8, spread, total
from integrators.kernel.simd.views import doubles

NEAR = 0.1  # of the largest value: an extremum below this may reach zero
UNRESOLVED = 1e-3  # of the largest coefficient: a tail as large says that there are too few samples
INFINITY = float("inf")


@compiled
def transform(search, degree):
    """Set the coefficients from the samples; return whether all are finite, and whether they are too few."""
    values, coefficients = search.values, search.coefficients
    table = doubles(search.transforms[degree // 8])
    for i in range(1, 8):
        values[degree + i] = 0.0
    damage, search.truncation = splat8(0.0), 0.0
    for i in range(0, degree + 8, 8):
        damage += 0.0 * get(values, i)
    if total(damage) != 0.0:
        return False, False
    width, none, top = 32 * (degree // 32 + 1), splat8(0.0), splat8(0.0)
    for first in range(0, width, 32):  # four at a time, which hides the latency of a product
        a, b, c, d = none, none, none, none
        for i in range(degree + 1):
            value, row = spread(values, i), table + (width * i + first)
            a, b = fma(get(row, 0), value, a), fma(get(row, 8), value, b)
            c, d = fma(get(row, 16), value, c), fma(get(row, 24), value, d)
        put(coefficients, first, a)
        put(coefficients, first + 8, b)
        put(coefficients, first + 16, c)
        put(coefficients, first + 24, d)
        top = max(max(max(top, abs(a)), abs(b)), max(abs(c), abs(d)))
    tail = max(abs(coefficients[degree - 1]), abs(coefficients[degree]))
    search.truncation = degree * tail
    return True, tail > UNRESOLVED * largest(top)


@compiled
def keeps_away(search, degree):
    """Whether the coefficients alone tell that there is no zero, nor an extremum near it."""
    sizes = splat8(0.0)
    for j in range(0, degree + 8, 8):
        sizes += abs(get(search.coefficients, j))
    constant = abs(search.coefficients[0])
    varying_part = total(sizes) - constant
    return constant - varying_part > max(NEAR * (constant + varying_part), search.errors[search.event])


@compiled
def refine(search, degree):
    """Set values at finer points: samples where there is one, else the polynomial (Clenshaw's scheme)."""
    stride, angles = FINEST // degree, search.cosines
    x, p, coefficients = search.points, search.fine, search.coefficients
    for i in range(FINE * degree):
        x[i] = angles[i * stride]
    none = splat8(0.0)
    for i in range(0, FINE * degree, 32):  # four at a time, which hides the latency of a product
        x0, x1, x2, x3 = get(x, i), get(x, i + 8), get(x, i + 16), get(x, i + 24)
        y0, y1, y2, y3 = 2.0 * x0, 2.0 * x1, 2.0 * x2, 2.0 * x3
        b0, b1, b2, b3, c0, c1, c2, c3 = none, none, none, none, none, none, none, none
        for j in range(degree, 0, -1):
            c = spread(coefficients, j)
            b0, c0 = fma(y0, b0, c - c0), b0
            b1, c1 = fma(y1, b1, c - c1), b1
            b2, c2 = fma(y2, b2, c - c2), b2
            b3, c3 = fma(y3, b3, c - c3), b3
        c = spread(coefficients, 0)
        put(p, i, fma(x0, b0, c - c0))
        put(p, i + 8, fma(x1, b1, c - c1))
        put(p, i + 16, fma(x2, b2, c - c2))
        put(p, i + 24, fma(x3, b3, c - c3))
        put(x, i, 0.5 * (1.0 - x0))
        put(x, i + 8, 0.5 * (1.0 - x1))
        put(x, i + 16, 0.5 * (1.0 - x2))
        put(x, i + 24, 0.5 * (1.0 - x3))
    for i in range(degree + 1):
        p[FINE * i] = search.values[i]
    x[FINE * degree] = 1.0
    search.n, search.fitted = FINE * degree + 1, degree


@compiled
def keep_samples(search, degree):
    """Know the samples that are finite, and nothing between: a polynomial would mean nothing."""
    n = 0
    for i in range(degree + 1):
        if is_finite(search.values[i]):
            search.points[n] = node(search, i, degree)
            search.fine[n] = search.values[i]
            n += 1
    search.n, search.fitted = n, 0


@compiled
def polynomial_at(search, point):
    """Return the value of the polynomial at a point, by the same scheme."""
    x, coefficients, b, c = 1.0 - 2.0 * point, search.coefficients, 0.0, 0.0
    for j in range(search.fitted, 0, -1):
        b, c = fma(2.0 * x, b, coefficients[j] - c), b
    return fma(x, b, coefficients[0] - c)


@compiled
def is_monotone(search):
    """Whether the values that are known at points only rise, or only fall."""
    p, rises, falls = search.fine, True, True
    for i in range(search.n - 1):
        rises &= p[i + 1] > p[i]
        falls &= p[i + 1] < p[i]
    return rises or falls


@compiled
def near(search):
    """Return the value below which an extremum may reach zero."""
    return max(NEAR * search.scale, search.errors[search.event])


@compiled
def suspect(search):
    """Whether zeros are possible; set `Search.scale`."""
    p, whole = search.fine, search.n // 8 * 8
    lows, highs, leasts = splat8(INFINITY), splat8(-INFINITY), splat8(INFINITY)
    for i in range(0, whole, 8):  # side by side
        values = get(p, i)
        lows, highs, leasts = min(lows, values), max(highs, values), min(leasts, abs(values))
    put(search.outputs, 0, lows)
    put(search.block, 0, highs)
    put(search.times, 0, leasts)
    low, high, least = INFINITY, -INFINITY, INFINITY
    for i in range(8):
        low, high = min(low, search.outputs[i]), max(high, search.block[i])
        least = min(least, search.times[i])
    for i in range(whole, search.n):
        low, high, least = min(low, p[i]), max(high, p[i]), min(least, abs(p[i]))
    search.scale = max(abs(low), abs(high))
    return search.n > 0 and ((low <= 0.0 and high >= 0.0) or least < near(search))
