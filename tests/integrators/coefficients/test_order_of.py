"""The order found from a tableau is that of theory, of kauri's trees and of other libraries."""

import kauri
import numpy as np
import pytest

import integrators
from integrators import HBVM, Gauss, LineIntegral, order_of, stability
from integrators.coefficients.order import trees
from integrators.coefficients.tableau import Tableau, tableau
from problems import InputError

PAIRS = [(1, 1), (2, 1), (7, 1), (2, 2), (3, 2), (18, 2), (6, 3), (4, 4), (9, 4), (16, 8), (30, 15), (20, 20)]


def explicit(rows, b):
    k = len(b)
    A = np.zeros((k, k))
    for i, row in enumerate(rows):
        A[i, : len(row)] = row
    return Tableau(A=A, b=np.array(b, dtype=float), c=A.sum(axis=1), order=0)


@pytest.mark.parametrize(("k", "s"), PAIRS)
def test_hbvm_has_order_2s_at_any_k_and_s(k, s):
    assert order_of(tableau(k, s)) == 2 * s
    assert order_of(HBVM(k=k, s=s, h=0.1)) == 2 * s
    if k == s:
        assert order_of(Gauss(s=s, h=0.1)) == 2 * s


@pytest.mark.parametrize(
    ("method", "order"),
    [
        (explicit([[]], [1.0]), 1),
        (explicit([[], [0.5]], [0.0, 1.0]), 2),
        (explicit([[], [0.5], [-1.0, 2.0]], [1 / 6, 2 / 3, 1 / 6]), 3),
        (explicit([[], [0.5], [0, 0.5], [0, 0, 1]], [1 / 6, 1 / 3, 1 / 3, 1 / 6]), 4),
        (explicit([[], [0.5], [0, 0.5], [0, 0, 1]], [1 / 6, 1 / 3, 1 / 3 + 1e-6, 1 / 6 - 1e-6]), 1),
    ],
)
def test_explicit_methods_need_the_trees(method, order):
    assert order_of(method) == order
    found = kauri.RK(method.A.tolist(), method.b.tolist()).order(tol=1e-10, limit=6)
    assert found == order


def test_the_order_of_dop853_is_eight():
    dop853 = pytest.importorskip("scipy.integrate._ivp.dop853_coefficients")
    assert order_of(Tableau(A=dop853.A[:12, :12], b=dop853.B, c=dop853.C[:12], order=8)) == 8


def test_trees_are_counted_as_the_literature_counts_them():
    assert [len(trees(n)) for n in range(1, 10)] == [1, 1, 2, 4, 9, 20, 48, 115, 286]


def test_stability_of_a_method_is_that_of_its_tableau():
    z = np.array([1j, -2.0 + 0.5j, -1e3])
    assert np.array_equal(stability(HBVM(k=6, s=2, h=0.1), z), tableau(6, 2).stability(z))
    assert (
        np.abs(np.abs(stability(Gauss(s=3, h=0.1), 1j * np.arange(20.0))) - 1).max() < 1e-13
    )  # measured 1.1e-15


@pytest.mark.parametrize(
    "method",
    [HBVM(tol=1e-9), LineIntegral(k=4, s=2, h=0.1, invariants=["energy"]), integrators.Leapfrog(h=0.1), 3],
    ids=repr,
)
def test_a_method_without_coefficients_is_refused(method):
    with pytest.raises(InputError, match="no Runge-Kutta method whose coefficients are known"):
        order_of(method)
