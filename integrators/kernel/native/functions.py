"""sin, cos, tan, exp and log of lanes, all lanes at once.

Argument reduction with explicit fused operations (Cody and Waite), then the
polynomials of fdlibm (Sun Microsystems, 1993), Taylor's for exp. Largest error
over a million arguments, in units in the last place, asserted in the tests:
sin and cos 0.77, log 0.84, exp 0.97; tan, the quotient of sine and cosine, 2.1.
sin and tan are odd and cos is even to the last bit. Where a lane of sin, cos or
tan lies beyond 1e5 in size, all lanes of that call go one after another through
the C library. An exponential that may be 0, subnormal or infinite takes a longer
way; any other one adds to the exponent of a number about 1 (Morse's oscillator in
lanes: 8 to 10 % less time, a Toda lattice: 24 %).

A sine of eight lanes takes 4 ns, where eight of the C library take 45 ns: a
pendulum's iteration over eight stages 28 ns instead of 70, a double pendulum's 44
instead of 226.
"""

import math
from typing import Any

from numba.extending import overload

from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.emit import llvm_call, splat
from integrators.kernel.simd.lanes import Lanes, intrinsic, rarely, somewhere
from integrators.kernel.simd.operations import fma, opposite, size, where
from integrators.kernel.simd.words import lanes, words

# Adding 1.5 * 2^52 leaves the nearest whole number in the lowest bits.
SHIFT = 6755399441055744.0
SHIFT_BITS = 0x4338000000000000
LIMIT = 1e5
MOST_ORDINARY = 708.0  # exp of a number beyond may be 0, subnormal or infinite

# pi/2 in three parts; the first two have 53 bits each.
HALF_PI = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591833e-33)
SINE = (
    -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04,
    2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10,
)  # fmt: skip
COSINE = (
    4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05,
    -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11,
)  # fmt: skip
LN2 = (0.6931471805599453, 2.3190468138462996e-17)
LN2_SHORT = (6.93147180369123816490e-01, 1.90821492927058770002e-10)
LOGARITHM = (
    6.666666666666735130e-01, 3.999999999940941908e-01, 2.857142874366239149e-01,
    2.222219843214978396e-01, 1.818357216161805012e-01, 1.531383769920937332e-01,
    1.479819860511658591e-01,
)  # fmt: skip
SINE_REST = SINE[1:]
TWO_OVER_PI, OVER_LN2 = 2.0 / math.pi, 1.0 / math.log(2.0)
EXPONENTIAL = tuple(1.0 / math.factorial(i) for i in range(2, 14))
SMALLEST_NORMAL = 2.2250738585072014e-308


@intrinsic
def polynomial(typing, x, coefficients):
    """Return a polynomial by Horner's scheme, from a tuple of numbers, that of the lowest power first."""
    count, degree = x.count, len(coefficients) - 1

    def generate(context, builder, sig, args):
        each = [splat(builder, builder.extract_value(args[1], i), count) for i in range(degree + 1)]
        result = each[degree]
        for coefficient in reversed(each[:degree]):
            result = llvm_call(builder, "fma", result, args[0], coefficient)
        return result

    return x(x, coefficients), generate


@compiled
def sine_and_cosine(x):
    """Return sin and cos of x less the nearest multiple of pi/2, and that multiple in the lowest bits."""
    shifted = fma(x, TWO_OVER_PI, SHIFT)
    n = -(shifted - SHIFT)
    whole = fma(n, HALF_PI[0], x)  # exact: a multiple of 2^-53 below 1
    # r + tail = whole + n * (the rest of pi/2), as an exact sum of an exact product.
    product = n * HALF_PI[1]
    r = whole + product
    part = r - whole
    tail = (whole - (r - part)) + (product - part)
    tail = tail + fma(n, HALF_PI[2], fma(n, HALF_PI[1], -product))
    z = r * r
    v = z * r
    # sin(r + tail) = r + (v S1 + (z (tail/2 - v S(z)) ... + tail)), all but r small.
    s = polynomial(z, SINE_REST)
    sine = r - ((z * (tail * 0.5 - v * s) - tail) - v * SINE[0])
    c = polynomial(z, COSINE)
    half = z * 0.5
    w = 1.0 - half
    cosine = w + (((1.0 - w) - half) + (z * (z * c) - r * tail))
    return sine, cosine, words(shifted)


@compiled
def quarter(sine, cosine, quadrant, first):
    """Return sin (first = 0) or cos (first = 1) of x, from those of the reduced argument."""
    turned = quadrant + first
    value = where((turned & 1) != 0, cosine, sine)
    return lanes(words(value) ^ ((turned & 2) << 62))


