"""Double-double arithmetic on numpy arrays: about 32 digits as an unevaluated sum hi + lo.

Error-free transformations after T. J. Dekker, "A floating-point technique for
extending the available precision", Numer. Math. 18 (1971), and D. E. Knuth,
The Art of Computer Programming 2, 4.2.2; arithmetic and elementary functions
along Y. Hida, X. S. Li, D. H. Bailey, "Library for double-double and
quad-double arithmetic" (QD). No fused multiply-add is assumed.

Relative errors, asserted in the tests: 1e-31 for + - * / sqrt and small powers,
1e-30 for sin, cos, tan, exp and log, near their zeros too. Products
overflow where doubles do; below 1e-290 the second half of a number is lost.
"""

from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_SPLITTER = 134217729.0  # 2**27 + 1
_NEAR_THE_LARGEST = 2.0**995
# 90 digits, from which the parts below are cut exactly.
_PI = Fraction("3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803482")
_LN2 = Fraction(
    "0.693147180559945309417232121458176568075500134360255254120680009493393621969694715605863327"
)


def two_sum(a: Array, b: Array) -> tuple[Array, Array]:
    """Return s, e with s = fl(a + b) and s + e = a + b exactly (Knuth)."""
    s = a + b
    v = s - a
    return s, (a - (s - v)) + (b - v)


def _quick_two_sum(a: Array, b: Array) -> tuple[Array, Array]:
    """Return the same for |a| >= |b| (Dekker)."""
    s = a + b
    return s, b - (s - a)


def _split(a: Array) -> tuple[Array, Array]:
    down = np.where(np.abs(a) > _NEAR_THE_LARGEST, 2.0**-28, 1.0)  # which the splitter would take beyond it
    small = a * down
    t = _SPLITTER * small
    high = (t - (t - small)) / down
    return high, a - high


def two_prod(a: Array, b: Array) -> tuple[Array, Array]:
    """Return p, e with p = fl(a b) and p + e = a b exactly (Dekker, Veltkamp)."""
    p = a * b
    ah, al = _split(a)
    bh, bl = _split(b)
    return p, ((ah * bh - p) + ah * bl + al * bh) + al * bl


