"""Jumps and kinks of the field: steps over them are cut until they do not matter."""

from integrators.kernel.context import KINKS_KEPT
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import call_field, total
from integrators.kernel.step.estimate import NARROWEST, block_size, coefficient

OUTSIDE = 100.0  # times the last coefficients: a smooth field is no farther from its polynomial at the ends


@compiled
def kink(ctx, ends):
    """Whether the step that was estimated has a kink that matters; count its place if so.

    Nodes do not see what is between the first or the last of them and the end of the
    step. So if ``ends``, the field there is looked at too where there has been a kink, or
    a step may just have been rejected for one.
    """
    t, h = ctx.t0, ctx.h
    if ctx.kinked == 0:
        suspect = ctx.kinks > 0 or (t - ctx.doubt_end) * h < 0.0
        if ctx.line or not (ends and suspect and differs_at_an_end(ctx)):
            return False
    found, end = ctx.kinks, ctx.kink_end
    if found == 0 or (t - end) * h >= 0.0:
        found += 1
        ctx.kinks = found
        ctx.kink_end = t + h
    if found <= KINKS_KEPT:
        place = ctx.kink_places + 2 * (found - 1)
        place[0] = t
        place[1] = h
    return True


@compiled
def differs_at_an_end(ctx):
    """Whether the field at an end of the solved step is far from what its nodes say there."""
    h, t = abs(ctx.h), ctx.t0
    if h <= NARROWEST * abs(t):
        return False
    rows, lanes, second = ctx.rows, ctx.lanes, ctx.second
    # Stages at both ends, in memory that the solved step does not need any more; idle lanes repeat the last.
    stages, times, values = ctx.stages, ctx.times, ctx.sums
    times[0] = t
    for lane in range(1, lanes):
        times[lane] = t + ctx.h
    for d in range(rows):
        after = 8 * (d // 4) + 4 + d % 4 if second else d
        stages[lanes * d] = ctx.row_state[d]
        for lane in range(1, lanes):
            stages[lanes * d + lane] = ctx.next_state[after]
    call_field(ctx.field, times, stages, ctx.par, values)
    ctx.evaluations += 2
    found = ctx.estimates
    # Unseen for no longer than the part of the step before the first node.
    least = ctx.negligible / (h * ctx.nodes[0])
    for d in range(rows):
        before = abs(values[lanes * d] - total(coefficient(ctx, d, 10)))
        after = abs(values[lanes * d + 1] - total(coefficient(ctx, d, 11)))
        far = max(before, after)
        last = max(found[8 * d + 6], found[8 * d + 7])
        size = block_size(ctx, ctx.block[d])
        if far > OUTSIDE * last and far > least * size:
            return True
    return False
