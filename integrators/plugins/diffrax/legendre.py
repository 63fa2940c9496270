"""Legendre polynomials and sums on JAX arrays; imported only once JAX is known to be installed."""

from typing import Any

import jax
import jax.numpy as jnp

from integrators import legendre


def add(y: Any, rest: Any, increment: Any) -> tuple[Any, Any]:
    """Add ``increment`` to the pair (y, rest), exactly but for the rounding of the increment (two-sum)."""

    def add(y: Any, e: Any, increment: Any) -> tuple[Any, Any]:
        small = increment + e
        total = y + small
        part = total - y
        return total, (y - (total - part)) + (small - part)

    pairs = jax.tree.map(add, y, rest, increment)
    return tuple(jax.tree.map(lambda y, pair, i=i: pair[i], y, pairs) for i in range(2))  # pyright: ignore[reportReturnType]


def apply(matrix: Any, x: Any) -> Any:
    """Multiply along the leading axis, in x's own precision.

    Written out, so that XLA fuses it with what stands around it: a call of its
    matrix product costs more than the product, for matrices of this size.
    """
    columns = jnp.asarray(matrix, real(x.dtype)).T.reshape(x.shape[0], -1, *[1] * (x.ndim - 1))
    with jax.numpy_dtype_promotion("standard"):  # real times complex
        product = columns[0] * x[0][None]
        for j in range(1, x.shape[0]):
            product = product + columns[j] * x[j][None]
    return product


def real(dtype: Any) -> Any:
    """Return the real type of the same precision."""
    return jnp.finfo(dtype).dtype


def _xi(j: int) -> float:
    """Return xi_j as a number without a type of its own, which single precision stays single with."""
    return float(legendre.xi(j))


def basis(c: Any, n: int) -> list[Any]:
    """Return P_0 .. P_{n-1} at c."""
    P = [jnp.ones_like(c), (c - 0.5) / _xi(1)]
    for j in range(1, n - 1):
        P.append(((c - 0.5) * P[j] - j * _xi(j) * P[j - 1]) / ((j + 1) * _xi(j + 1)))
    return P[:n]


def integrals(c: Any, n: int) -> list[Any]:
    """Return the integrals of P_0 .. P_{n-1} from 0 to c."""
    P = basis(jnp.asarray(c), n + 1)
    return [c] + [_xi(j + 1) * P[j + 1] - _xi(j) * P[j - 1] for j in range(1, n)]