class DD:
    """An array of double-double numbers.

    Parameters
    ----------
    hi : array_like
        The numbers, rounded to double.
    lo : array_like, optional
        What the rounding left out; 0 by default, for numbers that are doubles.
    """

    __slots__ = ("hi", "lo")
    __array_ufunc__ = None  # numpy arrays leave the operators to this class

    def __init__(self, hi: ArrayLike, lo: ArrayLike | None = None) -> None:
        self.hi: Array = np.asarray(hi, dtype=np.float64)
        self.lo: Array = np.zeros_like(self.hi) if lo is None else np.asarray(lo, dtype=np.float64)

    def __repr__(self) -> str:
        return f"DD({self.hi!r}, {self.lo!r})"

    def __getitem__(self, index: Any) -> "DD":
        return DD(self.hi[index], self.lo[index])

    def __neg__(self) -> "DD":
        return DD(-self.hi, -self.lo)

    def __add__(self, other: "DD | ArrayLike") -> "DD":
        b = as_dd(other)
        s, e = two_sum(self.hi, b.hi)
        t, f = two_sum(self.lo, b.lo)
        s, e = _quick_two_sum(s, e + t)
        return DD(*_quick_two_sum(s, e + f))

    __radd__ = __add__

    def __sub__(self, other: "DD | ArrayLike") -> "DD":
        return self + (-as_dd(other))

    def __rsub__(self, other: "DD | ArrayLike") -> "DD":
        return as_dd(other) + (-self)

    def __mul__(self, other: "DD | ArrayLike") -> "DD":
        b = as_dd(other)
        p, e = two_prod(self.hi, b.hi)
        return DD(*_quick_two_sum(p, e + (self.hi * b.lo + self.lo * b.hi)))

    __rmul__ = __mul__

    def __truediv__(self, other: "DD | ArrayLike") -> "DD":
        b = as_dd(other)
        first = self.hi / b.hi
        rest = self - b * first
        second = rest.hi / b.hi
        rest = rest - b * second
        third = rest.hi / b.hi
        s, e = _quick_two_sum(first, second)
        return DD(s, e) + third

    def __rtruediv__(self, other: "DD | ArrayLike") -> "DD":
        return as_dd(other) / self

    def __pow__(self, n: int) -> "DD":
        if n < 0:
            return 1.0 / self**-n
        if n == 0:
            return DD(np.ones_like(self.hi))
        half = self ** (n // 2) if n > 1 else None
        if half is None:
            return self
        return half * half * self if n % 2 else half * half

    def rounded(self) -> Array:
        """Return the nearest doubles."""
        return self.hi + self.lo

    def scaled(self, power: ArrayLike) -> "DD":
        """Return the numbers times 2**power, exactly."""
        return DD(np.ldexp(self.hi, power), np.ldexp(self.lo, power))


def as_dd(value: "DD | ArrayLike") -> DD:
    """Return ``value``, doubles or double-doubles, as double-doubles."""
    return value if isinstance(value, DD) else DD(value)


@cache
def _parts(value: Fraction, n: int) -> tuple[float, ...]:
    """Cut an exact number into n doubles of falling size."""
    parts: list[float] = []
    for _ in range(n):
        parts.append(float(value))
        value -= Fraction(parts[-1])
    return tuple(parts)


def _constant(value: Fraction) -> DD:
    return DD(*_parts(value, 2))


def where(condition: NDArray[np.bool_], a: DD, b: DD) -> DD:
    """Choose element by element."""
    return DD(np.where(condition, a.hi, b.hi), np.where(condition, a.lo, b.lo))


def sqrt(a: DD) -> DD:
    """Return the square root: one Newton step from the double root, then a second one."""
    root = np.sqrt(a.hi)
    safe = np.where(root == 0, 1.0, root)
    value = DD(root)
    for _ in range(2):
        value = value + (a - value * value).hi / (2.0 * safe)
    zero = a.hi == 0
    return where(zero, DD(np.zeros_like(root)), value)


def absolute(a: DD) -> DD:
    """Return the absolute value."""
    sign = np.where(a.hi < 0, -1.0, 1.0)
    return DD(a.hi * sign, a.lo * sign)


def sign(a: DD) -> DD:
    """Return 1, 0 or -1."""
    return DD(np.sign(a.hi))


def floor(a: DD) -> DD:
    """Return the largest whole number that is not larger."""
    high = np.floor(a.hi)
    # Where the first half is whole, the second one decides.
    return where(high == a.hi, DD(high) + np.floor(a.lo), DD(high))


def rint(a: DD) -> DD:
    """Return the nearest whole number, of two equally near ones the even one."""
    high = np.rint(a.hi)
    whole = DD(high) + np.rint(a.lo)  # where the first half is whole, the second one decides
    between = np.abs(a.hi - high) == 0.5  # then any second half does
    beside = DD(np.floor(a.hi) + (a.lo > 0.0))
    return where(high == a.hi, whole, where(between & (a.lo != 0.0), beside, DD(high)))


def _series(x: DD, coefficients: list[Fraction]) -> DD:
    """Evaluate a polynomial, lowest coefficient first."""
    value = _constant(coefficients[-1]) + DD(np.zeros_like(x.hi))
    for coefficient in reversed(coefficients[:-1]):
        value = value * x + _constant(coefficient)
    return value


@cache
def _inverse_factorials(first: int, step: int, n: int, alternate: bool) -> list[Fraction]:
    inverses: list[Fraction] = []
    factorial, at = 1, 0
    for k in range(n):
        for i in range(at + 1, first + k * step + 1):
            factorial *= i
        at = first + k * step
        inverses.append(Fraction(-1 if alternate and k % 2 else 1, factorial))
    return inverses


def _reduced(a: DD, step: Fraction) -> tuple[DD, Array]:
    """Return r, k with a = k step + r and |r| <= step/2, the step taken in four parts."""
    k = np.rint(a.hi / float(step))
    r = a
    for part in _parts(step, 4):
        product, error = two_prod(k, np.asarray(part))
        r = r - DD(product, error)
    return r, k


def _exp(a: DD) -> tuple[DD, NDArray[np.int64]]:
    """Return u, k with e**a = (1 + u) 2**k: r = a - k log 2 halved 9 times, Taylor, squared back."""
    r, k = _reduced(a, _LN2)
    r = r.scaled(-9)
    # exp(r) - 1, so that squaring back loses nothing: (1 + u)**2 - 1 = 2u + u**2.
    u = r * _series(r, _inverse_factorials(1, 1, 10, False))
    for _ in range(9):
        u = u + u + u * u
    return u, np.clip(np.nan_to_num(k), -1100, 1100).astype(np.int64)


def exp(a: DD) -> DD:
    """Return e**a."""
    u, k = _exp(a)
    return (u + 1.0).scaled(k)


def expm1(a: DD) -> DD:
    """Return e**a - 1."""
    u, k = _exp(a)
    return where(k == 0, u, (u + 1.0).scaled(k) - 1.0)


def log(a: DD) -> DD:
    """Return the natural logarithm: a series near 1, else Newton's step on exp."""
    start = np.log(a.hi)
    value = DD(start) + (a * exp(DD(-start)) - 1.0)
    # One step leaves (error of start)**2/2, about 1e-32 max(1, |log|)**2; near 1 that is relative to
    # a small number, so there the series of log(1 + x).
    return where(np.abs(a.hi - 1.0) < _NEAR_ONE, _log1p_series(a - 1.0), value)


_NEAR_ONE = 1.0 / 16.0


def _log1p_series(x: DD) -> DD:
    """Return log(1 + x) for |x| < 1/16, as 2 artanh(z) with z = x/(x + 2), |z| < 1/30."""
    z = x / (x + 2.0)
    return z * _series(z * z, [Fraction(2, 2 * n + 1) for n in range(12)])


def log1p(a: DD) -> DD:
    """Return log(1 + a)."""
    return where(np.abs(a.hi) < _NEAR_ONE, _log1p_series(a), log(a + 1.0))


_HUGE = 1e18  # of a number, beyond which its square is the same with 1 added


def asinh(a: DD) -> DD:
    """Return the inverse hyperbolic sine: log(1 + x + x^2/(1 + sqrt(1 + x^2))) for x > 0."""
    x = absolute(a)
    far = x.hi > _HUGE
    near = where(far, DD(np.zeros_like(x.hi)), x)
    square = near * near
    large = log(where(far, x, DD(np.ones_like(x.hi)))) + _constant(_LN2)
    value = where(far, large, log1p(near + square / (sqrt(square + 1.0) + 1.0)))
    return where(a.hi < 0, -value, value)


def acosh(a: DD) -> DD:
    """Return the inverse hyperbolic cosine: log(1 + (x - 1) + sqrt((x - 1)(x + 1)))."""
    far = a.hi > _HUGE
    near = where(far, DD(np.ones_like(a.hi)), a)
    less = near - 1.0
    return where(far, log(a) + _constant(_LN2), log1p(less + sqrt(less * (near + 1.0))))


def atanh(a: DD) -> DD:
    """Return the inverse hyperbolic tangent: log(1 + 2x/(1 - x))/2 for x > 0."""
    x = absolute(a)
    value = log1p(2.0 * x / (1.0 - x)) * 0.5
    return where(a.hi < 0, -value, value)


def _sin_cos(a: DD) -> tuple[DD, DD]:
    r, k = _reduced(a, _PI / 2)
    square = r * r
    s = r * _series(square, _inverse_factorials(1, 2, 15, True))
    c = _series(square, _inverse_factorials(0, 2, 16, True))
    quadrant = np.mod(np.nan_to_num(k), 4)
    odd = (quadrant == 1) | (quadrant == 3)
    sine, cosine = where(odd, c, s), where(odd, s, c)
    flip_sine = quadrant >= 2
    flip_cosine = (quadrant == 1) | (quadrant == 2)
    return where(flip_sine, -sine, sine), where(flip_cosine, -cosine, cosine)


def sin(a: DD) -> DD:
    """Return the sine."""
    return _sin_cos(a)[0]


def cos(a: DD) -> DD:
    """Return the cosine."""
    return _sin_cos(a)[1]


def tan(a: DD) -> DD:
    """Return the tangent."""
    sine, cosine = _sin_cos(a)
    return sine / cosine


def sinh(a: DD) -> DD:
    """Return the hyperbolic sine: its series near 0, where the exponentials cancel."""
    up = exp(a)
    near = np.abs(a.hi) < 0.5
    small = where(near, a, DD(np.zeros_like(a.hi)))
    series = small * _series(small * small, _inverse_factorials(1, 2, 13, False))
    return where(near, series, (up - 1.0 / up) * 0.5)


def cosh(a: DD) -> DD:
    """Return the hyperbolic cosine."""
    up = exp(a)
    return (up + 1.0 / up) * 0.5


def tanh(a: DD) -> DD:
    """Return the hyperbolic tangent; 1 or -1 where that is all that 32 digits tell."""
    far = np.abs(a.hi) > 40.0
    small = where(far, DD(np.zeros_like(a.hi)), a)
    return where(far, sign(a), sinh(small) / cosh(small))


def atan2(y: DD, x: DD) -> DD:
    """Return the angle of the point (x, y): that of the doubles, turned by the rest."""
    start = np.arctan2(y.hi, x.hi)
    sine, cosine = _sin_cos(DD(start))
    # tan of the rest, which is as small as rounding.
    rest = (y * cosine - x * sine) / (x * cosine + y * sine)
    return where((y.hi == 0) & (x.hi == 0), DD(start), DD(start) + rest)


def atan(a: DD) -> DD:
    """Return the inverse tangent."""
    return atan2(a, DD(np.ones_like(a.hi)))


def asin(a: DD) -> DD:
    """Return the inverse sine."""
    return atan2(a, sqrt((1.0 - a) * (1.0 + a)))


def acos(a: DD) -> DD:
    """Return the inverse cosine."""
    return atan2(sqrt((1.0 - a) * (1.0 + a)), a)


def erf(a: DD) -> DD:
    """Return the error function: 2/sqrt(pi) x e^(-x^2) times the sum of (2x^2)^n/(2n + 1)!!."""
    far = ~(np.abs(a.hi) < 9.0)  # where it is 1 or -1 to 32 digits
    x = where(far, DD(np.zeros_like(a.hi)), a)
    square = x * x
    term = DD(np.ones_like(x.hi))
    total, n = term, 0
    while (term.hi > 1e-34 * total.hi).any():
        n += 1
        term = term * square * 2.0 / float(2 * n + 1)
        total = total + term
    root = sqrt(_constant(_PI))
    return where(far, sign(a) + 0.0 * a, x * exp(-square) * total * 2.0 / root)


def erfc(a: DD) -> DD:
    """Return 1 - erf; beyond 2 the continued fraction e^(-x^2)/sqrt(pi)/(x + (1/2)/(x + (2/2)/(x + ...)))."""
    near = a.hi < 2.0
    far = a.hi > 28.0  # where it is below the smallest double
    x = where(near | far, DD(np.full_like(a.hi, 2.0)), a)
    fraction = x
    for k in range(200, 0, -1):  # after which 5e-33 is missing at 2, and less beyond
        fraction = x + (k / 2) / fraction
    tail = exp(-(x * x)) / (fraction * sqrt(_constant(_PI)))
    zero = DD(np.zeros_like(a.hi))
    return where(near, 1.0 - erf(where(near, a, zero)), where(far, zero, tail))
