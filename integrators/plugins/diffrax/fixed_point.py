"""A fixed-point iteration that goes on to round-off, as an optimistix root finder.

JAX traces and differentiates it, on any device and in either precision, which the kernel's machine code
cannot be. The rule of what counts as rounding is the kernel's, with changes in units of the precision's.

Imported only once optimistix is known to be installed.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from integrators.plugins.rule import CONVERGED, FLOOR, STAGNATION, STAGNATION_LIMIT, is_rounding

HOPELESS = 8  # changes that are no new smallest one, above STAGNATION, after which the iteration has failed
EPSILON = float(np.finfo(np.float64).eps)  # changes are in units of the precision's: single has the same rule


class _State(eqx.Module):
    """Where the iteration stands: last and smallest change, changes without progress, and starts."""

    strict: jax.Array
    best: jax.Array
    stalled: jax.Array
    steps: jax.Array
    restarted: jax.Array
    lost: jax.Array


class FixedPoint(optx.AbstractRootFinder):
    """Iterate ``x <- x - fn(x)`` until the change is round-off.

    The change is measured relative to the size of each component: that of
    ``options["state"]`` (structure of x without its leading axis) plus the
    largest along x's leading axis. The iteration ends when the change is at most
    0.45 epsilon, or has stopped decreasing: once while below 4.5 epsilon, or
    `integrators.plugins.rule.STAGNATION_LIMIT` times while below 450 epsilon.
    Where it does not contract it fails with ``nonlinear_divergence``; but if
    ``options["guessed"]`` says that the first x was a guess, it is first tried from 0.

    The tolerances that every optimistix root finder has are not used.
    """

    rtol: float = 0.0
    atol: float = 0.0
    norm: Callable[[Any], Any] = optx.max_norm

    def init(
        self, fn: Any, y: Any, args: Any, options: dict[str, Any], f_struct: Any, aux_struct: Any, tags: Any
    ) -> _State:
        """Return the state before the first iteration."""
        inf, zero = jnp.asarray(jnp.inf, _widest(y)), jnp.asarray(0)
        return _State(inf, inf, zero, zero, ~jnp.asarray(options["guessed"]), jnp.asarray(False))

    def step(
        self, fn: Any, y: Any, args: Any, options: dict[str, Any], state: _State, tags: Any
    ) -> tuple[Any, _State, Any]:
        """Iterate once."""
        difference, aux = fn(y, args)
        new = jax.tree.map(lambda a, b: a - b, y, difference)
        strict, floored = _change(options["state"], new, difference)
        better = floored < state.best
        stalled = jnp.where(better, 0, state.stalled + 1)
        best = jnp.minimum(state.best, floored)
        hopeless = ~jnp.isfinite(strict) | ((stalled >= HOPELESS) & (best >= STAGNATION / EPSILON))
        again = hopeless & ~state.restarted
        new = jax.tree.map(lambda x: jnp.where(again, jnp.zeros_like(x), x), new)
        state = _State(
            strict=strict,
            best=jnp.where(again, jnp.inf, best),
            stalled=jnp.where(again, 0, stalled),
            steps=state.steps + 1,
            restarted=state.restarted | hopeless,
            lost=hopeless & state.restarted,
        )
        return new, state, aux

    def terminate(
        self, fn: Any, y: Any, args: Any, options: dict[str, Any], state: _State, tags: Any
    ) -> tuple[jax.Array, Any]:
        """Return whether to stop, and how it went."""
        repeated = state.stalled >= STAGNATION_LIMIT
        stagnates = (state.stalled > 0) & is_rounding(state.best * EPSILON, repeated, STAGNATION)
        done = (state.strict <= CONVERGED / EPSILON) | stagnates
        result = optx.RESULTS.where(state.lost, optx.RESULTS.nonlinear_divergence, optx.RESULTS.successful)
        return done | state.lost, result

    def postprocess(
        self,
        fn: Any,
        y: Any,
        aux: Any,
        args: Any,
        options: dict[str, Any],
        state: _State,
        tags: Any,
        result: Any,
    ) -> tuple[Any, Any, dict[str, Any]]:
        """Return the solution as it is."""
        return y, aux, {}


def _change(state: Any, new: Any, difference: Any) -> tuple[jax.Array, jax.Array]:
    """Largest change in epsilons, relative to each component's size and to its floored size."""
    dtype = _widest(new)
    strict, floored = jnp.zeros((), dtype), jnp.zeros((), dtype)
    for y, x, d in zip(*map(jax.tree.leaves, (state, new, difference)), strict=True):
        if x.size == 0:
            continue
        size = jnp.abs(y) + jnp.max(jnp.abs(x), axis=0)
        moved = jnp.max(jnp.abs(d), axis=0) / jnp.finfo(x.dtype).eps
        ratio = jnp.max(jnp.where(moved == 0.0, 0.0, moved / size))
        size = jnp.maximum(size, FLOOR * jnp.max(size))
        ratio_floored = jnp.max(jnp.where(moved == 0.0, 0.0, moved / size))
        strict = jnp.maximum(strict, ratio.astype(dtype))
        floored = jnp.maximum(floored, ratio_floored.astype(dtype))
    return strict, floored


def _widest(tree: Any) -> Any:
    """Return the widest of the leaves' real types."""
    return np.result_type(*[jnp.finfo(x.dtype).dtype for x in jax.tree.leaves(tree)], np.float32)
