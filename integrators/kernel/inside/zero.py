"""Where a function in a step changes its sign, and where it is largest: of events and of surfaces.

A function is ``value_at(ctx, data, x)``, NaN where it has no value.
"""

from integrators.kernel.inside.memory import TINY
from integrators.kernel.inside.sample import is_finite
from integrators.kernel.native.jit import compiled

MOST = 200  # evaluations for a zero
SECANT_DISTANCE = 1e-3  # two points as close tell the slope at the zero between or beside them
GOLDEN = 0.3819660112501051  # (3 - sqrt 5) / 2
MOST_LOOKS = 500  # evaluations for an extremum
NAN = float("nan")
INFINITY = float("inf")


@compiled
def change_of_sign(value_at, ctx, data, low, high, at_low, at_high, x, slope, resolution):
    """Return the two points closest to a change of sign between two, and the values there.

    Secants, and halves where these do not close in, to the resolution of points. One begins at ``x`` with a
    slope, 0 where that is unknown. A hole between two known signs has that of the latter.
    """
    otherwise, width = at_high, high - low
    previous, at_previous = NAN, NAN
    for i in range(MOST):
        width = high - low
        if width <= resolution:
            break
        if not (x > low and x < high):
            x = low + width / 2.0
        value = value_at(ctx, data, x)
        if not is_finite(value):
            value = otherwise
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
        if distance < SECANT_DISTANCE and abs(following - x) <= resolution / 2.0:
            break
        previous, at_previous = x, value
        x = following
        if i > 2 and i % 3 == 2 and high - low > width / 2.0:
            x = low + (high - low) / 2.0
    return low, high, at_low, at_high


@compiled
def deepest(value_at, ctx, data, a, b, way, least):
    """Return where ``way`` times a function is largest in a bracket, to ``least``, or first seen positive.

    Brent's minimizer: parabolas, and golden sections where these do not close in (R. P. Brent, "Algorithms
    for Minimization without Derivatives", Prentice-Hall 1973, ch. 5).
    """
    x = w = v = a + GOLDEN * (b - a)
    value = value_at(ctx, data, x)
    if way * value > 0.0:
        return x
    fx = -way * value if is_finite(value) else INFINITY
    fw = fv = fx
    step, before = 0.0, 0.0
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
        value = value_at(ctx, data, u)
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
