"""Jumps and kinks of the field: steps over them are cut until they do not matter."""

from integrators.kernel.context import UNSOLVED
from integrators.kernel.native.jit import compiled, for_both_widths
from integrators.kernel.parts.estimate import AT_START
from integrators.kernel.parts.kinks import EXTRAPOLATED, KINKS_KEPT, NOTHING, SEEN, START
from integrators.kernel.parts.surfaces import AT_ORIGIN
from integrators.kernel.simd.memory import call_field, get, put, total
from integrators.kernel.step.begin import INFINITY
from integrators.kernel.step.control import CLOSE, RETREAT, SHORTEST, SHRINK
from integrators.kernel.step.estimate import (
    NARROWEST,
    OUTSIDE,
    block_size,
    coefficient,
    estimate,
    is_gap,
)

JUST = 1e-12  # part of a step: as near to a breakpoint the field is looked at


@compiled
def kink(ctx, ends):
    """Whether the step that was estimated has a kink that matters; count its place, unless it is a surface's.

    Nodes do not see what is between the first or the last of them and the end of the step. What
    polynomials of two steps say of the field where they meet is compared, if ``ends``. If
    they do not agree, or there has been a kink, or a step may just have been rejected for one, the field
    is evaluated at both ends. `Kinks.undone` says whether the jump is in the step behind.
    """
    kinks, surfaces = ctx.kinks, ctx.surfaces
    kinks.border_ahead = NOTHING
    if kinks.kinked == 0:
        if ctx.line or not (ends and (kinks.doubt < INFINITY or surfaces.crossed)):
            return False
        kinks.border_ahead = EXTRAPOLATED
        suspect = surfaces.crossed or is_near_one(ctx, ctx.h)
        suspect = suspect or kinks.border == START or ends_at_break(ctx)
        if not (suspect or kinks.apart):
            if kinks.border == EXTRAPOLATED:
                kinks.border = SEEN
            return False
        return jumps_at_an_end(ctx, suspect)
    if surfaces.crossed == 0:
        count(ctx, ctx.t0, ctx.h)
    return True


@compiled
def ends_at_break(ctx):
    """Whether the field may jump at the end of the solved step."""
    controller = ctx.controller
    close = CLOSE * max(abs(controller.stop), abs(ctx.h))
    return controller.breaks == 1 and abs((controller.stop - ctx.t0) - ctx.h) <= close


@compiled
def jumps_at_an_end(ctx, suspect):
    """Whether the field jumps where steps meet: by their polynomials or, if suspected, by its values."""
    kinks = ctx.kinks
    if not (suspect or jumps(ctx)):
        if kinks.border == EXTRAPOLATED:
            kinks.border = SEEN
        return False
    if not differs_at_an_end(ctx):
        return kinks.undone == 1
    if ctx.surfaces.crossed == 0:
        count(ctx, ctx.t0, ctx.h)
    return True


@compiled
def count(ctx, t, h):
    """Count the place of a kink in the step from t of length h."""
    kinks = ctx.kinks
    number, end = kinks.count, kinks.end
    if number == 0 or (t - end) * h >= 0.0:
        number += 1
        kinks.count = number
        kinks.end = t + h
    if number <= KINKS_KEPT:
        place = kinks.places + 2 * (number - 1)
        place[0] = t
        place[1] = h


@compiled
def is_near_one(ctx, h):
    """Whether a step of length h lies where one may be: a kink was met, or a step there failed."""
    return ctx.kinks.count > 0 or (ctx.t0 - ctx.kinks.doubt_end) * h < 0.0


@for_both_widths
def gap_allowed(negligible, outermost, h, length_behind):
    """Return how far the polynomials of two steps may be apart where they meet, beside the size of a block.

    The field is not seen for no longer than the parts of both steps beyond their last and first node,
    ``outermost`` of each.
    """
    return negligible / (outermost * (h + length_behind))


@compiled
def jumps(ctx):
    """Whether the step behind and the solved step do not agree about the field where they meet."""
    kinks = ctx.kinks
    if kinks.border <= NOTHING:
        return False
    most = gap_allowed(kinks.negligible, ctx.tables.nodes[0], abs(ctx.h), abs(ctx.controller.length_behind))
    for d in range(ctx.rows):
        far = kinks.gaps[d]
        apart = is_gap(far, kinks.lasts[d], kinks.lasts_behind[d])
        if apart and far > most * block_size(ctx, ctx.blocks.of_row[d]):
            return True
    return False


@compiled
def end_behind(ctx, d):
    """Return what the polynomial of the step behind says of row d of the field at its end."""
    return total(get(ctx.kinks.borders_behind, 8 * d))


