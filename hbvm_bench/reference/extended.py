"""Double-double numbers inside numba: emitted source runs on them unchanged, with 32 digits.

The same formulas as `problems.analysis.double_double`, for compiled scalar code. A `Number` is an
unevaluated sum hi + lo; a `Row` views an array of shape (n, 2) as n of them, so
that ``y[3]*y[3]`` in an emitted function means what it says. Only for references:
no fused multiply-add, no fast math.
"""

import math
import operator
from collections.abc import Callable
from typing import Any

from numba import njit, types
from numba.core import cgutils
from numba.extending import (
    intrinsic,
    lower_builtin,
    make_attribute_wrapper,
    models,
    overload,
    register_model,
    type_callable,
)

from problems.analysis import double_double

_SPLITTER = 134217729.0  # 2**27 + 1


class NumberType(types.Type):
    """numba's type of a double-double number."""

    def __init__(self) -> None:
        super().__init__(name="DoubleDouble")


class RowType(types.Type):
    """numba's type of an array of double-double numbers."""

    def __init__(self) -> None:
        super().__init__(name="DoubleDoubleRow")


NUMBER = NumberType()
PAIRS = types.Array(types.float64, 2, "C")
ROW = RowType()


@register_model(NumberType)
class _NumberModel(models.StructModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, [("hi", types.float64), ("lo", types.float64)])


@register_model(RowType)
class _RowModel(models.StructModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, [("pairs", PAIRS)])


make_attribute_wrapper(NumberType, "hi", "hi")
make_attribute_wrapper(NumberType, "lo", "lo")
make_attribute_wrapper(RowType, "pairs", "pairs")


def number(hi: float, lo: float) -> Any:
    """Make a number inside compiled code."""
    raise NotImplementedError("only inside numba")


def row(pairs: Any) -> Any:
    """View an array (n, 2) as numbers inside compiled code."""
    raise NotImplementedError("only inside numba")


@type_callable(number)
def _type_number(context: Any) -> Callable[..., Any]:
    def typer(hi: Any, lo: Any) -> Any:
        return NUMBER if isinstance(hi, types.Float) and isinstance(lo, types.Float) else None

    return typer


