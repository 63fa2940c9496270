"""Arithmetic on lanes is numpy's, element by element and bit for bit."""

import ctypes
import math
from fractions import Fraction
from math import cos, exp, fabs, log, sin, sqrt, tan

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from integrators.kernel.native import binary, stages
from integrators.kernel.simd.lanes import fma, two_sum
from problems import double_double
from problems.targets.called import where

any_double = st.floats(width=64)
moderate = st.floats(-1e100, 1e100, width=64)


def aligned(n):
    room = np.zeros(n + 8)
    start = (-room.ctypes.data % 64) // 8
    return room[start : start + n]


class OnLanes:
    """A function of rows of lanes, compiled and called on arrays (inputs, count)."""

    def __init__(self, function, count, outputs):
        code = stages.build_on_lanes(function, count)
        self.call = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 4)(binary.load(code))
        self.count, self.outputs = count, outputs

    def __call__(self, *inputs, par=()):
        n = self.count
        y, out, t, p = aligned(n * len(inputs)), aligned(n * self.outputs), aligned(n), aligned(8)
        for i, values in enumerate(inputs):
            y[n * i : n * (i + 1)] = values
        p[: len(par)] = par
        self.call(*(array.ctypes.data for array in (t, y, p, out)))
        return out.reshape(self.outputs, n).copy()


def arithmetic(t, y, par, out):
    a = y[0]
    b = y[1]
    c = par[0]
    out[0] = a + b
    out[1] = a - b
    out[2] = a * b
    out[3] = a / b
    out[4] = -a
    out[5] = fabs(a)
    out[6] = sqrt(fabs(a))
    out[7] = a + c
    out[8] = c - a
    out[9] = c * a
    out[10] = c / a
    out[11] = np.sign(a)
    out[12] = 2 * a - 1
    out[13] = a
    out[13] += b
    out[14] = a
    out[14] /= 3.0
    out[15] = 7
    out[16] = a * b + c
    out[17] = np.floor(a)
    out[18] = where(a - c, b, 2.0)
    out[19] = where(b, c, a)


ARITHMETIC = (
    lambda a, b, c: a + b,
    lambda a, b, c: a - b,
    lambda a, b, c: a * b,
    lambda a, b, c: a / b,
    lambda a, b, c: -a,
    lambda a, b, c: np.abs(a),
    lambda a, b, c: np.sqrt(np.abs(a)),
    lambda a, b, c: a + c,
    lambda a, b, c: c - a,
    lambda a, b, c: c * a,
    lambda a, b, c: c / a,
    lambda a, b, c: np.sign(a),
    lambda a, b, c: 2 * a - 1,
    lambda a, b, c: a + b,
    lambda a, b, c: a / 3.0,
    lambda a, b, c: np.full_like(a, 7.0),
    lambda a, b, c: a * b + c,  # two roundings: nothing is contracted
    lambda a, b, c: np.floor(a),
    lambda a, b, c: np.where(a - c > 0.0, b, 2.0),
    lambda a, b, c: np.where(b > 0.0, c, a),
)


def choices(t, y, par, out):
    out[0] = min(y[0], y[1])
    out[1] = max(y[0], 0.25)


def explicit(t, y, par, out):
    a = y[0]
    out[0] = fma(a, y[1], y[2])
    out[1] = fma(a, 2.0, 1.0)
    out[2], out[3] = two_sum(a, y[1])


def functions(t, y, par, out):
    out[0] = sin(y[0])
    out[1] = cos(y[0])
    out[2] = tan(y[0])
    out[3] = exp(y[1])
    out[4] = log(y[2])


@pytest.fixture(scope="module", params=[8, 16])
def count(request):
    return request.param


@pytest.fixture(scope="module")
def compiled(count):
    return {
        "arithmetic": OnLanes(arithmetic, count, len(ARITHMETIC)),
        "choices": OnLanes(choices, count, 2),
        "explicit": OnLanes(explicit, count, 4),
        "functions": OnLanes(functions, count, 5),
    }


def same_bits(found, expected):
    """Equal as bits, signs of zero included; any NaN equals any NaN."""
    expected = np.asarray(expected, dtype=np.float64)
    nan = np.isnan(found) & np.isnan(expected)
    return np.all(nan | (found.view(np.int64) == expected.view(np.int64)))


@given(values=st.lists(any_double, min_size=33, max_size=33))
@example(
    values=[0.0, -0.0, math.inf, -math.inf, math.nan, 5e-324, 1.7976931348623157e308, 1.0, -1.0] * 3
    + [0.5] * 6
)
@settings(max_examples=200, deadline=None)
def test_every_operator_is_numpys(compiled, count, values):
    a, b, c = np.array(values[:count]), np.array(values[16 : 16 + count]), values[32]
    found = compiled["arithmetic"](a, b, par=[c])
    with np.errstate(all="ignore"):
        for i, formula in enumerate(ARITHMETIC):
            assert same_bits(found[i], formula(a, b, np.float64(c))), i


