"""Discontinuities of the field and of its derivatives: steps over them are cut until they do not matter."""

from integrators.kernel.context import UNSOLVED
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.discontinuities import EXTRAPOLATED, MOST_RECORDED, NOTHING, SEEN, START
from integrators.kernel.parts.estimate import AT_START
from integrators.kernel.parts.surfaces import AT_ORIGIN
from integrators.kernel.simd.memory import call_field, get, put, total
from integrators.kernel.step.begin import INFINITY
from integrators.kernel.step.coefficients import coefficient
from integrators.kernel.step.control import RETREAT, SHORTEST, SHRINK, TIME_TOLERANCE
from integrators.kernel.step.estimate import NARROWEST, SMOOTH_GAP, block_size, estimate, is_gap
from integrators.kernel.step.rounding import measure_noise, measure_noise_behind, noise_at_end
from integrators.kernel.step.sample import put_in_lanes
from integrators.kernel.step.sums import time_after

BREAKPOINT_OFFSET = 1e-12  # part of a step: as near to a breakpoint the field is looked at


@compiled
def has_discontinuity(ctx, ends):
    """Whether the estimated step has a discontinuity that matters; record it, unless it is a surface's.

    Nodes do not see what is between the first or the last of them and the end of the step. What
    polynomials of two steps say of the field where they meet is compared, if ``ends``. If
    they do not agree, or there has been a discontinuity, or a step may just have been rejected for one, the
    field is evaluated at both ends. `Discontinuities.undone` says whether the jump is in the previous step.
    """
    discontinuities, surfaces = ctx.discontinuities, ctx.surfaces
    discontinuities.next_boundary = NOTHING
    if discontinuities.not_smooth == 0:
        if ctx.line or not (ends and (discontinuities.doubt < INFINITY or surfaces.crossed)):
            return False
        discontinuities.next_boundary = EXTRAPOLATED
        suspect = surfaces.crossed or is_near_discontinuity(ctx, ctx.h)
        suspect = suspect or discontinuities.boundary == START or ends_at_break(ctx)
        if not (suspect or discontinuities.apart):
            if discontinuities.boundary == EXTRAPOLATED:
                discontinuities.boundary = SEEN
            return False
        return jumps_at_an_end(ctx, suspect)
    record_unknown(ctx)
    return True


@compiled
def record_unknown(ctx):
    """Record a discontinuity in the solved step, unless that lies beside a breakpoint or crosses a surface.

    There it is known, and rounding may let the field switch a little earlier or later; what else is in the
    step is found by the shorter ones that follow.
    """
    known = ctx.surfaces.crossed or ctx.discontinuities.boundary == START or ends_at_break(ctx)
    if not known:
        record(ctx, ctx.t0, ctx.h)


@compiled
def ends_at_break(ctx):
    """Whether the field may jump at the end of the solved step."""
    controller = ctx.controller
    close = TIME_TOLERANCE * max(abs(controller.stop), abs(ctx.h))
    return controller.breaks == 1 and abs((controller.stop - ctx.t0) - ctx.h) <= close


@compiled
def jumps_at_an_end(ctx, suspect):
    """Whether the field jumps where steps meet: by their polynomials or, if suspected, by its values."""
    discontinuities = ctx.discontinuities
    if not (suspect or jumps(ctx)):
        if discontinuities.boundary == EXTRAPOLATED:
            discontinuities.boundary = SEEN
        return False
    if not differs_at_an_end(ctx):
        return discontinuities.undone == 1
    record_unknown(ctx)
    return True


@compiled
def record(ctx, t, h):
    """Record the place of a discontinuity in the step from t of length h."""
    discontinuities = ctx.discontinuities
    number, end = discontinuities.count, discontinuities.end
    if number == 0 or (t - end) * h >= 0.0:
        number += 1
        discontinuities.count = number
        discontinuities.end = t + h
    if number <= MOST_RECORDED:
        pair = discontinuities.records + 2 * (number - 1)
        pair[0] = t
        pair[1] = h


@compiled
def is_near_discontinuity(ctx, h):
    """Whether a step of length h lies where one may be: a discontinuity was met, or a step there failed."""
    return ctx.discontinuities.count > 0 or (ctx.t0 - ctx.discontinuities.doubt_end) * h < 0.0


