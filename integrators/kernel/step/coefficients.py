"""The Legendre coefficients of the field that a step is judged by, from its values at the nodes."""

from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.estimate import (
    AT_ERROR,
    BEFORE_ERROR,
    BEFORE_LAST,
    GAMMA_0,
    GAMMA_1,
    GAMMA_2,
    GAMMA_3,
    LAST,
)
from integrators.kernel.parts.team import COEFFICIENTS
from integrators.kernel.simd.lanes import fma
from integrators.kernel.simd.memory import get, put, splat8, sums
from integrators.kernel.step.share import share, shared
from integrators.kernel.step.stages import offset


@compiled
def coefficient(ctx, row, which):
    """Return eight partial sums of what row ``which`` of the estimators makes of a row of values."""
    values, i, chunks = ctx.values, ctx.lanes * row, ctx.chunks
    table = ctx.estimate.estimators + 8 * chunks * which
    if ctx.route == 8:
        return get(table, 0) * get(values, i)
    if ctx.route == 16:
        return fma(get(table, 8), get(values, i + 8), get(table, 0) * get(values, i))
    result = splat8(0.0)
    for chunk in range(chunks):
        result = fma(get(table, 8 * chunk), get(values, i + offset(ctx, chunk)), result)
    return result


@compiled
def coefficient_of_two(table, which, low, high):
    """As `coefficient`, of two times eight values."""
    return fma(get(table, 16 * which + 8), high, get(table, 16 * which) * low)


@compiled
def take_coefficients_of_two(ctx, first, last):
    """As `take_coefficients_of_rows`, for two times eight stages: the same sums, each value loaded once."""
    gammas, table, values = ctx.estimate.coefficients, ctx.estimate.estimators, ctx.values
    for d in range(first, last):
        x, y = get(values, 16 * d), get(values, 16 * d + 8)
        low = (
            coefficient_of_two(table, GAMMA_0, x, y),
            coefficient_of_two(table, GAMMA_1, x, y),
            coefficient_of_two(table, GAMMA_2, x, y),
            coefficient_of_two(table, GAMMA_3, x, y),
        )
        high = (
            coefficient_of_two(table, BEFORE_ERROR, x, y),
            coefficient_of_two(table, AT_ERROR, x, y),
            coefficient_of_two(table, BEFORE_LAST, x, y),
            coefficient_of_two(table, LAST, x, y),
        )
        put(gammas, 8 * d, abs(sums(*low, *high)))


@compiled
def take_coefficients(ctx):
    """Set what is known of the field from its values in the solved step, row by row."""
    if shared(ctx):
        share(ctx, COEFFICIENTS, ctx.tables.matrix)
    else:
        take_coefficients_of_rows(ctx, 0, ctx.rows)


@compiled
def take_coefficients_of_rows(ctx, first, last):
    """As `take_coefficients`, of the rows from first to last."""
    if ctx.route == 16:
        take_coefficients_of_two(ctx, first, last)
        return
    for d in range(first, last):
        low = (
            coefficient(ctx, d, GAMMA_0),
            coefficient(ctx, d, GAMMA_1),
            coefficient(ctx, d, GAMMA_2),
            coefficient(ctx, d, GAMMA_3),
        )
        high = (
            coefficient(ctx, d, BEFORE_ERROR),
            coefficient(ctx, d, AT_ERROR),
            coefficient(ctx, d, BEFORE_LAST),
            coefficient(ctx, d, LAST),
        )
        put(ctx.estimate.coefficients, 8 * d, abs(sums(*low, *high)))