@lower_builtin(number, types.Float, types.Float)
def _lower_number(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    made = cgutils.create_struct_proxy(NUMBER)(context, builder)
    made.hi, made.lo = arguments
    return made._getvalue()


@intrinsic
def _row(context: Any, pairs: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        made = cgutils.create_struct_proxy(ROW)(context, builder)
        made.pairs = arguments[0]
        context.nrt.incref(builder, PAIRS, arguments[0])
        return made._getvalue()

    return ROW(PAIRS), code


@overload(row)
def _overload_row(pairs):
    return lambda pairs: _row(pairs)  # pyright: ignore[reportCallIssue] -- numba adds the context


@njit
def _renormal(s, e):
    t = s + e
    return number(t, e - (t - s))


@njit
def plus(a, b):
    """Return a + b."""
    s = a.hi + b.hi
    v = s - a.hi
    e = (a.hi - (s - v)) + (b.hi - v)
    t = a.lo + b.lo
    w = t - a.lo
    f = (a.lo - (t - w)) + (b.lo - w)
    first = _renormal(s, e + t)
    return _renormal(first.hi, first.lo + f)


@njit
def product(x, y):
    """Return the product of two doubles, exactly."""
    p = x * y
    t = _SPLITTER * x
    xh = t - (t - x)
    xl = x - xh
    t = _SPLITTER * y
    yh = t - (t - y)
    yl = y - yh
    return number(p, ((xh * yh - p) + xh * yl + xl * yh) + xl * yl)


@njit
def times(a, b):
    """Return a*b."""
    p = product(a.hi, b.hi)
    return _renormal(p.hi, p.lo + (a.hi * b.lo + a.lo * b.hi))


@njit
def minus(a):
    """Return -a."""
    return number(-a.hi, -a.lo)


@njit
def over(a, b):
    """Return a/b: long division, three digits."""
    first = a.hi / b.hi
    rest = plus(a, minus(times(b, number(first, 0.0))))
    second = rest.hi / b.hi
    rest = plus(rest, minus(times(b, number(second, 0.0))))
    third = rest.hi / b.hi
    return plus(_renormal(first, second), number(third, 0.0))


@njit
def sqrt(a):
    """Return the square root: Newton's step from the double root, twice."""
    root = math.sqrt(a.hi)
    if root == 0.0:
        return number(0.0, 0.0)
    value = number(root, 0.0)
    for _ in range(2):
        rest = plus(a, minus(times(value, value)))
        value = plus(value, number(rest.hi / (2.0 * root), 0.0))
    return value


def _cut(fractions: list[Any]) -> tuple[tuple[float, float], ...]:
    return tuple((float(p[0]), float(p[1])) for p in (double_double._parts(f, 2) for f in fractions))


_EXP = _cut(double_double._inverse_factorials(1, 1, 10, False))
_SIN = _cut(double_double._inverse_factorials(1, 2, 15, True))
_COS = _cut(double_double._inverse_factorials(0, 2, 16, True))
_LN2 = double_double._parts(double_double._LN2, 4)
_HALF_PI = double_double._parts(double_double._PI / 2, 4)


@njit
def _series(x, coefficients):
    value = number(coefficients[-1][0], coefficients[-1][1])
    for i in range(len(coefficients) - 2, -1, -1):
        value = plus(times(value, x), number(coefficients[i][0], coefficients[i][1]))
    return value


@njit
def _reduced(a, k, parts):
    r = a
    for i in range(4):
        r = plus(r, minus(product(k, parts[i])))
    return r


@njit
def exp(a):
    """Return e**a: powers of two taken out, halved 9 times, Taylor, squared back."""
    k = float(round(a.hi / 0.6931471805599453))
    r = _reduced(a, k, _LN2)
    r = number(r.hi / 512.0, r.lo / 512.0)
    u = times(r, _series(r, _EXP))
    for _ in range(9):
        u = plus(plus(u, u), times(u, u))
    one = plus(u, number(1.0, 0.0))
    return number(math.ldexp(one.hi, int(k)), math.ldexp(one.lo, int(k)))


@njit
def log(a):
    """Return the natural logarithm: Newton's step on exp, twice near 1."""
    start = math.log(a.hi)
    value = number(start, 0.0)
    for _ in range(2):
        value = plus(value, plus(times(a, exp(minus(value))), number(-1.0, 0.0)))
    return value


@njit
def _turned(a, shift):
    k = float(round(a.hi / 1.5707963267948966))
    r = _reduced(a, k, _HALF_PI)
    square = times(r, r)
    quadrant = (int(k) + shift) % 4
    value = times(r, _series(square, _SIN)) if quadrant % 2 == 0 else _series(square, _COS)
    return minus(value) if quadrant >= 2 else value


@njit
def sin(a):
    """Return the sine."""
    return _turned(a, 0)


@njit
def cos(a):
    """Return the cosine."""
    return _turned(a, 1)


@njit
def tan(a):
    """Return the tangent."""
    return over(sin(a), cos(a))


@njit
def fabs(a):
    """Return the absolute value."""
    return minus(a) if a.hi < 0.0 else a


@njit
def copysign(x, a):
    """Return x with the sign of a number."""
    return number(math.copysign(x, a.hi), 0.0)


FUNCTIONS = {
    "sqrt": sqrt,
    "sin": sin,
    "cos": cos,
    "tan": tan,
    "exp": exp,
    "log": log,
    "fabs": fabs,
    "copysign": copysign,
}


def _binary(symbol: Any, implementation: Any) -> None:
    def both(a, b):  # numba compares the names, and annotations if any, with the implementation's
        if isinstance(a, NumberType) and isinstance(b, NumberType):
            return lambda a, b: implementation(a, b)
        if isinstance(a, NumberType) and isinstance(b, types.Float | types.Integer):
            return lambda a, b: implementation(a, number(float(b), 0.0))
        if isinstance(b, NumberType) and isinstance(a, types.Float | types.Integer):
            return lambda a, b: implementation(number(float(a), 0.0), b)
        return None

    overload(symbol)(both)


@njit
def _difference(a, b):
    return plus(a, minus(b))


_binary(operator.add, plus)
_binary(operator.sub, _difference)
_binary(operator.mul, times)
_binary(operator.truediv, over)


@overload(operator.neg)
def _negative(a):
    return (lambda a: minus(a)) if isinstance(a, NumberType) else None


@overload(operator.getitem)
def _getitem(a, i):
    if isinstance(a, RowType) and isinstance(i, types.Integer):
        return lambda a, i: number(a.pairs[i, 0], a.pairs[i, 1])
    return None


@overload(operator.setitem)
def _setitem(a, i, value):
    if not (isinstance(a, RowType) and isinstance(i, types.Integer)):
        return None
    if isinstance(value, NumberType):

        def pair(a, i, value):
            a.pairs[i, 0] = value.hi
            a.pairs[i, 1] = value.lo

        return pair

    def single(a, i, value):
        a.pairs[i, 0] = float(value)
        a.pairs[i, 1] = 0.0

    return single
