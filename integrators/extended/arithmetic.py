"""Double-double numbers inside numba: emitted source runs on them with 32 digits.

A number is an unevaluated sum hi + lo that travels as the complex number hi + i lo, so that arrays of numbers
are arrays of complex and a double is a number whose lo is 0. `compiled` rewrites the operators of an
emitted function as the functions below, which are the same formulas as
`problems.double_double` for compiled scalar code. No fused
multiply-add, no fast math.
"""

import ast
import math
from fractions import Fraction
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from problems import double_double
from problems.graph.functions import WHOLE
from problems.targets.called import release, room

Numbers = NDArray[np.complex128]
"""Arrays of numbers."""

_SPLITTER = 134217729.0  # 2**27 + 1


@njit
def _renormal(s, e):
    t = s + e
    return complex(t, e - (t - s))


@njit
def plus(a, b):
    """Return a + b."""
    s = a.real + b.real
    v = s - a.real
    e = (a.real - (s - v)) + (b.real - v)
    t = a.imag + b.imag
    w = t - a.imag
    f = (a.imag - (t - w)) + (b.imag - w)
    first = _renormal(s, e + t)
    return _renormal(first.real, first.imag + f)


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
    return complex(p, ((xh * yh - p) + xh * yl + xl * yh) + xl * yl)


@njit
def times(a, b):
    """Return a*b."""
    p = product(a.real, b.real)
    return _renormal(p.real, p.imag + (a.real * b.imag + a.imag * b.real))


@njit
def minus(a, b):
    """Return a - b."""
    return plus(a, -b)


@njit
def over(a, b):
    """Return a/b: long division, three digits."""
    first = a.real / b.real
    rest = minus(a, times(b, first))
    second = rest.real / b.real
    rest = minus(rest, times(b, second))
    third = rest.real / b.real
    return plus(_renormal(first, second), third)


@njit
def sqrt(a):
    """Return the square root: Newton's step from the double root, twice."""
    root = math.sqrt(a.real)
    value = complex(root, 0.0)
    if root != 0.0:
        for _ in range(2):
            value = plus(value, minus(a, times(value, value)).real / (2.0 * root))
    return value


def _numbers(fractions: list[Fraction]) -> Numbers:
    return np.array([complex(*double_double._parts(fraction, 2)) for fraction in fractions])


_EXP = _numbers(double_double._inverse_factorials(1, 1, 10, False))
_SIN = _numbers(double_double._inverse_factorials(1, 2, 15, True))
_COS = _numbers(double_double._inverse_factorials(0, 2, 16, True))
_LN2 = double_double._parts(double_double._LN2, 4)
_HALF_PI = double_double._parts(double_double._PI / 2, 4)


@njit
def _series(x, coefficients):
    value = coefficients[-1]
    for i in range(len(coefficients) - 2, -1, -1):
        value = plus(times(value, x), coefficients[i])
    return value


@njit
def _reduced(a, k, parts):
    r = a
    for i in range(4):
        r = minus(r, product(k, parts[i]))
    return r


@njit
def exp(a):
    """Return e**a: powers of two taken out, halved 9 times, Taylor, squared back."""
    k = float(round(a.real / 0.6931471805599453))
    r = _reduced(complex(a), k, _LN2)
    r = complex(r.real / 512.0, r.imag / 512.0)
    u = times(r, _series(r, _EXP))
    for _ in range(9):
        u = plus(plus(u, u), times(u, u))
    sum_ = plus(u, 1.0)
    return complex(math.ldexp(sum_.real, int(k)), math.ldexp(sum_.imag, int(k)))


@njit
def log(a):
    """Return the natural logarithm: Newton's step on exp, twice near 1."""
    value = complex(math.log(a.real), 0.0)
    for _ in range(2):
        value = plus(value, plus(times(a, exp(-value)), -1.0))
    return value


@njit
def _turned(a, shift):
    k = float(round(a.real / 1.5707963267948966))
    r = _reduced(complex(a), k, _HALF_PI)
    square = times(r, r)
    quadrant = (int(k) + shift) % 4
    value = times(r, _series(square, _SIN)) if quadrant % 2 == 0 else _series(square, _COS)
    return -value if quadrant >= 2 else value


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
    return -a if a.real < 0.0 else a


@njit
def sign(a):
    """Return 1, 0 or -1."""
    return complex(np.sign(a.real), 0.0)


@njit
def floor(a):
    """Return the largest whole number that is not larger."""
    high = np.floor(a.real)
    return complex(high, np.floor(a.imag) if high == a.real else 0.0)


@njit
def whole(a):
    """Return the nearest whole number."""
    high = np.rint(a.real)
    if high == a.real:
        return complex(high, np.rint(a.imag))
    if abs(high - a.real) == 0.5 and a.imag != 0.0:
        return complex(np.floor(a.real) + (a.imag > 0.0), 0.0)
    return complex(high, 0.0)


@njit
def where(condition, a, b):
    """Return ``a`` where the condition is above 0, else ``b``."""
    return complex(a) if condition.real > 0.0 else complex(b)


FUNCTIONS = (plus, minus, times, over, sqrt, sin, cos, tan, exp, log, fabs, sign, floor, whole, where)
_OPERATORS = {ast.Add: "plus", ast.Sub: "minus", ast.Mult: "times", ast.Div: "over"}


class _Operators(ast.NodeTransformer):
    """Turns operators into calls, but for those of places in an array and of counters."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        match node:  # what rounds doubles leaves numbers with more digits as they are
            case ast.BinOp(ast.BinOp(x, ast.Add(), ast.Constant(up)), ast.Sub(), ast.Constant(down)) if (
                up == down == WHOLE
            ):
                return ast.Call(ast.Name("whole", ast.Load()), [self.visit(x)], [])
        self.generic_visit(node)
        if (name := _OPERATORS.get(type(node.op))) is None:
            return node
        return ast.Call(ast.Name(name, ast.Load()), [node.left, node.right], [])

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        return node

    def visit_Call(self, node: ast.Call) -> ast.expr:
        counts = isinstance(node.func, ast.Name) and node.func.id in ("range", "float")
        return node if counts else self.generic_visit(node)  # pyright: ignore[reportReturnType]


def compiled(text: str, name: str) -> Any:
    """Compile what `problems.targets.source` has printed for numba, for numbers instead of doubles."""
    tree = ast.fix_missing_locations(_Operators().visit(ast.parse(text)))
    namespace: dict[str, Any] = {
        "np": np,
        "room": room,
        "release": release,
        **{function.__name__: function for function in FUNCTIONS},
    }
    exec(compile(tree, "<field>", "exec"), namespace)  # noqa: S102 -- emitted from a graph
    return njit(namespace[name])
