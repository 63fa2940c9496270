"""Where a function changes its sign between two points, and where it is largest."""

from integrators.kernel.inside.memory import TINY
from integrators.kernel.inside.sample import is_finite, sign
from integrators.kernel.inside.value import value_at
from integrators.kernel.native.jit import compiled

BESIDE = 1e-6  # of the stretch: extrema as close to its end are looked for from both sides
APART = 1e4  # units that times can be told apart by: a pole is looked at from a distance of as many
POLE, ROOM = 1e3, 10.0  # where g is as many times larger than beside it, its sign changes through infinity
MOST = 200  # evaluations for a zero
# Of the stretch: two points as close tell the slope at the zero between or beside them
SECANT_DISTANCE = 1e-3
EXTREMUM = 1e-10  # of the stretch: where an extremum is, if the values near it can be told apart
EDGE, MOVES = 1e-3, 8  # part of a bracket that is its edge; how often it is moved
NEARER = 0.125  # a point as many times closer to the start is tried next
GOLDEN = 0.3819660112501051  # (3 - sqrt 5) / 2
MOST_LOOKS = 500  # evaluations for an extremum
NAN = float("nan")
INFINITY = float("inf")


@compiled
def guess(search, a, b):
    """Return where the values that are known change their sign between two points, and how steep they are."""
    points, fine = search.points, search.fine
    for i in range(search.n - 1):
        x, y = points[i], points[i + 1]
        if y > a and x < b and sign(fine[i]) != sign(fine[i + 1]):
            slope = (fine[i + 1] - fine[i]) / (y - x)
            return min(max(x - fine[i] / slope, a), b), slope
    return (a + b) / 2.0, 0.0


@compiled
def continued(ctx, search, x, otherwise):
    """Return the value at a point, or in a hole between two known signs that of one of them."""
    value = value_at(ctx, search, x)
    return value if is_finite(value) else otherwise


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

    The polynomial tells where to begin. Then secants, and halves where these do not close in.
    """
    if a == 0.0 and ctx.events.act and ctx.varying == 0 and abs(search.start_value) <= TINY:
        a = leave_start(ctx, search, a, b)
        if a == 0.0:
            return a  # it lasts for less time than can be told
    low, high, at_low, at_high = a, b, value_at(ctx, search, a), value_at(ctx, search, b)
    otherwise, width = at_high, b - a
    x, slope = guess(search, a, b)
    previous, at_previous = NAN, NAN
    for i in range(MOST):
        width = high - low
        if width <= search.resolution:
            break
        if not (x > low and x < high):
            x = low + width / 2.0
        value = continued(ctx, search, x, otherwise)
        if value == 0.0:
            high, at_high = x, value
            break
        if (value > 0.0) == (at_high > 0.0):
            high, at_high = x, value
        else:
            low, at_low = x, value
        distance = abs(x - previous)
        if distance > 0.0 and value != at_previous:
            slope = (value - at_previous) / (x - previous)
        # What is known at the start may be a sign without a size.
        following = x - value / slope if slope != 0.0 and abs(value) > TINY else NAN
        if distance < SECANT_DISTANCE and abs(following - x) <= search.resolution / 2.0:
            break
        previous, at_previous = x, value
        x = following
        if i > 2 and i % 3 == 2 and high - low > width / 2.0:
            x = low + (high - low) / 2.0
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
def deepest(ctx, search, a, b, way):
    """Return where ``way`` times the function is largest in a bracket, or first found to be positive.

    Brent's minimizer: parabolas, and golden sections where these do not close in (R. P. Brent, "Algorithms
    for Minimization without Derivatives", Prentice-Hall 1973, ch. 5).
    """
    x = w = v = a + GOLDEN * (b - a)
    value = value_at(ctx, search, x)
    if way * value > 0.0:
        return x
    fx = -way * value if is_finite(value) else INFINITY
    fw = fv = fx
    step, before, least = 0.0, 0.0, max(EXTREMUM / 3.0, search.resolution)
    for _ in range(MOST_LOOKS):
        middle = (a + b) / 2.0
        if abs(x - middle) <= 2.0 * least - (b - a) / 2.0:
            break
        golden = True
        if abs(before) > least:
            r = (x - w) * (fx - fv)
            q = (x - v) * (fx - fw)
            p = (x - v) * q - (x - w) * r
            q = 2.0 * (q - r)
            if q > 0.0:
                p = -p
            q = abs(q)
            r, before = before, step
            if abs(p) < abs(q * r / 2.0) and p > q * (a - x) and p < q * (b - x):
                step = p / q
                golden = False
                if x + step - a < 2.0 * least or b - x - step < 2.0 * least:
                    step = least if middle >= x else -least
        if golden:
            before = a - x if x >= middle else b - x
            step = GOLDEN * before
        u = x + (max(step, least) if step >= 0.0 else min(step, -least))
        value = value_at(ctx, search, u)
        if way * value > 0.0:
            return u
        fu = -way * value if is_finite(value) else INFINITY
        if fu <= fx:
            if u >= x:
                a = x
            else:
                b = x
            v, fv, w, fw, x, fx = w, fw, x, fx, u, fu
        else:
            if u < x:
                a = u
            else:
                b = u
            if fu <= fw or w == x:
                v, fv, w, fw = w, fw, u, fu
            elif fu <= fv or v in (x, w):
                v, fv = u, fu
    return x


@compiled
def extremum(ctx, search, a, b, way):
    """Return the point that `deepest` finds between two.

    Where it is at one of the two, the polynomial has misplaced them, and they are moved.
    """
    x = a
    for _ in range(MOVES):
        x = deepest(ctx, search, a, b, way)
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
