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

from llvmlite import ir

from integrators.kernel.simd.emit import llvm_call
from integrators.kernel.simd.lanes import Lanes, register
from integrators.kernel.simd.values import Value

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


def _sine_and_cosine(x: Value) -> tuple[Value, Value, Any]:
    """Return sin and cos of x less the nearest multiple of pi/2, and that multiple as integers."""
    shifted = x.fma(2.0 / math.pi, SHIFT)
    n = -(shifted - SHIFT)
    whole = n.fma(HALF_PI[0], x)  # exact: a multiple of 2^-53 below 1
    # r + tail = whole + n * (the rest of pi/2), as an exact sum of an exact product.
    product = n * HALF_PI[1]
    r = whole + product
    part = r - whole
    tail = (whole - (r - part)) + (product - part)
    tail = tail + n.fma(HALF_PI[2], n.fma(HALF_PI[1], -product))
    z = r * r
    v = z * r
    # sin(r + tail) = r + (v S1 + (z (tail/2 - v S(z)) ... + tail)), all but r small.
    s = z.polynomial(SINE[1:])
    sine = r - ((z * (tail * 0.5 - v * s) - tail) - v * SINE[0])
    c = z.polynomial(COSINE)
    half = z * 0.5
    w = 1.0 - half
    cosine = w + (((1.0 - w) - half) + (z * (z * c) - r * tail))
    return sine, cosine, shifted.integers()


def _quarter(x: Value, sine: Value, cosine: Value, quadrant: Any, first: int) -> Value:
    """Return sin (first = 0) or cos (first = 1) of x, from those of the reduced argument."""
    b = x.builder
    turned = b.add(quadrant, x.whole(first))
    odd = b.icmp_unsigned("!=", b.and_(turned, x.whole(1)), x.whole(0))
    size = cosine.where(odd, sine)
    sign = b.shl(b.and_(turned, x.whole(2)), x.whole(62))
    return x.doubles(b.xor(size.integers(), sign))


def _sin(x: Value) -> Value:
    sine, cosine, quadrant = _sine_and_cosine(x)
    return _quarter(x, sine, cosine, quadrant, 0)


def _cos(x: Value) -> Value:
    sine, cosine, quadrant = _sine_and_cosine(x)
    return _quarter(x, sine, cosine, quadrant, 1)


def _tan(x: Value) -> Value:
    sine, cosine, quadrant = _sine_and_cosine(x)
    return _quarter(x, sine, cosine, quadrant, 0) / _quarter(x, sine, cosine, quadrant, 1)


def _exp_of_rest(x: Value) -> tuple[Value, Any]:
    """Return exp of x less the nearest multiple n of log(2), and n as integers beyond those of `SHIFT`."""
    shifted = x.fma(1.0 / math.log(2.0), SHIFT)
    n = -(shifted - SHIFT)
    whole = n.fma(LN2[0], x)
    r = n.fma(LN2[1], whole)
    series = r.polynomial([1.0 / math.factorial(i) for i in range(2, 14)])
    return (r * r).fma(series, r) + 1.0, shifted.integers()


def _exp(x: Value) -> Value:
    value, shifted = _exp_of_rest(x)
    b = x.builder
    # The lowest twelve bits are n's, which is added to the exponent.
    return x.doubles(b.add(value.integers(), b.shl(shifted, x.whole(52))))


def _exp_far(x: Value) -> Value:
    b = x.builder
    # Beyond these the result is 0 or infinite anyhow.
    y = x.constant(-746.0).where(x.compare("<", -746.0), x)
    y = x.constant(710.0).where(x.compare(">", 710.0), y)
    value, shifted = _exp_of_rest(y)
    # 2^n in two factors, since n reaches from -1075 to 1024.
    power = b.sub(shifted, x.whole(SHIFT_BITS))
    half = b.ashr(power, x.whole(1))
    for part in (half, b.sub(power, half)):
        value = value * x.doubles(b.shl(b.add(part, x.whole(1023)), x.whole(52)))
    return value.where(x.compare("==", x), x)  # a NaN stays


