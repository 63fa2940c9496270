"""Where a function changes its sign between two points, and where it is largest."""

from integrators.kernel.inside.chebyshev import polynomial_at
from integrators.kernel.inside.memory import TINY
from integrators.kernel.inside.sample import is_finite, sign
from integrators.kernel.inside.value import value_at
from integrators.kernel.inside.zero import change_of_sign, deepest
from integrators.kernel.native.jit import compiled

BESIDE = 1e-6  # of the stretch: extrema as close to its end are looked for from both sides
APART = 1e4  # units that times can be told apart by: a pole is looked at from a distance of as many
POLE, ROOM = 1e3, 10.0  # where g is as many times larger than beside it, its sign changes through infinity
EXTREMUM = 1e-10  # of the stretch: where an extremum is, if the values near it can be told apart
EDGE, MOVES = 1e-3, 8  # part of a bracket that is its edge; how often it is moved
SECANTS = 3  # on the polynomial, which is nearly straight between two of the points where it is known
NEARER = 0.125  # a point as many times closer to the start is tried next


@compiled
def guess(search, a, b):
    """Return where the values that are known change their sign between two points, and how steep they are."""
    points, fine = search.points, search.fine
    for i in range(search.n - 1):
        x, y = points[i], points[i + 1]
        if y > a and x < b and sign(fine[i]) != sign(fine[i + 1]):
            slope = (fine[i + 1] - fine[i]) / (y - x)
            start = min(max(x - fine[i] / slope, a), b)
            if search.fitted == 0 or abs(fine[i]) <= TINY:  # a sign without a size is not the polynomial's
                return start, slope
            return refined(search, max(x, a), min(y, b), start, slope)
    return (a + b) / 2.0, 0.0


@compiled
def refined(search, low, high, x, slope):
    """Return where the polynomial is 0 between two close points, beginning at ``x``, and its slope."""
    before, at_before = x, polynomial_at(search, x)
    for _ in range(SECANTS):
        x = min(max(before - at_before / slope, low), high)
        if x == before:
            break
        value = polynomial_at(search, x)
        if value == at_before:
            break
        slope = (value - at_before) / (x - before)
        before, at_before = x, value
    return x, slope


@compiled
def leave_start(ctx, search, a, b):
    """Return a point beyond ``a`` with the sign that the function has there, before it changes towards ``b``.

    After an event that changes the state the function is 0 at the start of a step and only its sign is known;
    a step of fixed size may be much longer than the time to the next zero. ``a`` itself if there is none.
    """
    before, distance = value_at(ctx, search, a), NEARER * (b - a)
    while distance > search.resolution:
        if sign(value_at(ctx, search, a + distance)) == sign(before):
            return a + distance
        distance *= NEARER
    return a


@compiled
def zero_between(ctx, search, a, b):
    """Return the point of a change of sign between two points, to the last bit of time.

    The polynomial tells where to begin.
    """
    if a == 0.0 and ctx.events.act and ctx.varying == 0 and abs(search.start_value) <= TINY:
        a = leave_start(ctx, search, a, b)
        if a == 0.0:
            return a  # it lasts for less time than can be told
    x, slope = guess(search, a, b)
    at_a, at_b = value_at(ctx, search, a), value_at(ctx, search, b)
    low, high, at_low, at_high = change_of_sign(
        value_at, ctx, search, a, b, at_a, at_b, x, slope, search.resolution
    )
    if abs(at_low) <= TINY:  # a sign without a size
        return low if high - low <= search.resolution else high
    return low if abs(at_low) < abs(at_high) else high


@compiled
def largest_beside(ctx, search, x, distance):
    """Return the largest size of a value at a distance from a point; -1 where there is none."""
    most = -1.0
    for point in (x - distance, x + distance):
        if point >= 0.0 and point <= 1.0:
            value = abs(value_at(ctx, search, point))
            if is_finite(value):
                most = max(most, value)
    return most


@compiled
def is_pole(ctx, search, x, a, b):
    """Whether the sign changes at a point through infinity; ``a`` and ``b`` are on both sides of it."""
    value = abs(value_at(ctx, search, x))
    if value <= max(abs(value_at(ctx, search, a)), abs(value_at(ctx, search, b))):
        return False  # times are so dense that it would be larger
    distance = min(max(BESIDE, APART * search.resolution), (b - a) / 2.0)
    sides = largest_beside(ctx, search, x, distance)
    most = min(POLE, distance / (ROOM * search.resolution))  # times cannot be closer to the pole
    return sides >= 0.0 and not value <= most * sides


@compiled
def extremum(ctx, search, a, b, way):
    """Return the point that `deepest` finds between two.

    Where it is at one of the two, the polynomial has misplaced them, and they are moved.
    """
    x = a
    for _ in range(MOVES):
        x = deepest(value_at, ctx, search, a, b, way, max(EXTREMUM / 3.0, search.resolution))
        width = b - a
        if way * value_at(ctx, search, x) > 0.0 or min(x - a, b - x) > EDGE * width:
            break
        if x - a < b - x:
            a, b = a - width, a + width
        else:
            a, b = b - width, b + width
        a, b = max(a, 0.0), min(b, 1.0)
        if x - a <= EDGE * width or b - x <= EDGE * width:  # the end of the stretch
            break
    return x