@compiled
def gap_allowed(negligible, outermost, h, previous_length):
    """Return how far the polynomials of two steps may be apart where they meet, beside the size of a block.

    The field is not seen for no longer than the parts of both steps beyond their last and first node,
    ``outermost`` of each.
    """
    return negligible / (outermost * (h + previous_length))


@compiled
def jumps(ctx):
    """Whether the previous step and the solved step do not agree about the field where they meet."""
    discontinuities = ctx.discontinuities
    if discontinuities.boundary <= NOTHING:
        return False
    most = gap_allowed(
        discontinuities.negligible, ctx.tables.nodes[0], abs(ctx.h), abs(ctx.controller.previous_length)
    )
    for d in range(ctx.rows):
        far = discontinuities.gaps[d]
        apart = is_gap(
            far, discontinuities.last_coefficients[d], discontinuities.previous_last_coefficients[d]
        )
        if apart and far > most * block_size(ctx, ctx.blocks.of_row[d]):
            return True
    return False


@compiled
def previous_end(ctx, d):
    """Return what the polynomial of the previous step says of row d of the field at its end."""
    return total(get(ctx.discontinuities.previous_boundary_values, 8 * d))


@compiled
def differs_at_an_end(ctx):
    """Whether the field at an end of the solved step is farther from what its nodes say there than noise."""
    ctx.discontinuities.undone = 0
    if abs(ctx.h) <= NARROWEST * abs(ctx.t0):
        return False
    differs = look_at_ends(ctx)
    if (differs or ctx.discontinuities.undone) and not ctx.estimate.measured:
        measure_noise(ctx)
        differs = look_at_ends(ctx)
    return differs


@compiled
def look_at_ends(ctx):
    """As `differs_at_an_end`, by noise only where that was measured.

    Where the field may jump, at a breakpoint, it is looked at just inside the step, beyond what rounding has.
    """
    discontinuities, surfaces = ctx.discontinuities, ctx.surfaces
    h, t = abs(ctx.h), ctx.t0
    discontinuities.undone = 0
    rows, lanes = ctx.rows, ctx.lanes
    # Stages at both ends, in memory that the solved step does not need any more; idle lanes repeat the last.
    stages, times, values = ctx.scratch.old_stages, ctx.times, ctx.scratch.sums
    inside = max(BREAKPOINT_OFFSET * h, 2.0 * SHORTEST * abs(t))
    sign = 1.0 if ctx.h > 0.0 else -1.0
    start = t
    if discontinuities.boundary == START:
        start += sign * max(inside, discontinuities.resolution)
    end, _ = time_after(t, ctx.time_low, ctx.h)  # which is not beyond that of the integration by rounding
    if ends_at_break(ctx):
        end -= sign * max(inside, ctx.controller.resolution)
    put_in_lanes(ctx, times, stages, start, end, ctx.next_state)
    call_field(ctx.field, times, stages, ctx.par, values)
    ctx.counters.evaluations += 2
    # Unseen for no longer than the part of the step before the first node.
    least = discontinuities.negligible / (h * ctx.tables.nodes[0])
    undone = 0
    for d in range(rows):
        before = abs(values[lanes * d] - total(coefficient(ctx, d, AT_START)))
        after = abs(values[lanes * d + 1] - total(get(discontinuities.boundary_values, 8 * d)))
        # On a switching surface rounding tells on which side the state is.
        if surfaces.on_surface:
            before = 0.0
        if surfaces.locating:
            after = 0.0
        far = max(finite(before), finite(after))
        # A crossing beyond the last node is no smooth field's distance from its polynomial.
        smooth = 0.0 if surfaces.crossed else discontinuities.last_coefficients[d]
        smooth = max(SMOOTH_GAP * smooth, noise_at_end(ctx, d))
        if far > smooth and far > least * block_size(ctx, ctx.blocks.of_row[d]):
            return True
        if discontinuities.boundary == EXTRAPOLATED and differs_from_previous(ctx, d, values[lanes * d]):
            undone = 1
    discontinuities.undone = undone
    discontinuities.next_boundary = SEEN
    return False


@compiled
def finite(far):
    """Return how far the field is from its polynomial; 0 where the field is infinite or not a number.

    At a singularity that can be integrated over it is infinite beside a step of any length; whether the step
    is short enough follows from its nodes.
    """
    return far if far < INFINITY else 0.0