@compiled
def differs_at_an_end(ctx):
    """Whether the field at an end of the solved step is far from what its nodes say there.

    Where it may jump, at a breakpoint, it is looked at just inside the step.
    """
    kinks, surfaces = ctx.kinks, ctx.surfaces
    h, t = abs(ctx.h), ctx.t0
    kinks.undone = 0
    if h <= NARROWEST * abs(t):
        return False
    rows, lanes, second = ctx.rows, ctx.lanes, ctx.second
    # Stages at both ends, in memory that the solved step does not need any more; idle lanes repeat the last.
    stages, times, values = ctx.scratch.old_stages, ctx.times, ctx.scratch.sums
    inside = max(JUST * h, 2.0 * SHORTEST * abs(t))
    inside = inside if ctx.h > 0.0 else -inside
    times[0] = t + inside if kinks.border == START else t
    for lane in range(1, lanes):
        times[lane] = t + ctx.h - inside if ends_at_break(ctx) else t + ctx.h
    for d in range(rows):
        place = 8 * (d // 4) + 4 + d % 4 if second else d
        stages[lanes * d] = ctx.state[place]
        for lane in range(1, lanes):
            stages[lanes * d + lane] = ctx.next_state[place]
    call_field(ctx.field, times, stages, ctx.par, values)
    ctx.counters.evaluations += 2
    # Unseen for no longer than the part of the step before the first node.
    least = kinks.negligible / (h * ctx.tables.nodes[0])
    undone = 0
    for d in range(rows):
        before = abs(values[lanes * d] - total(coefficient(ctx, d, AT_START)))
        after = abs(values[lanes * d + 1] - total(get(kinks.borders, 8 * d)))
        # On a switching surface rounding tells on which side the state is.
        if surfaces.on_surface:
            before = 0.0
        if surfaces.locating:
            after = 0.0
        far = max(finite(before), finite(after))
        # A crossing beyond the last node is no smooth field's distance from its polynomial.
        smooth = 0.0 if surfaces.crossed else OUTSIDE * kinks.lasts[d]
        if far > smooth and far > least * block_size(ctx, ctx.blocks.of_row[d]):
            return True
        if kinks.border == EXTRAPOLATED and misses(ctx, d, values[lanes * d]):
            undone = 1
    kinks.undone = undone
    kinks.border_ahead = SEEN
    return False


@compiled
def finite(far):
    """Return how far the field is from its polynomial; 0 where the field is infinite or not a number.

    At a singularity that can be integrated over it is infinite beside a step of any length; whether the step
    is short enough follows from its nodes.
    """
    return far if far < INFINITY else 0.0


@compiled
def misses(ctx, d, value):
    """Whether the polynomial of the step behind is far from the field's value at its end, in row d."""
    far = finite(abs(value - end_behind(ctx, d)))
    least = ctx.kinks.negligible / (abs(ctx.controller.length_behind) * ctx.tables.nodes[0])
    return far > OUTSIDE * ctx.kinks.lasts_behind[d] and far > least * block_size(ctx, ctx.blocks.of_row[d])


@compiled
def keep_end_of_part(ctx, partial):
    """Let the step ahead be compared with the partial step in ``partial``, at whose end it begins."""
    ctx.kinks.border = NOTHING
    if ctx.line or ctx.implicit.active or not ctx.kinks.doubt < INFINITY:
        return
    estimate(partial)
    for d in range(ctx.rows):
        put(ctx.kinks.borders_behind, 8 * d, get(partial.kinks.borders, 8 * d))
        ctx.kinks.lasts_behind[d] = partial.kinks.lasts[d]
    ctx.kinks.border = SEEN


@compiled
def keep_end(ctx):
    """Keep what is known of the end of the step ahead, and where to go back to, before it is taken."""
    behind, kinks = ctx.behind, ctx.kinks
    kinks.borders, kinks.borders_behind = kinks.borders_behind, kinks.borders
    kinks.lasts, kinks.lasts_behind = kinks.lasts_behind, kinks.lasts
    kinks.border, kinks.border_ahead = kinks.border_ahead, NOTHING
    behind.t0, behind.time_low = ctx.t0, ctx.time_low
    behind.on_surface = ctx.surfaces.on_surface


@compiled
def undo(ctx):
    """Go back to before the step behind, for a shorter one; count the place of a kink in that."""
    controller, behind = ctx.controller, ctx.behind
    h = controller.length_behind
    ctx.state, behind.state = behind.state, ctx.state
    ctx.error, behind.error = behind.error, ctx.error
    ctx.t0, ctx.time_low, ctx.n = behind.t0, behind.time_low, 0
    controller.next_length = RETREAT * h
    controller.length_behind = 0.0
    ctx.kinks.border = NOTHING
    ctx.surfaces.on_surface, ctx.surfaces.row = AT_ORIGIN if behind.on_surface else 0, 0
    ctx.kinks.undone = 0
    ctx.counters.steps -= 1
    forget(ctx)
    count(ctx, ctx.t0, h)


@compiled
def forget(ctx):
    """Forget the step ahead."""
    ctx.solved = UNSOLVED
    ctx.length = 0.0
    ctx.blocks.age = 0
    ctx.counters.rejections += 1


@compiled
def holds(ctx):
    """Whether the field does not jump in the solved step beyond its nodes; else forget the step."""
    if ctx.kinks.border_ahead != EXTRAPOLATED:
        return True
    if not differs_at_an_end(ctx):
        return True
    count(ctx, ctx.t0, ctx.h)
    ctx.controller.next_length = SHRINK * ctx.h
    forget(ctx)
    return False


@compiled
def arrived(ctx):
    """Whether the field does not jump before the end of the step behind; else undo that."""
    controller = ctx.controller
    if ctx.kinks.border != EXTRAPOLATED:
        return True
    if controller.breaks == 1 and abs(controller.stop - ctx.t0) <= CLOSE * abs(controller.stop):
        return True
    rows, lanes, second = ctx.rows, ctx.lanes, ctx.second
    stages, times, values = ctx.scratch.old_stages, ctx.times, ctx.scratch.sums
    for lane in range(lanes):
        times[lane] = ctx.t0
    for d in range(rows):
        place = 8 * (d // 4) + 4 + d % 4 if second else d
        for lane in range(lanes):
            stages[lanes * d + lane] = ctx.state[place]
    call_field(ctx.field, times, stages, ctx.par, values)
    ctx.counters.evaluations += 1
    ctx.kinks.border = SEEN
    for d in range(rows):
        if misses(ctx, d, values[lanes * d]):
            undo(ctx)
            return False
    return True
