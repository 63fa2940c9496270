"""One sweep of the fixed-point iteration: field, then stages from its values.

Second-order form: Q = q + (base + kh * sum_j A_j F_j); first-order form the
same with kh = 1. The state is added last, so that one rounding only happens at
its size. Rows are independent and go through the same operations; the columns
of A stay in registers while the rows pass by.
"""

from typing import Any, cast

import numba

from integrators.kernel import layout as at
from integrators.kernel.simd.lanes import fma
from integrators.kernel.simd.memory import (
    call_field,
    columns,
    combine,
    combine_only,
    get,
    get_int,
    larger,
    largest,
    put,
    put_int,
    splat8,
    spread,
)  # fmt: skip

compiled = cast(Any, numba.njit)(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)


@compiled
def evaluate(ctx):
    """F = f(T, Q), one call per block of stages."""
    field = get_int(ctx, at.FIELD)
    t = get_int(ctx, at.TIMES)
    q = get_int(ctx, at.Q)
    f = get_int(ctx, at.F)
    par = get_int(ctx, at.PAR)
    lanes = get_int(ctx, at.LANES)
    size = 8 * lanes * get_int(ctx, at.PADDED)
    for block in range(get_int(ctx, at.BLOCKS)):
        call_field(field, t + 8 * lanes * block, q + size * block, par, f + size * block)


@compiled
def place(chunk, block, lanes):
    """Index of a group of eight lanes where blocks of ``block`` doubles have rows of 8 or 16 lanes."""
    shift = lanes >> 4
    return (chunk >> shift) * block + 8 * (chunk & shift)


@compiled
def offset(ctx, chunk):
    """Index in stage memory of the first row of a group of eight stages."""
    lanes = get_int(ctx, at.LANES)
    return place(chunk, get_int(ctx, at.PADDED) * lanes, lanes)


@compiled
def product8(ctx, table):
    """Q = state + (base + kh * table F) for eight stages."""
    matrix = columns(table, 0, 8)
    q = get_int(ctx, at.Q)
    f = get_int(ctx, at.F)
    base = get_int(ctx, at.BASE)
    state = get_int(ctx, at.ROW_STATE)
    rows = get_int(ctx, at.ROWS)
    if get_int(ctx, at.UNIT):
        for d in range(rows):
            put(q, 8 * d, spread(state, d) + combine(matrix, f, 8 * d, get(base, 8 * d)))
    else:
        factor = get_int(ctx, at.ROW_FACTOR)
        for d in range(rows):
            moved = fma(spread(factor, d), combine_only(matrix, f, 8 * d), get(base, 8 * d))
            put(q, 8 * d, spread(state, d) + moved)


@compiled
def product16(ctx, table):
    """Q = state + (base + kh * table F) for sixteen stages, eight at a time."""
    q = get_int(ctx, at.Q)
    f = get_int(ctx, at.F)
    base = get_int(ctx, at.BASE)
    state = get_int(ctx, at.ROW_STATE)
    factor = get_int(ctx, at.ROW_FACTOR)
    rows = get_int(ctx, at.ROWS)
    unit = get_int(ctx, at.UNIT)
    for half in range(2):
        matrix = columns(table, 128 * half, 16)
        shift = 8 * half
        if unit:
            for d in range(rows):
                moved = combine(matrix, f, 16 * d, get(base, 16 * d + shift))
                put(q, 16 * d + shift, spread(state, d) + moved)
        else:
            for d in range(rows):
                moved = fma(spread(factor, d), combine_only(matrix, f, 16 * d), get(base, 16 * d + shift))
                put(q, 16 * d + shift, spread(state, d) + moved)


@compiled
def multiply(table, chunks, groups, source, source_lanes, target, target_lanes, rows, padded):
    """Target = table source, both in the layout of stage memory, in pieces of 8 x 8."""
    for chunk in range(chunks):
        into = target + 8 * place(chunk, padded * target_lanes, target_lanes)
        for group in range(groups):
            outof = source + 8 * place(group, padded * source_lanes, source_lanes)
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
    """COEFFICIENTS = table F."""
    multiply(
        table, groups, get_int(ctx, at.CHUNKS), get_int(ctx, at.F), get_int(ctx, at.LANES),
        get_int(ctx, at.COEFFICIENTS), 8, get_int(ctx, at.ROWS), get_int(ctx, at.PADDED),
    )  # fmt: skip


@compiled
def displace(ctx):
    """Q = state + (base + kh * SUM)."""
    rows = get_int(ctx, at.ROWS)
    lanes = get_int(ctx, at.LANES)
    state = get_int(ctx, at.ROW_STATE)
    factor = get_int(ctx, at.ROW_FACTOR)
    for chunk in range(get_int(ctx, at.CHUNKS)):
        start = 8 * offset(ctx, chunk)
        q = get_int(ctx, at.Q) + start
        base = get_int(ctx, at.BASE) + start
        moves = get_int(ctx, at.SUM) + start
        for d in range(rows):
            i = lanes * d
            put(q, i, spread(state, d) + fma(spread(factor, d), get(moves, i), get(base, i)))


@compiled
def through(ctx, projection, groups, table):
    """Q = state + (base + kh * table (projection F)): far fewer operations where s is far below k."""
    lanes = get_int(ctx, at.LANES)
    project(ctx, projection, groups)
    multiply(
        table, get_int(ctx, at.CHUNKS), groups, get_int(ctx, at.COEFFICIENTS), 8,
        get_int(ctx, at.SUM), lanes, get_int(ctx, at.ROWS), get_int(ctx, at.PADDED),
    )  # fmt: skip
    displace(ctx)


@compiled
def wide(ctx, table):
    """Q = state + (base + kh * table F) for any number of stages."""
    lanes = get_int(ctx, at.LANES)
    chunks = get_int(ctx, at.CHUNKS)
    multiply(
        table, chunks, chunks, get_int(ctx, at.F), lanes,
        get_int(ctx, at.SUM), lanes, get_int(ctx, at.ROWS), get_int(ctx, at.PADDED),
    )  # fmt: skip
    displace(ctx)


@compiled
def product(ctx, table):
    """Stages from the field's values, by the route that the sizes call for."""
    route = get_int(ctx, at.ROUTE)
    if route == 8:
        product8(ctx, table)
    elif route == 16:
        product16(ctx, table)
    elif route == at.WIDE:
        wide(ctx, table)
    else:
        through(ctx, get_int(ctx, at.PROJECTION), get_int(ctx, at.COEFFICIENT_CHUNKS), table)


@compiled
def product_tested(ctx, table):
    """As `product`, and return the largest change relative to the size of its block; NaN if any stage is."""
    before = get_int(ctx, at.Q)
    put_int(ctx, at.Q, get_int(ctx, at.OTHER_Q))
    put_int(ctx, at.OTHER_Q, before)
    product(ctx, table)
    return change(ctx, get_int(ctx, at.STRICT))


@compiled
def change(ctx, scale):
    """Return the largest of Q - OTHER_Q in size, each row times its scale; NaN if any is."""
    new = get_int(ctx, at.Q)
    old = get_int(ctx, at.OTHER_Q)
    rows = get_int(ctx, at.ROWS)
    lanes = get_int(ctx, at.LANES)
    top = splat8(0.0)
    for chunk in range(get_int(ctx, at.CHUNKS)):
        start = 8 * offset(ctx, chunk)
        for d in range(rows):
            moved = abs(get(new + start, lanes * d) - get(old + start, lanes * d))
            top = larger(top, moved * spread(scale, d))
    return largest(top)
