"""Sums and products of JAX arrays; imported only once JAX is known to be installed."""

from typing import Any

import jax
import jax.numpy as jnp


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
