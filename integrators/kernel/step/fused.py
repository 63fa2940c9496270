"""Whole fixed-point iterations for systems with a few rows, around the traced field.

In a small system an iteration waits for its own results: the stages are stored and loaded by the field, its
values are stored and loaded by the product. Compiled together, one after another, iterations keep stages
and values in registers, as far as there are enough: the sums of three rows of sixteen stages would take 48
registers of AVX2, which has 16, and are made one after another. There a product waits for its loads, and
two rows at a time need two thirds of them, since each column is loaded once for both (an iteration of 16
stages takes 6 to 16 % less on Zen 5 restricted to AVX2). The operations and the order of each sum are those
of `fixed_point.evaluate`, `fixed_point.product8` and `fixed_point.product16`, hence the bits are
(``tests/integrators/kernel/step/test_fused.py``).
"""

from typing import Any

from integrators.kernel.context import EVALUATE, MEASURE, Context
from integrators.kernel.native.attributes import load_anew, view
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.emit import WIDTH
from integrators.kernel.simd.memory import (
    call_field,
    columns,
    combine,
    combine_rows,
    get,
    larger,
    largest,
    put,
    splat8,
    spread,
)
from integrators.kernel.simd.views import as_numbers, as_rows
from problems.targets.called import room

context = view(Context)


def iterations(lanes: int, rows: int, by_columns: bool) -> Any:
    """Return ``void(field, context, count, after)``, with a field behind its address, factors in the matrix.

    It does ``count`` iterations. With ``after`` = `MEASURE`, for one iteration or more, `Scratch.old_stages`
    then holds the stages before the last one, and `Solver.change` the largest change relative to the size of
    its block; with `EVALUATE`, the field's values are then those at the newest stages.

    Parameters
    ----------
    lanes : int
        All stages.
    rows : int
        Components of a stage.
    by_columns : bool
        Whether products go through the matrix once, with the sums of all rows in registers; else eight
        stages of two rows after another, with their values in memory.
    """
    parts = lanes // WIDTH

    @compiled
    def run(field, address, count, after):
        ctx = context(address)
        par, state, base, sizes = ctx.par, ctx.scratch.row_state, ctx.scratch.base, ctx.blocks.weights
        kept_stages, kept_values = as_rows(ctx.stages, lanes), as_rows(ctx.values, lanes)
        stage_rows, value_rows = room(kept_stages, rows), room(kept_stages, rows)
        old_rows = room(kept_stages, rows)
        stages, values, old = as_numbers(stage_rows), as_numbers(value_rows), as_numbers(old_rows)
        for d in range(rows):
            stage_rows[d] = kept_stages[d]
        left = count
        while True:
            call_field(field, ctx.times, stages, par, values)
            if left <= 0:
                break
            for d in range(rows):
                old_rows[d] = stage_rows[d]
            matrix = load_anew(ctx.tables, "matrix")
            if by_columns:
                for part in range(parts):
                    table = columns(matrix, WIDTH * lanes * part, lanes)
                    for d in range(rows):
                        i = lanes * d + WIDTH * part
                        put(stages, i, spread(state, d) + combine(table, values, lanes * d, get(base, i)))
            else:  # loops: their sums are in registers one after another
                pairs = ctx.rows // 2
                for i in range(pairs * parts):
                    d, part = 2 * (i // parts), i % parts
                    place = 2 * lanes * (i // parts) + WIDTH * part
                    starts = get(base, place), get(base, place + lanes)
                    table = WIDTH * lanes * part
                    sums = combine_rows(matrix, table, lanes, values, lanes * d, lanes, starts)
                    put(stages, place, spread(state, d) + sums[0])
                    put(stages, place + lanes, spread(state, d + 1) + sums[1])
                for i in range(2 * pairs * parts, ctx.rows * parts):
                    d, part = i // parts, i % parts
                    table = columns(matrix, WIDTH * lanes * part, lanes)
                    total = combine(table, values, lanes * d, get(base, WIDTH * i))
                    put(stages, WIDTH * i, spread(state, d) + total)
            left -= 1
            if not (left > 0 or after == EVALUATE):
                break
        for d in range(rows):
            kept_stages[d] = stage_rows[d]
            kept_values[d] = value_rows[d]
        if after == MEASURE:
            kept_old = as_rows(ctx.scratch.old_stages, lanes)
            top = splat8(0.0)
            for d in range(rows):
                kept_old[d] = old_rows[d]
                for part in range(parts):
                    i = lanes * d + WIDTH * part
                    top = larger(top, abs(get(stages, i) - get(old, i)) * spread(sizes, d))
            ctx.solver.change = largest(top)

    return run
