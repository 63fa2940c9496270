"""One fixed-point iteration: field, then stages from its values.

Second-order form: Q = q + (base + kh * sum_j A_j F_j); first-order form the
same with kh = 1. The state is added last, so that one rounding only happens at
its size. Rows are independent and go through the same operations; the columns
of A stay in registers while the rows pass by.
"""

from integrators.kernel.context import EVALUATE, MEASURE, VALUES
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.team import (
    FIELD,
    PRODUCT,
    PRODUCT_AND_CHANGE,
    PRODUCT_FOR_ONE,
    PRODUCT_OF_TWO,
)
from integrators.kernel.routes import WIDE
from integrators.kernel.simd.lanes import fma
from integrators.kernel.simd.memory import (
    call_field,
    call_iterations,
    call_line,
    columns,
    combine,
    combine_only,
    get,
    larger,
    largest,
    put,
    splat8,
    spread,
)
from integrators.kernel.step.share import largest_result, share, shared
from integrators.kernel.step.size import change_of_rows
from integrators.kernel.step.stages import group_offset, offset

INFINITY = float("inf")
TILE = 64  # rows whose new stages are still in the cache when their change is measured


@compiled
def evaluate(ctx):
    """Set the values of the field at the stages, one call per block of them, or those of a line integral."""
    if ctx.line:
        call_line(ctx.line, VALUES, ctx)
        return
    if shared(ctx):
        share(ctx, FIELD, ctx.tables.matrix)
        return
    field, par = ctx.field, ctx.par
    times, stages, values = ctx.times, ctx.stages, ctx.values
    lanes = ctx.lanes
    size = lanes * ctx.padded
    for call in range(ctx.calls):
        call_field(field, times + lanes * call, stages + size * call, par, values + size * call)


@compiled
def product8(ctx, table, first, last):
    """Stages = state + (base + kh * table values), for eight of them; of the rows from first to last."""
    matrix = columns(table, 0, 8)
    stages, values, base, state = ctx.stages, ctx.values, ctx.scratch.base, ctx.scratch.row_state
    if ctx.unit:
        for d in range(first, last):
            put(stages, 8 * d, spread(state, d) + combine(matrix, values, 8 * d, get(base, 8 * d)))
    else:
        factor = ctx.factors.row
        for d in range(first, last):
            moved = fma(spread(factor, d), combine_only(matrix, values, 8 * d), get(base, 8 * d))
            put(stages, 8 * d, spread(state, d) + moved)


@compiled
def product_of_two_of_rows(ctx, table, first, last):
    """As `product8`, of the values of two steps."""
    before, after = columns(table, 0, 8), columns(table, 64, 8)
    stages, values, older, base, state, factor = (
        ctx.stages,
        ctx.values,
        ctx.older_values,
        ctx.scratch.base,
        ctx.scratch.row_state,
        ctx.factors.row,
    )
    unit = ctx.unit
    for d in range(first, last):
        sums = combine(after, values, 8 * d, combine_only(before, older, 8 * d))
        moved = sums if unit else spread(factor, d) * sums
        put(stages, 8 * d, spread(state, d) + (get(base, 8 * d) + moved))


@compiled
def product16(ctx, table, first, last):
    """As `product8`, for sixteen of them, eight at a time."""
    stages, values, base, state = ctx.stages, ctx.values, ctx.scratch.base, ctx.scratch.row_state
    factor, unit = ctx.factors.row, ctx.unit
    for half in range(2):
        matrix = columns(table, 128 * half, 16)
        shift = 8 * half
        if unit:
            for d in range(first, last):
                moved = combine(matrix, values, 16 * d, get(base, 16 * d + shift))
                put(stages, 16 * d + shift, spread(state, d) + moved)
        else:
            for d in range(first, last):
                mean = combine_only(matrix, values, 16 * d)
                moved = fma(spread(factor, d), mean, get(base, 16 * d + shift))
                put(stages, 16 * d + shift, spread(state, d) + moved)


@compiled
def product_for_one_of_rows(ctx, table, first, last):
    """As `product8` and `product16`, with a table for a step of length 1."""
    stages, values, base, state = ctx.stages, ctx.values, ctx.scratch.base, ctx.scratch.row_state
    factor, h = ctx.factors.row, ctx.h
    if ctx.route == 8:
        matrix = columns(table, 0, 8)
        for d in range(first, last):
            moved = fma(h * spread(factor, d), combine_only(matrix, values, 8 * d), get(base, 8 * d))
            put(stages, 8 * d, spread(state, d) + moved)
        return
    for half in range(2):
        matrix = columns(table, 128 * half, 16)
        shift = 8 * half
        for d in range(first, last):
            mean = combine_only(matrix, values, 16 * d)
            moved = fma(h * spread(factor, d), mean, get(base, 16 * d + shift))
            put(stages, 16 * d + shift, spread(state, d) + moved)


@compiled
def multiply(table, chunks, groups, source, source_lanes, target, target_lanes, rows, padded):
    """Target = table source, both in the layout of stage memory, in pieces of 8 x 8."""
    for chunk in range(chunks):
        into = target + group_offset(chunk, padded * target_lanes, target_lanes)
        for group in range(groups):
            outof = source + group_offset(group, padded * source_lanes, source_lanes)
            matrix = columns(table, 64 * (chunk * groups + group), 8)
            if group == 0:
                for d in range(rows):
                    put(into, target_lanes * d, combine_only(matrix, outof, source_lanes * d))
            else:
                for d in range(rows):
                    old = get(into, target_lanes * d)
                    put(into, target_lanes * d, combine(matrix, outof, source_lanes * d, old))


