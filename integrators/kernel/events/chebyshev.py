"""The polynomial through the samples of a function, as a sum of Chebyshev polynomials."""

from integrators.kernel.events.memory import FINE, FINEST
from integrators.kernel.events.sample import is_finite, node
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import get, put, splat8, spread

NEAR = 0.1  # of the largest value: an extremum below this may reach zero
UNRESOLVED = 1e-3  # of the largest coefficient: a tail as large says that there are too few samples
INFINITY = float("inf")


@compiled
def transform(search, degree):
    """Set the coefficients from the samples; return whether all are finite, and whether they are too few."""
    stride, values, coefficients = FINE * FINEST // degree, search.values, search.coefficients
    top, tail, finite = 0.0, 0.0, True
    for i in range(degree + 1):
        finite = finite and is_finite(values[i])
    for j in range(degree + 1):
        total = 0.5 * (values[0] + (values[degree] if j % 2 == 0 else -values[degree]))
        for i in range(1, degree):
            total += search.cosines[((i * j) % (2 * degree)) * stride] * values[i]
        coefficients[j] = total * ((1.0 if j == 0 or j == degree else 2.0) / degree)
        size = abs(coefficients[j])
        top = max(top, size)
        if j >= degree - 1:
            tail = max(tail, size)
    return finite, finite and tail > UNRESOLVED * top


@compiled
def keeps_away(search, degree):
    """Whether the coefficients alone tell that there is no zero, nor an extremum near it."""
    rest = 0.0
    for j in range(1, degree + 1):
        rest += abs(search.coefficients[j])
    constant = abs(search.coefficients[0])
    return constant - rest > NEAR * (constant + rest)


@compiled
def refine(search, degree):
    """Set values at finer places: samples where there is one, else the polynomial."""
    stride, angles, room = FINEST // degree, search.cosines, search.weights
    for first in range(0, FINE * degree, 8):
        for i in range(8):
            room[i] = angles[(first + i) * stride]
        x = get(room, 0)
        here, after = splat8(0.0), splat8(0.0)
        for j in range(degree, 0, -1):
            here, after = 2.0 * x * here - after + spread(search.coefficients, j), here
        put(room, 8, x * here - after + spread(search.coefficients, 0))
        for i in range(8):
            search.places[first + i] = (1.0 - room[i]) / 2.0
            search.fine[first + i] = room[8 + i]
    for i in range(degree + 1):
        search.fine[FINE * i] = search.values[i]
    search.places[FINE * degree] = 1.0
    search.n = FINE * degree + 1
    search.smooth = 1


@compiled
def keep_samples(search, degree):
    """Know the samples that are finite, and nothing between: a polynomial would mean nothing."""
    n = 0
    for i in range(degree + 1):
        if is_finite(search.values[i]):
            search.places[n] = node(search, i, degree)
            search.fine[n] = search.values[i]
            n += 1
    search.n = n
    search.smooth = 0


@compiled
def suspect(search):
    """Whether zeros are possible; set `Search.scale`."""
    low, high, least = INFINITY, -INFINITY, INFINITY
    for i in range(search.n):
        value = search.fine[i]
        low, high, least = min(low, value), max(high, value), min(least, abs(value))
    search.scale = max(abs(low), abs(high))
    return search.n > 0 and ((low <= 0.0 and high >= 0.0) or least < NEAR * search.scale)
