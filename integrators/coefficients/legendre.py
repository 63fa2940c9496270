"""Legendre polynomials on [0, 1], Gauss quadrature, and the tables every HBVM is made of.

With ``L_j`` the Legendre polynomials, ``P_j(c) = sqrt(2j+1) L_j(2c-1)`` are
orthonormal on [0, 1]. Everything here follows from two recurrences, with
``xi_i = 1 / (2 sqrt(4 i^2 - 1))``:

    (c - 1/2) P_j(c) = (j+1) xi_{j+1} P_{j+1}(c) + j xi_j P_{j-1}(c),    P_0 = 1,
    int_0^c P_j = xi_{j+1} P_{j+1}(c) - xi_j P_{j-1}(c),                 int_0^c P_0 = xi_1 P_1(c) + 1/2.

The tables are made once, with 50 digits, and kept as pairs ``hi + lo`` of
doubles: rounding the nodes and weights to a single double leaves an energy
drift that no compensated summation cures.

References
----------
L. Brugnano, F. Iavernaro, *Line Integral Methods for Conservative Problems*,
CRC Press, 2016, chapter 3.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from mpmath import MPContext
from numpy.typing import NDArray

from problems.errors import InputError

Array = NDArray[np.float64]

DIGITS = 50

# A context of our own: the precision of a user's mpmath.mp is not ours to change.
_mp = MPContext()
_mp.dps = DIGITS


@dataclass(frozen=True, eq=False)
class Table:
    """A table of real numbers rounded twice: ``hi + lo`` holds about 32 digits.

    Attributes
    ----------
    hi, lo : ndarray
        The nearest doubles, and the nearest doubles to what they leave; read-only.
    """

    hi: Array
    lo: Array

    @classmethod
    def rounded(cls, numbers: Any, shape: tuple[int, ...]) -> "Table":
        """Round a flat sequence of mpmath numbers to a table of the given shape."""
        hi = [float(x) for x in numbers]
        lo = [float(x - _mp.mpf(top)) for x, top in zip(numbers, hi, strict=True)]
        pair = [np.array(part, dtype=np.float64).reshape(shape) for part in (hi, lo)]
        for part in pair:
            part.flags.writeable = False
        return cls(*pair)


@dataclass(frozen=True, eq=False)
class Tables:
    """The matrices of HBVM(k, s), each a `Table`.

    Attributes
    ----------
    k, s : int
        Nodes of the quadrature and degree of the polynomial.
    nodes, weights : Table, shape (k,)
        The Gauss rule ``c_l, b_l`` on [0, 1].
    basis : Table, shape (k, s)
        ``P_j(c_l)``.
    integrals : Table, shape (k, s)
        ``int_0^{c_l} P_j``; rows are stages.
    projection : Table, shape (s, k)
        ``b_l P_j(c_l)``, that is P' Omega: stage values to Legendre coefficients.
    x : Table, shape (s, s)
        ``X_s``, tridiagonal: 1/2 in the corner, ``xi_i`` below, ``-xi_i`` above the diagonal.
    double_integrals : Table, shape (k, s)
        ``integrals @ x``, for the second-order form q'' = a(q).
    position_weights : Table, shape (k,)
        Weights of ``h^2 a(Q_l)`` in the new position of the second-order form:
        ``b_l (1 - c_l)``, and ``b_l / 2`` for s = 1, where there is no second coefficient.
    """

    k: int
    s: int
    nodes: Table
    weights: Table
    basis: Table
    integrals: Table
    projection: Table
    x: Table
    double_integrals: Table
    position_weights: Table


def xi(i: int) -> float:
    """Return ``xi_i = 1 / (2 sqrt(4 i^2 - 1))`` for i >= 1."""
    return 0.5 / math.sqrt(4.0 * i * i - 1.0)


def polynomials(c: Any, s: int, xi: Callable[[int], Any] = xi) -> list[Any]:
    """Return ``P_0 .. P_{s-1}`` at c, a number or an array of any library, as precise as c and xi are."""
    P = [c * 0.0 + 1.0, (c - 0.5) / xi(1)]
    for j in range(1, s - 1):
        P.append(((c - 0.5) * P[j] - j * xi(j) * P[j - 1]) / ((j + 1) * xi(j + 1)))
    return P[:s]


def integrated(P: Sequence[Any], xi: Callable[[int], Any] = xi) -> list[Any]:
    """Return the integrals of ``P_0 .. P_{s-1}`` from 0 to c, given the values ``P_0 .. P_s`` at c."""
    first = xi(1) * P[1] + 0.5
    return [first, *(xi(j + 1) * P[j + 1] - xi(j) * P[j - 1] for j in range(1, len(P) - 1))]


def legendre(c: Array, s: int) -> Array:
    """Evaluate the orthonormal basis in double precision, inside [0, 1] or out of it.

    Parameters
    ----------
    c : array_like, shape (n,)
        Points.
    s : int
        Number of polynomials, at least 1.

    Returns
    -------
    ndarray, shape (n, s)
        ``P_j(c_i)`` for j = 0 .. s-1.
    """
    return np.stack(polynomials(np.asarray(c, dtype=np.float64), s), axis=1)


def legendre_integrals(c: Array, s: int) -> Array:
    """Evaluate ``int_0^c P_j`` in double precision; arguments and shape as `legendre`."""
    return np.stack(integrated(polynomials(np.asarray(c, dtype=np.float64), s + 1)), axis=1)


def x_matrix(s: int) -> Array:
    """Return ``X_s`` (shape (s, s)) in double precision."""
    below = np.array([xi(i) for i in range(1, s)])
    X = np.diag(below, -1) - np.diag(below, 1)
    X[0, 0] = 0.5
    return X


@lru_cache(maxsize=64)
def tables(k: int, s: int) -> Tables:
    """Make the tables of HBVM(k, s) with 50 digits, rounded to ``hi + lo`` pairs.

    Parameters
    ----------
    k, s : int
        k >= s >= 1.

    Raises
    ------
    problems.errors.InputError
        If not k >= s >= 1.
    """
    if not k >= s >= 1:
        raise InputError(f"HBVM needs k >= s >= 1, not k={k}, s={s}.")
    half = _mp.mpf(1) / 2
    xis = _xis(s)
    nodes, weights = _gauss(k)

    basis = [polynomials(c, s + 1, xis.__getitem__) for c in nodes]
    integrals = [integrated(row, xis.__getitem__) for row in basis]
    double_integrals = [_times_x(row, xis, half) for row in integrals]
    projection = [b * row[j] for j in range(s) for b, row in zip(weights, basis, strict=True)]
    if s == 1:
        position_weights = [b * half for b in weights]
    else:
        position_weights = [b * (1 - c) for b, c in zip(weights, nodes, strict=True)]
    x = [[_mp.mpf(0)] * s for _ in range(s)]
    x[0][0] = half
    for i in range(1, s):
        x[i][i - 1], x[i - 1][i] = xis[i], -xis[i]

    return Tables(
        k=k,
        s=s,
        nodes=Table.rounded(nodes, (k,)),
        weights=Table.rounded(weights, (k,)),
        basis=Table.rounded([v for row in basis for v in row[:s]], (k, s)),
        integrals=Table.rounded([v for row in integrals for v in row], (k, s)),
        projection=Table.rounded(projection, (s, k)),
        x=Table.rounded([v for row in x for v in row], (s, s)),
        double_integrals=Table.rounded([v for row in double_integrals for v in row], (k, s)),
        position_weights=Table.rounded(position_weights, (k,)),
    )


def two_step_extrapolation(k: int, modes: int) -> Array:
    """Return what takes values at the k nodes of two steps to the nodes of the next one, shape (k, 2 k).

    By least squares over ``modes`` polynomials, 2 k at most. The longer the stretch that is known, the less
    far the next step is beyond it: for a field that oscillates by one radian a step, k = 8, what is
    found is 1400 times as near as from the last step alone. Entries are of the size of 1e6: in
    double precision they would be wrong in the tenth digit.
    """
    nodes, _ = _gauss(k)
    modes = min(modes, 2 * k)
    xis = _xis(modes)

    def at(points: list[Any]) -> Any:
        return _mp.matrix([polynomials(c, modes, xis.__getitem__) for c in points])

    known = at([c / 2 for c in nodes] + [(1 + c) / 2 for c in nodes])
    matrix = at([1 + c / 2 for c in nodes]) * _mp.inverse(known.T * known) * known.T
    return np.array(matrix.tolist(), dtype=np.float64)


def _xis(s: int) -> list[Any]:
    """Return ``xi_0 .. xi_s`` with 50 digits."""
    half = _mp.mpf(1) / 2
    return [_mp.mpf(0)] + [half / _mp.sqrt(4 * i * i - 1) for i in range(1, s + 1)]


def _times_x(row: list[Any], xis: list[Any], half: Any) -> list[Any]:
    """Multiply a row with X_s from the right, column by column."""
    s = len(row)
    product = []
    for j in range(s):
        value = row[0] * half if j == 0 else -row[j - 1] * xis[j]
        product.append(value + row[j + 1] * xis[j + 1] if j + 1 < s else value)
    return product


@lru_cache(maxsize=64)
def _gauss(k: int) -> tuple[list[Any], list[Any]]:
    """Nodes and weights on [0, 1] with 50 digits, exactly mirror-symmetric about 1/2.

    Two Newton steps on L_k from NumPy's nodes (14 digits -> 28 -> 56). Nodes
    close to 0 are formed as (1 - x)/2 with 50 digits, so their doubles are as
    relatively exact as all others.
    """
    unity = _mp.mpf(1)
    lower, lower_weights = [], []
    for guess in np.polynomial.legendre.leggauss(k)[0][(k + 1) // 2 :]:
        x = _mp.mpf(float(guess))
        for _ in range(2):
            value, slope = _legendre_and_slope(x, k)
            x -= value / slope
        slope = _legendre_and_slope(x, k)[1]
        lower.append((unity - x) / 2)
        lower_weights.append(unity / ((unity - x * x) * slope * slope))
    middle, middle_weight = [], []
    if k % 2:
        slope = _legendre_and_slope(_mp.mpf(0), k)[1]
        middle, middle_weight = [unity / 2], [unity / (slope * slope)]
    nodes = lower[::-1] + middle + [unity - c for c in lower]
    return nodes, lower_weights[::-1] + middle_weight + lower_weights


def _legendre_and_slope(x: Any, k: int) -> tuple[Any, Any]:
    """L_k(x) and L_k'(x) on [-1, 1], |x| < 1."""
    before, value = _mp.mpf(1), x
    for j in range(1, k):
        before, value = value, ((2 * j + 1) * x * value - j * before) / (j + 1)
    return value, k * (before - x * value) / (1 - x * x)