def _log(x: Value) -> Value:
    b = x.builder
    tiny = x.compare("<", 2.2250738585072014e-308)
    scaled = (x * 18014398509481984.0).where(tiny, x)  # 2^54
    # m in [sqrt(1/2), sqrt(2)), by the bits.
    bits = b.sub(scaled.integers(), x.whole(0x3FE6A09E667F3BCD))
    power = b.ashr(bits, x.whole(52))
    m = x.doubles(b.sub(scaled.integers(), b.shl(power, x.whole(52))))
    k = x.doubles(b.add(power, x.whole(SHIFT_BITS))) - SHIFT
    k = (k - 54.0).where(tiny, k)
    f = m - 1.0
    s = f / (f + 2.0)
    z = s * s
    half = f * f * 0.5
    series = z * z.polynomial(LOGARITHM)
    low = (s * (half + series)) + k * LN2_SHORT[1]
    value = k * LN2_SHORT[0] - ((half - low) - f)
    value = x.constant(-math.inf).where(x.compare("==", 0.0), value)
    value = value.where(x.compare(">=", 0.0), math.nan)
    return x.where(x.compare("==", math.inf), value)


def _beyond(x: Value, limit: float) -> Any:
    """Return the lanes that are larger in size than the limit, or no numbers."""
    return x.builder.fcmp_unordered(">", x.absolute().value, x.constant(limit).value)


def _library(name: str) -> Any:
    """Return what calls the C library's function for one lane after another."""
    return lambda x: Value(x.builder, llvm_call(x.builder, name, x.value))


def _far(module: Any, name: str, kind: Any, limit: float, formula: Any) -> Any:
    """Return the function of x and of values of it that has those of a formula where x is beyond the limit.

    What comes out in a lane depends on no other lane. The code is long, and rarely needed: it is not to be
    inlined wherever the function is.
    """
    function = ir.Function(module, ir.FunctionType(kind, [kind] * 2), f"lanes.{name}.far.{kind.count}")
    function.linkage = "linkonce_odr"
    for attribute in ("noinline", "cold"):
        function.attributes.add(attribute)
    b: Any = ir.IRBuilder(function.append_basic_block())
    x, value = (Value(b, argument) for argument in function.args)
    b.ret(formula(x).where(_beyond(x, limit), value).value)
    return function


def _function(name: str, formula: Any, limit: float | None, far: Any = None) -> Any:
    """Emit calls of a function that evaluates ``formula``, or another one in lanes beyond ``limit``."""

    def emit(builder: Any, x: Any) -> Any:
        kind = x.type
        full = f"lanes.{name}.{kind.count}"
        function = builder.module.globals.get(full)
        if function is None:
            function = ir.Function(builder.module, ir.FunctionType(kind, [kind]), full)
            function.linkage = "linkonce_odr"
            inner = ir.IRBuilder(function.append_basic_block())
            argument = Value(inner, function.args[0])
            value = formula(argument)
            if limit is not None:
                bits: Any = inner.bitcast(_beyond(argument, limit), ir.IntType(kind.count))
                some = inner.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))
                with inner.if_then(some, likely=False):
                    others = _far(builder.module, name, kind, limit, far)
                    inner.ret(inner.call(others, [argument.value, value.value]))
            inner.ret(value.value)
        return builder.call(function, [x])

    return emit


for _math, _name, _formula, _limit, _other in (
    (math.sin, "sin", _sin, LIMIT, _library("sin")),
    (math.cos, "cos", _cos, LIMIT, _library("cos")),
    (math.tan, "tan", _tan, LIMIT, _library("tan")),
    (math.exp, "exp", _exp, MOST_ORDINARY, _exp_far),
    (math.log, "log", _log, None, None),
):
    register(_math, 1, Lanes, _function(_name, _formula, _limit, _other))
