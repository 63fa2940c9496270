"""Double-double arithmetic against mpmath."""

from collections.abc import Callable

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from problems import double_double as dd
from problems.double_double import DD

N = 400


def numbers(low: float, high: float, *, signed: bool = True, seed: int = 1) -> DD:
    """Return random double-doubles of size 10**low to 10**high."""
    rng = np.random.default_rng(seed)
    hi = 10.0 ** rng.uniform(low, high, N) * (rng.choice([-1, 1], N) if signed else 1)
    return DD(hi, hi * rng.uniform(-1, 1, N) * 2.0**-54)


def exact(a: DD, i: int) -> mpmath.mpf:
    return mpmath.mpf(float(a.hi[i])) + mpmath.mpf(float(a.lo[i]))


def worst(found: DD, reference: Callable[[int], mpmath.mpf]) -> float:
    """Return the largest relative error."""
    errors = []
    with mpmath.workprec(400):
        for i in range(found.hi.size):
            expected = reference(i)
            gap = abs(exact(found, i) - expected)
            errors.append(float(gap / abs(expected)) if expected else float(gap != 0))
    return max(errors)


WIDE, OTHER = numbers(-20, 20), numbers(-20, 20, seed=2)
POSITIVE = numbers(-20, 20, signed=False, seed=3)


def test_sums_and_differences():
    assert worst(WIDE + OTHER, lambda i: exact(WIDE, i) + exact(OTHER, i)) < 1e-31  # measured 1.6e-32
    assert worst(WIDE - OTHER, lambda i: exact(WIDE, i) - exact(OTHER, i)) < 1e-31
    near = DD(WIDE.hi * (1 + 1e-10), WIDE.lo)
    assert worst(WIDE - near, lambda i: exact(WIDE, i) - exact(near, i)) == 0.0


def test_products_and_quotients():
    assert worst(WIDE * OTHER, lambda i: exact(WIDE, i) * exact(OTHER, i)) < 1e-31  # measured 2.3e-32
    assert worst(WIDE / OTHER, lambda i: exact(WIDE, i) / exact(OTHER, i)) < 1e-31  # measured 1.7e-32
    assert worst(1.0 / WIDE, lambda i: 1 / exact(WIDE, i)) < 1e-31


@pytest.mark.parametrize("n", [0, 1, 2, 3, 7, -5, 12])
def test_integer_powers(n: int):
    x = numbers(-3, 3)
    # measured 8e-32 for n = 12: a product's error per factor
    assert worst(x**n, lambda i: exact(x, i) ** n) < 2e-31


def test_square_root():
    assert worst(dd.sqrt(POSITIVE), lambda i: mpmath.sqrt(exact(POSITIVE, i))) < 1e-31  # measured 2.0e-32
    zero = dd.sqrt(DD([0.0]))
    assert zero.hi[0] == zero.lo[0] == 0.0


@pytest.mark.parametrize("size", [0, 2, 5])
def test_trigonometric_functions(size: int):
    x = numbers(-8, size)
    assert worst(dd.sin(x), lambda i: mpmath.sin(exact(x, i))) < 1e-30  # measured 2.4e-32
    assert worst(dd.cos(x), lambda i: mpmath.cos(exact(x, i))) < 1e-30  # measured 2.7e-32
    assert worst(dd.tan(x), lambda i: mpmath.tan(exact(x, i))) < 1e-30  # measured 3.0e-32


def test_sine_and_cosine_at_their_zeros():
    x = DD(np.arange(1, 100) * (np.pi / 2))
    assert worst(dd.sin(x), lambda i: mpmath.sin(exact(x, i))) < 1e-30
    assert worst(dd.cos(x), lambda i: mpmath.cos(exact(x, i))) < 1e-30


def test_exponential_and_logarithm():
    x = numbers(-10, 2.5)
    assert worst(dd.exp(x), lambda i: mpmath.exp(exact(x, i))) < 1e-30  # measured 1.3e-32
    assert worst(dd.log(POSITIVE), lambda i: mpmath.log(exact(POSITIVE, i))) < 1e-30  # measured 2.0e-31
    rng = np.random.default_rng(4)
    near_one = DD(1 + rng.uniform(-0.3, 0.3, N) * 10.0 ** rng.uniform(-15, 0, N))
    assert worst(dd.log(near_one), lambda i: mpmath.log(exact(near_one, i))) < 1e-30  # measured 2.2e-31


def test_absolute_value_and_sign():
    assert worst(dd.absolute(WIDE), lambda i: abs(exact(WIDE, i))) == 0.0
    assert np.array_equal(dd.sign(WIDE).hi, np.sign(WIDE.hi))


@given(st.floats(-1e150, 1e150), st.floats(-1e150, 1e150))
def test_the_transformations_lose_nothing(a: float, b: float):
    x, y = np.array([a]), np.array([b])
    with mpmath.workprec(4000), np.errstate(under="ignore"):
        s, e = dd.two_sum(x, y)
        assert mpmath.mpf(float(s[0])) + mpmath.mpf(float(e[0])) == mpmath.mpf(a) + mpmath.mpf(b)
        if (a == 0 or abs(a) > 1e-140) and (b == 0 or abs(b) > 1e-140):
            p, f = dd.two_prod(x, y)
            assert mpmath.mpf(float(p[0])) + mpmath.mpf(float(f[0])) == mpmath.mpf(a) * mpmath.mpf(b)


def test_numpy_arrays_leave_the_operators_to_double_doubles():
    sum_ = np.array([1.0, 2.0]) + DD(np.array([1e-20, 1e-20]))
    assert isinstance(sum_, DD)
    assert np.array_equal(sum_.lo, [1e-20, 1e-20])