@compiled
def near_sin(x):
    """Return sin(x) for x of at most `LIMIT`."""
    sine, cosine, quadrant = sine_and_cosine(x)
    return quarter(sine, cosine, quadrant, 0)


@compiled
def near_cos(x):
    """Return cos(x) for x of at most `LIMIT`."""
    sine, cosine, quadrant = sine_and_cosine(x)
    return quarter(sine, cosine, quadrant, 1)


@compiled
def near_tan(x):
    """Return tan(x) for x of at most `LIMIT`."""
    sine, cosine, quadrant = sine_and_cosine(x)
    return quarter(sine, cosine, quadrant, 0) / quarter(sine, cosine, quadrant, 1)


@compiled
def exp_of_rest(x):
    """Return exp of x less the nearest multiple n of log(2), and n as integers beyond those of `SHIFT`."""
    shifted = fma(x, OVER_LN2, SHIFT)
    n = -(shifted - SHIFT)
    whole = fma(n, LN2[0], x)
    r = fma(n, LN2[1], whole)
    series = polynomial(r, EXPONENTIAL)
    return fma(r * r, series, r) + 1.0, words(shifted)


@compiled
def near_exp(x):
    """Return exp(x) for x of at most `MOST_ORDINARY`."""
    value, shifted = exp_of_rest(x)
    # The lowest twelve bits are n's, which is added to the exponent.
    return lanes(words(value) + (shifted << 52))


@compiled
def far_exp(x):
    """Return exp(x) where it may be 0, subnormal or infinite."""
    # Beyond these the result is 0 or infinite anyhow.
    y = where(x < -746.0, -746.0, x)
    y = where(y > 710.0, 710.0, y)
    value, shifted = exp_of_rest(y)
    # 2^n in two factors, since n reaches from -1075 to 1024.
    power = shifted - SHIFT_BITS
    half = power >> 1
    value = value * lanes((half + 1023) << 52)
    value = value * lanes(((power - half) + 1023) << 52)
    return where(x == x, value, x)  # a NaN stays


@compiled
def log_of(x):
    """Return log(x)."""
    tiny = x < SMALLEST_NORMAL
    scaled = where(tiny, x * 18014398509481984.0, x)  # 2^54
    # m in [sqrt(1/2), sqrt(2)), by the bits.
    power = (words(scaled) - 0x3FE6A09E667F3BCD) >> 52
    m = lanes(words(scaled) - (power << 52))
    k = lanes(power + SHIFT_BITS) - SHIFT
    k = where(tiny, k - 54.0, k)
    f = m - 1.0
    s = f / (f + 2.0)
    z = s * s
    half = f * f * 0.5
    series = z * polynomial(z, LOGARITHM)
    low = (s * (half + series)) + k * LN2_SHORT[1]
    value = k * LN2_SHORT[0] - ((half - low) - f)
    value = where(x == 0.0, -math.inf, value)
    value = where(x >= 0.0, value, math.nan)
    return where(x == math.inf, x, value)


def _library(name: str) -> Any:
    """Return what calls the C library's function for one lane after another."""

    @intrinsic
    def call(typing, x):
        return x(x), lambda context, builder, sig, args: llvm_call(builder, name, args[0])

    return call


def _with_far(near: Any, far: Any, limit: float) -> Any:
    """Return a function that has another formula in lanes beyond a limit, or without a number.

    What comes out in a lane depends on no other lane. The other formula is long, and rarely needed: it is not
    inlined wherever the function is.
    """

    @compiled
    def mended(x, value):
        return where(size(x) <= limit, value, far(x))

    @compiled
    def function(x):
        value = near(x)
        if rarely(somewhere(opposite(size(x) <= limit))):
            value = mended(x, value)
        return value

    return function


def _on_lanes(function: Any) -> Any:
    """Return what gives a function of `math` a meaning on lanes."""
    return lambda x: (lambda x: function(x)) if isinstance(x, Lanes) else None


overload(math.sin)(_on_lanes(_with_far(near_sin, _library("sin"), LIMIT)))
overload(math.cos)(_on_lanes(_with_far(near_cos, _library("cos"), LIMIT)))
overload(math.tan)(_on_lanes(_with_far(near_tan, _library("tan"), LIMIT)))
overload(math.exp)(_on_lanes(_with_far(near_exp, far_exp, MOST_ORDINARY)))
overload(math.log)(_on_lanes(log_of))