@compiled
def differs_from_previous(ctx, d, value):
    """Whether the polynomial of the previous step is far from the field's value at its end, in row d."""
    far = finite(abs(value - previous_end(ctx, d)))
    least = ctx.discontinuities.negligible / (abs(ctx.controller.previous_length) * ctx.tables.nodes[0])
    smooth = max(SMOOTH_GAP * ctx.discontinuities.previous_last_coefficients[d], noise_at_end(ctx, d))
    return far > smooth and far > least * block_size(ctx, ctx.blocks.of_row[d])


@compiled
def keep_end_of_part(ctx, partial):
    """Let the step ahead be compared with the partial step in ``partial``, at whose end it begins."""
    ctx.discontinuities.boundary = NOTHING
    if ctx.line or ctx.implicit.active or not ctx.discontinuities.doubt < INFINITY:
        return
    estimate(partial)
    for d in range(ctx.rows):
        put(
            ctx.discontinuities.previous_boundary_values,
            8 * d,
            get(partial.discontinuities.boundary_values, 8 * d),
        )
        ctx.discontinuities.previous_last_coefficients[d] = partial.discontinuities.last_coefficients[d]
    ctx.discontinuities.boundary = SEEN


@compiled
def keep_end(ctx):
    """Keep what is known of the end of the step ahead, and where to go back to, before it is taken."""
    previous, discontinuities = ctx.previous, ctx.discontinuities
    discontinuities.boundary_values, discontinuities.previous_boundary_values = (
        discontinuities.previous_boundary_values,
        discontinuities.boundary_values,
    )
    discontinuities.last_coefficients, discontinuities.previous_last_coefficients = (
        discontinuities.previous_last_coefficients,
        discontinuities.last_coefficients,
    )
    discontinuities.boundary, discontinuities.next_boundary = discontinuities.next_boundary, NOTHING
    previous.t0, previous.time_low = ctx.t0, ctx.time_low
    previous.on_surface = ctx.surfaces.on_surface


@compiled
def undo(ctx):
    """Go back to before the previous step, for a shorter one; record the place of a discontinuity in that."""
    controller, previous = ctx.controller, ctx.previous
    h = controller.previous_length
    ctx.state, previous.state = previous.state, ctx.state
    ctx.error, previous.error = previous.error, ctx.error
    ctx.t0, ctx.time_low, ctx.n = previous.t0, previous.time_low, 0
    controller.next_length = RETREAT * h
    controller.previous_length = 0.0
    ctx.discontinuities.boundary = NOTHING
    ctx.surfaces.on_surface, ctx.surfaces.row = AT_ORIGIN if previous.on_surface else 0, 0
    ctx.discontinuities.undone = 0
    ctx.counters.steps -= 1
    forget(ctx)
    record(ctx, ctx.t0, h)


@compiled
def forget(ctx):
    """Forget the step ahead."""
    ctx.solved = UNSOLVED
    ctx.length = 0.0
    ctx.blocks.age = 0
    ctx.counters.rejections += 1


@compiled
def is_smooth_to_end(ctx):
    """Whether the field does not jump in the solved step beyond its nodes; else forget the step."""
    if ctx.discontinuities.next_boundary != EXTRAPOLATED:
        return True
    if not differs_at_an_end(ctx):
        return True
    record_unknown(ctx)
    ctx.controller.next_length = SHRINK * ctx.h
    forget(ctx)
    return False


@compiled
def confirm_previous_step(ctx):
    """Whether the field does not jump before the end of the previous step; else undo that."""
    controller = ctx.controller
    if ctx.discontinuities.boundary != EXTRAPOLATED:
        return True
    if controller.breaks == 1 and abs(controller.stop - ctx.t0) <= TIME_TOLERANCE * abs(controller.stop):
        return True
    stages, times = ctx.scratch.old_stages, ctx.times
    put_in_lanes(ctx, times, stages, ctx.t0, ctx.t0, ctx.state)
    call_field(ctx.field, times, stages, ctx.par, ctx.scratch.sums)
    ctx.counters.evaluations += 1
    ctx.discontinuities.boundary = SEEN
    ctx.estimate.measured = ctx.estimate.noisy
    if differs_behind(ctx):
        measure_noise_behind(ctx)
        if differs_behind(ctx):
            undo(ctx)
            return False
    ctx.discontinuities.undone = 0
    return True


@compiled
def differs_behind(ctx):
    """Whether the field at the state, in ``sums``, is not what the polynomial of the previous step says."""
    differs = False
    for d in range(ctx.rows):
        differs |= differs_from_previous(ctx, d, ctx.scratch.sums[ctx.lanes * d])
    return differs