@given(values=st.lists(st.floats(-2, 2).map(lambda x: round(4 * x) / 4), min_size=32, max_size=32))
@settings(max_examples=100, deadline=None)
def test_smaller_and_larger_are_chosen_lane_by_lane(compiled, count, values):
    a, b = np.array(values[:count]), np.array(values[16 : 16 + count])
    found = compiled["choices"](a, b)
    assert same_bits(found[0], [min(x, y) for x, y in zip(a, b, strict=True)])
    assert same_bits(found[1], [max(x, 0.25) for x in a])


@given(values=st.lists(moderate, min_size=48, max_size=48))
@settings(max_examples=100, deadline=None)
def test_fma_rounds_once_and_two_sum_keeps_what_rounding_takes(compiled, count, values):
    a, b, c = (np.array(values[16 * i : 16 * i + count]) for i in range(3))
    found = compiled["explicit"](a, b, c)
    for row, x, y, z in ((0, a, b, c), (1, a, np.full(count, 2.0), np.ones(count))):
        exact = [float(Fraction(p) * Fraction(q) + Fraction(r)) for p, q, r in zip(x, y, z, strict=True)]
        assert np.array_equal(found[row], exact)
    assert np.array_equal(found[2], a + b)
    kept = [Fraction(s) + Fraction(e) for s, e in zip(found[2], found[3], strict=True)]
    assert kept == [Fraction(x) + Fraction(y) for x, y in zip(a, b, strict=True)]


def ulps(found, exact):
    """Largest error in units in the last place of double-double values."""
    return np.max(np.abs((found - exact.hi) - exact.lo) / np.spacing(np.abs(exact.hi)))


def test_functions_are_right_to_a_unit_in_the_last_place(compiled, count):
    rng = np.random.default_rng(count)
    n = 30000 // count * count
    angle = np.concatenate(
        [
            rng.uniform(-10, 10, n // 3),
            rng.uniform(-1e5, 1e5, n // 3),
            np.pi / 2 * rng.integers(-60000, 60000, n // 3) * (1 + 1e-12 * rng.normal(size=n // 3)),
        ]
    )
    power = np.concatenate([rng.uniform(-2, 2, n // 2), rng.uniform(-700, 700, n // 2)])
    positive = np.concatenate([rng.uniform(0.5, 2, n // 2), np.exp(rng.uniform(-300, 300, n // 2))])
    n = min(angle.size, power.size) // count * count
    found = np.hstack(
        [
            compiled["functions"](*(x[i : i + count] for x in (angle, power, positive)))
            for i in range(0, n, count)
        ]
    )
    angle, power, positive = (double_double.DD(x[:n]) for x in (angle, power, positive))
    # Over a million arguments: 0.77, 0.77, 2.1, 0.97, 0.84.
    assert ulps(found[0], double_double.sin(angle)) < 0.85
    assert ulps(found[1], double_double.cos(angle)) < 0.85
    assert ulps(found[2], double_double.tan(angle)) < 2.5
    assert ulps(found[3], double_double.exp(power)) < 1.0
    assert ulps(found[4], double_double.log(positive)) < 1.0


def test_functions_are_even_and_odd_to_the_last_bit(compiled, count):
    x = np.random.default_rng(1).uniform(-1e3, 1e3, count)
    one = np.ones(count)
    there, back = compiled["functions"](x, one, one), compiled["functions"](-x, one, one)
    assert np.array_equal(there[0], -back[0])
    assert np.array_equal(there[1], back[1])
    assert np.array_equal(there[2], -back[2])


def test_functions_know_the_special_values(compiled, count):
    special = np.resize([0.0, -0.0, np.inf, -np.inf, np.nan, 5e-324, 1e300, -1e300], count)
    more = np.resize([709.78, 709.79, -745.1, -745.2, 1e308, -1e308, 1.0, 2e5], count)
    with np.errstate(all="ignore"):
        for x in (special, more):
            found = compiled["functions"](x, x, x)
            for row, function in zip(found, (np.sin, np.cos, np.tan, np.exp, np.log), strict=True):
                expected = function(x)
                close = np.abs(row - expected) <= 2 * np.spacing(np.abs(expected))
                assert np.all(close | (row == expected) | (np.isnan(row) & np.isnan(expected))), function


def test_one_lane_far_out_takes_the_whole_call_to_the_c_library(compiled, count):
    x = np.random.default_rng(2).uniform(-10, 10, count)
    x[3] = 1e22
    found = compiled["functions"](x, np.ones(count), np.ones(count))
    assert np.allclose(found[0], np.sin(x), rtol=1e-15, atol=0)
    assert found[0][3] == math.sin(1e22)


@pytest.mark.parametrize("far", [708.5, 1000.0, -708.5, -740.0, -1000.0, np.inf, np.nan])
def test_one_exponential_far_out_is_right_and_leaves_the_others_their_bits(compiled, count, far):
    one = np.ones(count)
    x = np.random.default_rng(3).uniform(-700, 700, count)
    before = compiled["functions"](one, x, one)[3]
    x[3] = far
    found = compiled["functions"](one, x, one)[3]
    assert np.array_equal(np.delete(found, 3), np.delete(before, 3))
    with np.errstate(all="ignore"):
        assert np.allclose(found[3], np.exp(far), rtol=3e-16, atol=5e-324, equal_nan=True)  # 1 ulp at most
