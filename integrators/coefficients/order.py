"""Order and stability of Runge-Kutta methods, found from their coefficients.

The order is decided by Butcher's simplifying assumptions where they decide it, and by
the order conditions of the rooted trees where they leave a gap. The assumptions are
written with Legendre polynomials instead of powers,

    B(p): sum_i b_i P_j(c_i) = delta_j0,                                      j < p,
    C(q): sum_j a_ij P_m(c_j) = int_0^{c_i} P_m,                              m < q,
    D(r): sum_i b_i P_m(c_i) a_ij = b_j int_{c_j}^1 P_m,                      m < r,

which says the same and stays well conditioned: rounding does not hide a violation at any
order, as it does with powers from about order 24 on. B(p), C(q), D(r) give the order
min(p, 2q + 2, q + r + 1) at least. At most, it is p, and u + v + 1 for the first
``sum_ij b_i P_u(c_i) a_ij P_v(c_j)`` that is not ``int P_u int P_v`` (trees of height 2).

References
----------
E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I*, 2nd
edition, Springer 1993, sections II.2 and II.7; E. Hairer, G. Wanner, *Solving Ordinary
Differential Equations II*, 2nd edition, Springer 1996, section IV.5.
"""

from collections.abc import Iterator
from functools import lru_cache
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from integrators.coefficients.legendre import legendre, legendre_integrals
from integrators.coefficients.tableau import Tableau, tableau
from integrators.protocol import Array, AsHBVM, MethodBase, offers
from problems.checks import checked_arguments
from problems.errors import InputError, shown

HOLDS = 1e-11  # for k <= 60, what holds does so to 3e-15, and what does not misses by 1e-4 at least
HIGHEST = 10  # order up to which the trees are gone through: 719 of order 10

Tree = tuple["Tree", ...]


@checked_arguments
def order_of(method: Tableau | MethodBase) -> int:
    """Return the order of a Runge-Kutta method, checked numerically from its coefficients.

    Parameters
    ----------
    method : Tableau or MethodBase
        A tableau, or a method that has one: HBVM and Gauss with k and s given.

    Raises
    ------
    problems.errors.InputError
        For a method without a tableau, or where the order could be above 10 and nothing
        short of all trees of that order would tell.

    Examples
    --------
    >>> from integrators import HBVM, order_of
    >>> order_of(HBVM(k=6, s=3, h=0.1))
    6
    """
    tableau_ = _tableau(method)
    A, b, c = tableau_.A, tableau_.b, tableau_.c
    most = 2 * b.size  # of all Runge-Kutta methods with as many stages
    P = legendre(c, most + 1)
    integrals = legendre_integrals(c, most + 1)
    whole = np.zeros(most + 1)
    whole[0] = 1.0
    quadrature = _leading(np.abs(b @ P - whole))
    stages = _leading(np.abs(A @ P - integrals).max(axis=0))
    adjoint = _leading(np.abs((b[:, None] * P).T @ A - b * (whole[:, None] - integrals.T)).max(axis=1))
    least = min(quadrature, 2 * stages + 2, stages + adjoint + 1)
    highest = min(quadrature, _height_two(A, b, c, most))
    order = least
    while order < highest:
        if order == HIGHEST:
            raise InputError(
                f"the order of this tableau is between {order} and {highest}, and only trees up to order "
                f"{HIGHEST} are gone through."
            )
        if not all(_holds(tree, A, b) for tree in trees(order + 1)):
            break
        order += 1
    return order


@checked_arguments
def stability(method: Tableau | MethodBase, z: ArrayLike) -> NDArray[np.complex128]:
    """Return R(z) of a Runge-Kutta method: y' = lambda y goes over a step into R(h lambda) y.

    Parameters
    ----------
    method : Tableau or MethodBase
        As for `order_of`.
    z : array_like
        Complex numbers, any shape.

    Returns
    -------
    ndarray of complex, shape of ``z``

    Raises
    ------
    problems.errors.InputError
        For a method without a tableau.

    Examples
    --------
    >>> from integrators import HBVM, stability
    >>> round(float(abs(stability(HBVM(k=4, s=2, h=1.0), 3j))), 12)
    1.0
    """
    return _tableau(method).stability(z)


@lru_cache(maxsize=HIGHEST + 1)
def trees(order: int) -> tuple[Tree, ...]:
    """Return the rooted trees with so many vertices, each as the tuple of its subtrees."""
    if order == 1:
        return ((),)
    return tuple(sorted({tuple(sorted(forest)) for forest in _forests(order - 1, order - 1)}))


def _forests(vertices: int, largest: int) -> Iterator[Tree]:
    """Yield all collections of trees with so many vertices together, none larger than ``largest``."""
    if vertices == 0:
        yield ()
        return
    for size in range(1, min(vertices, largest) + 1):
        for number in range(1, vertices // size + 1):
            for rest in _forests(vertices - number * size, size - 1):
                for same in combinations_with_replacement(trees(size), number):
                    yield (*same, *rest)


def _holds(tree: Tree, A: Array, b: Array) -> bool:
    """Whether ``gamma(tree) phi(tree) = 1``."""
    return abs(_density(tree) * float(b @ _weights(tree, A)) - 1.0) < HOLDS


def _weights(tree: Tree, A: Array) -> Array:
    """Return the elementary weights of the stages: the product of A times those of the subtrees."""
    product = np.ones(len(A))
    for branch in tree:
        product = product * (A @ _weights(branch, A))
    return product


def _size(tree: Tree) -> int:
    return 1 + sum(map(_size, tree))


def _density(tree: Tree) -> int:
    """Return gamma: the product of the sizes of all subtrees, the tree itself included."""
    product = _size(tree)
    for branch in tree:
        product *= _density(branch)
    return product


def _leading(misses: Array) -> int:
    """Return how many conditions hold, from the first on."""
    failed = np.flatnonzero(misses > HOLDS)
    return int(failed[0]) if failed.size else misses.size


def _height_two(A: Array, b: Array, c: Array, most: int) -> int:
    """Return the order up to which the conditions of the trees of height 2 hold."""
    P = legendre(c, most)
    # int P_u int_0^x P_v: exact by a rule with enough nodes.
    nodes, weights = np.polynomial.legendre.leggauss(most + 1)
    x = (nodes + 1) / 2
    exact = (legendre(x, most) * weights[:, None] / 2).T @ legendre_integrals(x, most)
    misses = np.abs((b[:, None] * P).T @ A @ P - exact)
    u, v = np.nonzero(misses > HOLDS)
    return int((u + v).min()) + 1 if u.size else 2 * most


def _tableau(method: Any) -> Tableau:
    if isinstance(method, Tableau):
        return method
    options = method.as_hbvm().options() if offers(method, AsHBVM) else {}
    k, s = options.get("k"), options.get("s")
    if k is None or s is None:
        raise InputError(
            f"{shown(method)} is no Runge-Kutta method whose coefficients are known; "
            "give HBVM or Gauss with k and s, or a Tableau."
        )
    return tableau(k, s)
