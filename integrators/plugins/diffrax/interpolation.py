"""Dense output inside diffrax; imported only once diffrax is known to be installed."""

from typing import Any

import diffrax as dx
import jax
import jax.numpy as jnp

from integrators.coefficients.legendre import integrated, polynomials
from integrators.plugins.diffrax.arithmetic import apply


class LegendreInterpolation(dx.AbstractLocalInterpolation):
    """The polynomial of a step, ``y0 + sum_j G_j int_0^c P_j`` with G the leading axis of the leaves.

    Its error inside the step is O(h^{s+1}), and it does not conserve the energy there;
    at the end of the step it is the solution of order 2s.
    """

    t0: Any
    t1: Any
    y0: Any
    coefficients: Any

    def evaluate(self, t0: Any, t1: Any | None = None, left: bool = True) -> Any:
        """Return the state at ``t0``, or its increment from ``t0`` to ``t1``."""
        if t1 is not None:
            return jax.tree.map(lambda b, a: b - a, self.evaluate(t1), self.evaluate(t0))
        span = self.t1 - self.t0
        c = jnp.asarray((t0 - self.t0) / jnp.where(span == 0.0, 1.0, span))

        def value(y: Any, G: Any) -> Any:
            return y + apply(jnp.stack(integrated(polynomials(c, G.shape[0] + 1)))[None], G)[0]

        return jax.tree.map(value, self.y0, self.coefficients)