@compiled
def project(ctx, table, groups):
    """Coefficients = table values."""
    project_rows(ctx, table, groups, 0, ctx.rows)


@compiled
def project_rows(ctx, table, groups, first, last):
    """As `project`, of the rows from first to last."""
    values, coefficients = ctx.values + ctx.lanes * first, ctx.scratch.coefficients + 8 * first
    multiply(table, groups, ctx.chunks, values, ctx.lanes, coefficients, 8, last - first, ctx.padded)


@compiled
def displace(ctx, first, last):
    """Stages = state + (base + kh * sums)."""
    scratch, lanes = ctx.scratch, ctx.lanes
    state, factor = scratch.row_state, ctx.factors.row
    for chunk in range(ctx.chunks):
        start = offset(ctx, chunk)
        stages, base, sums = ctx.stages + start, scratch.base + start, scratch.sums + start
        for d in range(first, last):
            i = lanes * d
            put(stages, i, spread(state, d) + fma(spread(factor, d), get(sums, i), get(base, i)))


@compiled
def through(ctx, projection, groups, table, first, last):
    """Stages by way of coefficients: far fewer operations where s is far below k."""
    rows, lanes = last - first, ctx.lanes
    project_rows(ctx, projection, groups, first, last)
    coefficients, sums = ctx.scratch.coefficients + 8 * first, ctx.scratch.sums + lanes * first
    multiply(table, ctx.chunks, groups, coefficients, 8, sums, lanes, rows, ctx.padded)
    displace(ctx, first, last)


@compiled
def wide(ctx, table, first, last):
    """Stages from the values for any number of them."""
    chunks, lanes = ctx.chunks, ctx.lanes
    values, sums = ctx.values + lanes * first, ctx.scratch.sums + lanes * first
    multiply(table, chunks, chunks, values, lanes, sums, lanes, last - first, ctx.padded)
    displace(ctx, first, last)


@compiled
def product_of_rows(ctx, table, first, last):
    """As `product`, of the rows from first to last."""
    route = ctx.route
    if route == 8:
        product8(ctx, table, first, last)
    elif route == 16:
        product16(ctx, table, first, last)
    elif route == WIDE:
        wide(ctx, table, first, last)
    else:
        through(ctx, ctx.tables.projection, ctx.tables.groups, table, first, last)


@compiled
def product(ctx, table):
    """Stages from the field's values, by the route that the sizes call for."""
    if shared(ctx):
        share(ctx, PRODUCT, table)
    else:
        product_of_rows(ctx, table, 0, ctx.rows)


@compiled
def product_of_two(ctx, table):
    """As `product`, of eight values of this step and of the one before."""
    if shared(ctx):
        share(ctx, PRODUCT_OF_TWO, table)
    else:
        product_of_two_of_rows(ctx, table, 0, ctx.rows)


@compiled
def product_for_one(ctx, table):
    """As `product` of 8 or 16 stages, with a table for a step of length 1."""
    if shared(ctx):
        share(ctx, PRODUCT_FOR_ONE, table)
    else:
        product_for_one_of_rows(ctx, table, 0, ctx.rows)


@compiled
def product_and_change_of_rows(ctx, table, first, last):
    """As `product_of_rows`; return eight numbers of which the largest is how far stages have moved."""
    top = splat8(0.0)
    for start in range(first, last, TILE):
        end = min(start + TILE, last)
        product_of_rows(ctx, table, start, end)
        top = larger(top, change_of_rows(ctx, ctx.blocks.weights, start, end))
    return top


@compiled
def product_and_change(ctx, table):
    """As `product`; return the largest change of a stage, relative to the size of its block."""
    if shared(ctx):
        share(ctx, PRODUCT_AND_CHANGE, table)
        return largest_result(ctx)
    return largest(product_and_change_of_rows(ctx, table, 0, ctx.rows))


@compiled
def iterations(ctx, count):
    """Iterate ``count`` times, without a test."""
    for _ in range(count):
        evaluate(ctx)
        product(ctx, ctx.tables.matrix)


@compiled
def iterate_measured(ctx, before):
    """Iterate, ``before`` times and once; return the largest change that the last one made.

    It is relative to the size of its block; NaN if any stage is.
    """
    solver = ctx.solver
    solver.tried += before + 1
    if before > 0:
        solver.last = INFINITY  # the next change does not follow the last one that was measured
    if ctx.fused:
        call_iterations(ctx.fused, ctx, before + 1, MEASURE)
        return solver.change
    iterations(ctx, before)
    evaluate(ctx)
    ctx.stages, ctx.scratch.old_stages = ctx.scratch.old_stages, ctx.stages
    return product_and_change(ctx, ctx.tables.matrix)


@compiled
def iterate_and_evaluate(ctx, count):
    """Iterate ``count`` times, and evaluate the field at the newest stages."""
    ctx.solver.tried += count + 1
    if ctx.fused and count > 0:
        call_iterations(ctx.fused, ctx, count, EVALUATE)
    else:
        iterations(ctx, count)
        evaluate(ctx)
