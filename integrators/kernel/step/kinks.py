"""Jumps and kinks of the field: steps over them are cut until they do not matter."""

from integrators.kernel import layout as at
from integrators.kernel.simd.memory import call_field, get_float, get_int, put_float, put_int, total
from integrators.kernel.step.estimate import NARROWEST, block_size, coefficient
from integrators.kernel.step.sweep import compiled

OUTSIDE = 100.0  # times the last coefficients: a smooth field is no farther from its polynomial at the ends


@compiled
def kink(ctx, ends):
    """Whether the step that was estimated has a kink that matters; count its place if so.

    Nodes do not see what is between the first or the last of them and the end of the
    step. So if ``ends``, the field there is looked at too where there has been a kink, or
    a step may just have been rejected for one.
    """
    t, h = get_float(ctx, at.T0), get_float(ctx, at.H)
    if get_int(ctx, at.KINKED) == 0:
        suspect = get_int(ctx, at.KINKS) > 0 or (t - get_float(ctx, at.DOUBT_END)) * h < 0.0
        if not (ends and suspect and differs_at_an_end(ctx)):
            return False
    found, end = get_int(ctx, at.KINKS), get_float(ctx, at.KINK_END)
    if found == 0 or (t - end) * h >= 0.0:
        found += 1
        put_int(ctx, at.KINKS, found)
        put_float(ctx, at.KINK_END, t + h)
    if found <= at.KINKS_KEPT:
        place = get_int(ctx, at.KINK_PLACES) + 16 * (found - 1)
        put_float(place, 0, t)
        put_float(place, 1, h)
    return True


@compiled
def differs_at_an_end(ctx):
    """Whether the field at an end of the solved step is far from what its nodes say there."""
    h, t = abs(get_float(ctx, at.H)), get_float(ctx, at.T0)
    if h <= NARROWEST * abs(t):
        return False
    rows, lanes, second = get_int(ctx, at.ROWS), get_int(ctx, at.LANES), get_int(ctx, at.SECOND)
    # Stages at both ends, in memory that the solved step does not need any more; idle lanes repeat the last.
    q, times, values = get_int(ctx, at.Q), get_int(ctx, at.TIMES), get_int(ctx, at.SUM)
    put_float(times, 0, t)
    for lane in range(1, lanes):
        put_float(times, lane, t + get_float(ctx, at.H))
    for d in range(rows):
        after = 8 * (d // 4) + 4 + d % 4 if second else d
        put_float(q, lanes * d, get_float(get_int(ctx, at.ROW_STATE), d))
        for lane in range(1, lanes):
            put_float(q, lanes * d + lane, get_float(get_int(ctx, at.NEXT_STATE), after))
    call_field(get_int(ctx, at.FIELD), times, q, get_int(ctx, at.PAR), values)
    put_int(ctx, at.EVALUATIONS, get_int(ctx, at.EVALUATIONS) + 2)
    found = get_int(ctx, at.ESTIMATES)
    # Unseen for no longer than the part of the step before the first node.
    least = get_float(ctx, at.NEGLIGIBLE) / (h * get_float(get_int(ctx, at.NODES), 0))
    for d in range(rows):
        before = abs(get_float(values, lanes * d) - total(coefficient(ctx, d, 10)))
        after = abs(get_float(values, lanes * d + 1) - total(coefficient(ctx, d, 11)))
        far = max(before, after)
        last = max(get_float(found, 8 * d + 6), get_float(found, 8 * d + 7))
        size = block_size(ctx, found + 64 * rows, get_int(get_int(ctx, at.BLOCK), d))
        if far > OUTSIDE * last and far > least * size:
            return True
    return False
