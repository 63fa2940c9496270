"""The basis, the quadrature and the tables, against independent formulas."""

import time

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from integrators.coefficients.legendre import legendre, legendre_integrals, tables, x_matrix, xi
from problems.errors import InputError

PAIRS = [(1, 1), (3, 1), (2, 2), (5, 3), (8, 8), (16, 8), (18, 2), (32, 32), (64, 32)]


def both(table):
    """The table's value with its low part, as 30-digit numbers."""
    return [
        mpmath.mpf(float(a)) + mpmath.mpf(float(b)) for a, b in zip(table.hi.flat, table.lo.flat, strict=True)
    ]


@pytest.mark.parametrize(("k", "s"), PAIRS)
def test_basis_is_orthonormal_under_the_quadrature(k, s):
    table = tables(k, s)
    gram = table.projection.hi @ table.basis.hi
    assert np.abs(gram - np.eye(s)).max() < 5e-15  # measured 4.4e-16


@pytest.mark.parametrize(("k", "s"), PAIRS)
def test_projecting_the_integrals_gives_x(k, s):
    table = tables(k, s)
    # Measured 1.1e-16, 5.6e-17 and 1.1e-16.
    assert np.abs(table.projection.hi @ table.integrals.hi - table.x.hi).max() < 1e-15
    assert np.abs(table.x.hi - x_matrix(s)).max() < 1e-15
    assert np.abs(table.double_integrals.hi - table.integrals.hi @ x_matrix(s)).max() < 1e-15


@pytest.mark.parametrize(("k", "s"), PAIRS)
def test_tables_agree_with_double_precision_recurrences(k, s):
    table = tables(k, s)
    c = table.nodes.hi
    # The recurrence in doubles loses digits at the ends: measured 3.1e-13 at s = 32, where |P_j| <= 7.9.
    assert np.abs(legendre(c, s) - table.basis.hi).max() < 2e-12
    assert np.abs(legendre_integrals(c, s) - table.integrals.hi).max() < 5e-15  # measured 2.9e-16


def test_nodes_and_weights_have_thirty_digits():
    with mpmath.workdps(45):
        table = tables(20, 3)
        for degree in (0, 1, 7, 38, 39):
            pairs = zip(both(table.nodes), both(table.weights), strict=True)
            total = mpmath.fsum(b * c**degree for c, b in pairs)
            # A Gauss rule of 20 nodes is exact up to degree 39; measured 5.7e-34.
            assert abs(total - mpmath.mpf(1) / (degree + 1)) < mpmath.mpf(10) ** -31


def test_low_parts_repair_the_rounding_of_the_high_parts():
    with mpmath.workdps(45):
        table = tables(12, 6)
        for c, row in zip(both(table.nodes), np.arange(12), strict=True):
            for j in range(6):
                exact = mpmath.sqrt(2 * j + 1) * mpmath.quad(
                    lambda x, j=j: mpmath.legendre(j, 2 * x - 1), [0, c]
                )
                value = mpmath.mpf(float(table.integrals.hi[row, j])) + mpmath.mpf(
                    float(table.integrals.lo[row, j])
                )
                assert abs(value - exact) < mpmath.mpf(10) ** -30  # measured 4.5e-33


def test_position_weights_are_b_times_one_minus_c_except_for_one_coefficient():
    two, one = tables(6, 2), tables(6, 1)
    assert np.abs(two.position_weights.hi - two.weights.hi * (1 - two.nodes.hi)).max() < 1e-16
    assert np.array_equal(one.position_weights.hi, one.weights.hi / 2)


@pytest.mark.parametrize("k", [1, 2, 7, 8, 33, 64])
def test_nodes_mirror_each_other_exactly(k):
    table = tables(k, 1)
    assert np.array_equal(table.weights.hi, table.weights.hi[::-1])
    assert np.abs(table.nodes.hi + table.nodes.hi[::-1] - 1).max() <= 2.0**-53
    assert np.abs(table.nodes.hi - (np.polynomial.legendre.leggauss(k)[0] + 1) / 2).max() < 2e-16


@given(st.integers(1, 12), st.floats(-1.0, 2.0))
def test_integrals_are_the_antiderivative_that_vanishes_at_zero(s, c):
    x, w = np.polynomial.legendre.leggauss(16)
    nodes = c * (x + 1) / 2
    exact = c / 2 * (w @ legendre(nodes, s))
    found = legendre_integrals(np.array([c]), s)[0]
    size = np.abs(legendre(np.array([c]), s + 1)).max()
    assert np.abs(found - exact).max() <= 1e-13 * size  # measured 8e-16
    assert np.abs(legendre_integrals(np.array([0.0]), s)).max() < 1e-15


def test_smallest_eigenvalues_of_x_are_the_published_ones():
    published = [
        0.5,
        0.288675,
        0.196731,
        0.147520,
        0.117343,
        0.097103,
        0.082651,
        0.071846,
        0.063479,
        0.056817,
    ]
    found = [np.abs(np.linalg.eigvals(x_matrix(s))).min() for s in range(1, 11)]
    assert np.allclose(found, published, rtol=0, atol=5e-7)


def test_xi_is_one_over_two_root_four_i_squared_minus_one():
    assert xi(1) == pytest.approx(1 / (2 * np.sqrt(3)), rel=1e-15)


def test_tables_are_made_once_fast_and_read_only():
    tables.cache_clear()
    started = time.perf_counter()
    table = tables(64, 32)
    # Measured 0.13 s on one core, 0.02 s of it for the nodes.
    assert time.perf_counter() - started < 2.0
    assert tables(64, 32) is table
    with pytest.raises(ValueError, match="read-only"):
        table.nodes.hi[0] = 0.0


@pytest.mark.parametrize(("k", "s"), [(1, 2), (0, 0), (3, 0)])
def test_tables_refuse_fewer_nodes_than_coefficients(k, s):
    with pytest.raises(InputError, match="k >= s >= 1"):
        tables(k, s)
