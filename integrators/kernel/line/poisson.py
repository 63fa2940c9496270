"""Values along which a Poisson system y' = B(y) grad H(y) keeps its energy."""

from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import get, put, splat8
from integrators.kernel.step.fixed_point import multiply
from integrators.kernel.step.stages import group_offset, offset


@compiled
def keep_energy(ctx):
    """Set ``values`` to B(Y_l) sum_i P_i(c_l) G_i with the Legendre coefficients G of grad H."""
    dim, lanes, every = ctx.rows, ctx.lanes, ctx.every
    multiply(ctx.onto, ctx.coefficient_groups, ctx.chunks, ctx.gradients, lanes, ctx.legendre, 8, dim, every)
    multiply(ctx.back, ctx.chunks, ctx.coefficient_groups, ctx.legendre, 8, ctx.remainders, lanes, dim, every)
    for chunk in range(ctx.chunks):
        start = group_offset(chunk, every * lanes, lanes)
        structure, slope = ctx.gradients + start, ctx.remainders + start
        values = ctx.values + offset(ctx, chunk)
        for d in range(dim):
            value = splat8(0.0)
            for b in range(dim):
                value += get(structure, lanes * (dim * (1 + d) + b)) * get(slope, lanes * b)
            put(values, lanes * d, value)
