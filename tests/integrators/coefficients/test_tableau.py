"""HBVM(k, s) as a Runge-Kutta method: the properties that theory claims."""

import kauri
import numpy as np
import pytest

from integrators.coefficients.legendre import legendre, legendre_integrals
from integrators.coefficients.tableau import Tableau, tableau
from problems.errors import InputError

PAIRS = [(1, 1), (2, 1), (7, 1), (2, 2), (3, 2), (18, 2), (3, 3), (6, 3), (4, 4), (9, 4), (16, 8), (20, 20)]


@pytest.mark.parametrize(("k", "s"), PAIRS)
def test_rows_sum_to_the_nodes(k, s):
    method = tableau(k, s)
    assert np.abs(method.A.sum(axis=1) - method.c).max() < 1e-15  # measured 2.2e-16


@pytest.mark.parametrize(("k", "s"), PAIRS)
def test_rank_is_s(k, s):
    assert np.linalg.matrix_rank(tableau(k, s).A, tol=1e-12) == s


@pytest.mark.parametrize("s", range(2, 9))
def test_as_many_nodes_as_coefficients_is_collocation(s):
    method = tableau(s, s)
    # a_ij = int_0^{c_i} l_j with the Lagrange polynomials l_j of the nodes.
    for j in range(s):
        others = np.delete(method.c, j)
        lagrange = np.polynomial.Polynomial.fromroots(others) / np.prod(method.c[j] - others)
        column = lagrange.integ()(method.c)
        assert np.abs(method.A[:, j] - column).max() < 5e-12  # measured 4.8e-13 (s = 8, monomials)


@pytest.mark.parametrize(("k", "s"), PAIRS)
def test_extended_collocation_projects_onto_the_first_s_polynomials(k, s):
    # sigma'(c_i) = sum_j P_j(c_i) sum_l b_l P_j(c_l) f_l at the nodes: for f_l a polynomial of degree < s in
    # c_l this is collocation itself, and for the polynomials P_s .. P_{k-1} it is nothing.
    method = tableau(k, s)
    P = legendre(method.c, k)
    stages = method.A @ P
    assert np.abs(stages[:, :s] - legendre_integrals(method.c, s)).max() < 1e-14  # measured 9.0e-16
    assert np.abs(stages[:, s:]).max(initial=0.0) < 1e-14  # measured 5.7e-16


@pytest.mark.parametrize(("k", "s"), PAIRS)
def test_the_method_is_its_own_adjoint(k, s):
    method = tableau(k, s)
    adjoint = method.b[::-1][None, :] - method.A[::-1, ::-1]
    assert np.abs(adjoint - method.A).max() < 1e-15  # measured 5.6e-17
    assert np.abs(method.b - method.b[::-1]).max() == 0.0


@pytest.mark.parametrize(("k", "s"), PAIRS)
def test_stability_function_has_modulus_one_on_the_imaginary_axis(k, s):
    y = np.concatenate([np.linspace(-50, 50, 201), [1e3, 1e6]])
    # Measured 2.1e-13 at (16, 8) and z = 1e6 i, where I - zA is ill-conditioned; 5e-15 for s <= 4.
    assert np.abs(np.abs(tableau(k, s).stability(1j * y)) - 1).max() < 1e-11


@pytest.mark.parametrize(("k", "s"), PAIRS)
def test_the_left_half_plane_and_only_it_is_stable(k, s):
    x, y = np.meshgrid([-30.0, -3.0, -0.1, 0.1, 3.0], np.linspace(-20, 20, 21))
    inside = np.abs(tableau(k, s).stability(x + 1j * y)) < 1
    assert np.array_equal(inside, x < 0)


@pytest.mark.parametrize("s", [1, 2, 4])
def test_stability_function_is_the_diagonal_pade_approximation_whatever_k(s):
    from scipy.interpolate import pade

    taylor = 1 / np.cumprod([1.0, *range(1, 2 * s + 1)])
    top, bottom = pade(taylor, s)
    z = np.array([0.3 - 0.2j, -1.5 + 2j, 4j])
    for k in (s, s + 1, 3 * s + 5):
        assert np.abs(tableau(k, s).stability(z) - top(z) / bottom(z)).max() < 1e-13  # measured 1.7e-15


@pytest.mark.parametrize(
    ("k", "s"), [(1, 1), (2, 1), (5, 1), (2, 2), (3, 2), (6, 2), (3, 3), (5, 3), (4, 4), (6, 4)]
)
def test_rooted_trees_give_order_2s_and_no_more(k, s):
    method = tableau(k, s)
    assert method.order == 2 * s
    # Order conditions hold to 1.7e-16; the first that fails misses by 8.3e-2 (s = 1) to 5.7e-6 (s = 4).
    assert kauri.RK(method.A.tolist(), method.b.tolist()).order(tol=1e-10, limit=2 * s + 2) == method.order


def test_a_tableau_that_does_not_fit_together_is_refused():
    good = tableau(3, 2)
    with pytest.raises(ValueError, match="sum to c"):
        Tableau(A=good.A, b=good.b, c=good.c + 1e-3, order=4)
    with pytest.raises(ValueError, match="sum to 1"):
        Tableau(A=good.A, b=2 * good.b, c=good.c, order=4)
    with pytest.raises(ValueError, match="fit together"):
        Tableau(A=good.A, b=good.b[:2], c=good.c, order=4)
    with pytest.raises(InputError, match="k >= s"):
        tableau(2, 3)
