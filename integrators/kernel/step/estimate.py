"""Estimates from the Legendre coefficients that the polynomial of a step leaves out."""

from math import log

from integrators.kernel import tolerance
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.estimate import (
    AFTER_MIDDLE,
    AT_END,
    AT_ERROR,
    AT_START,
    BEFORE_ERROR,
    BEFORE_LAST,
    GAMMA_0,
    GAMMA_1,
    GAMMA_2,
    GAMMA_3,
    LAST,
    MIDDLE,
)
from integrators.kernel.simd.memory import get, put, total
from integrators.kernel.simd.operations import greatest, least, size, where
from integrators.kernel.step.begin import prepare, set_step, start_plain
from integrators.kernel.step.coefficients import (
    coefficient,
    coefficient_of_two,
    take_coefficients,
)
from integrators.kernel.step.control import INFINITY, TINY, error_power, is_good
from integrators.kernel.step.fixed_point import evaluate
from integrators.kernel.step.rounding import (
    beyond_noise,
    is_evident,
    is_visible,
    known_rounding,
    largest_in_group,
    measure_noise,
    momentum,
    note_sizes,
)
from integrators.kernel.step.rule import FIRST_AT_REST, LEAST_BLOCK, RESTART, SMALLEST, STAGNATION

SLIGHT = 1e-3  # part of the error allowed that a discontinuity counts as where it is negligible
NARROWEST = 1e-12  # part of the time: shorter steps do not look for a discontinuity any more
# Times as much is negligible in such a step: next to a zero of a component none might be short enough. It is
# what the resolution of time leaves, not the rounding of a value.
NARROW_STEP_FACTOR = 1e3
# Times the last coefficients: a smooth field is no farther from its polynomial at the ends
SMOOTH_GAP = 100.0
# A component's low coefficients that are larger than this part of all do not fall off, and are those of a
# mode at rest where the error they would make is at most that part of the allowed one; see `log_decay`.
NOT_DECAYING, AT_REST = 0.1, 0.1
DECAYED = 2.0**-6  # part of the size it had that a block has then
# Part of the field's mean that its other coefficients are at most where it does not change
EQUAL_VALUES = 1e-14

left_out = compiled(tolerance.left_out)


@compiled
def is_gap(apart, last, previous_last):
    """Whether the polynomials of two steps are farther apart where they meet than for a smooth field.

    Parameters
    ----------
    apart : float
    last, previous_last : float
        The last coefficients of the steps.
    """
    return apart > SMOOTH_GAP * (last + previous_last)


@compiled
def compare_ends(ctx):
    """Compare the field at the start of the solved step with that at the end of the previous step.

    As their polynomials say. It is done last, since the length of the next step has not to wait for it.
    """
    discontinuities = ctx.discontinuities
    gammas, boundary_values, previous, gaps = (
        ctx.estimate.coefficients,
        discontinuities.boundary_values,
        discontinuities.previous_boundary_values,
        discontinuities.gaps,
    )
    last_coefficients, previous_last_coefficients = (
        discontinuities.last_coefficients,
        discontinuities.previous_last_coefficients,
    )
    table, values, two = ctx.estimate.estimators, ctx.values, ctx.route == 16
    apart = False
    for d in range(ctx.rows):
        if two:
            x, y = get(values, 16 * d), get(values, 16 * d + 8)
            start, end = coefficient_of_two(table, AT_START, x, y), coefficient_of_two(table, AT_END, x, y)
        else:
            start, end = coefficient(ctx, d, AT_START), coefficient(ctx, d, AT_END)
        put(boundary_values, 8 * d, end)
        gaps[d] = far = abs(total(start - get(previous, 8 * d)))
        last_coefficients[d] = last = greatest(gammas[8 * d + BEFORE_LAST], gammas[8 * d + LAST])
        apart |= is_gap(far, last, previous_last_coefficients[d])
    discontinuities.apart = 1 if apart else 0


@compiled
def does_not_decay(ctx, d, last):
    """Whether a row's last coefficient is as large, beside those from the middle, as at a discontinuity."""
    middle = greatest(
        size(total(coefficient(ctx, d, MIDDLE))), size(total(coefficient(ctx, d, AFTER_MIDDLE)))
    )
    return last > ctx.discontinuities.slowest_decay * middle


@compiled
def lowest(gamma_1, gamma_2, gamma_3):
    """Return the largest of the coefficients of a row that a step resolves first, but for its mean."""
    return greatest(greatest(gamma_1, gamma_2), gamma_3)


@compiled
def is_doubtful(low, high, doubt):
    """Whether the last coefficients of a row do not fall off well enough beside the low ones."""
    return high > doubt * low


@compiled
def changes(low, high, gamma_0):
    """Whether a row of the field has not the same value at all nodes."""
    return greatest(low, high) > EQUAL_VALUES * gamma_0


@compiled
def next_coefficient(here, before, decay):
    """Return a coefficient, or what the one before, of the other parity, tells of it where that is more."""
    return greatest(here, decay * before)


@compiled
def judged(
    gamma_0,
    gamma_1,
    gamma_2,
    gamma_3,
    before_error,
    at_error,
    before_last,
    last,
    error_decay,
    quadrature_error_decay,
):
    """Return what the sizes of a row's coefficients say of it; see `GAMMA_0`.

    Returns
    -------
    low, high : float
        The largest of those that a step resolves first, but for the mean, and of the last two.
    slope : float
        The largest of the low ones and the mean: how steep the field is.
    error, quadrature_error : float
        What the errors are estimated by.
    """
    low, high = lowest(gamma_1, gamma_2, gamma_3), greatest(before_last, last)
    error = next_coefficient(at_error, before_error, error_decay)
    quadrature_error = next_coefficient(last, before_last, quadrature_error_decay)
    return low, high, greatest(gamma_0, low), error, quadrature_error


@compiled
def floored_slope(slope, steepest, part):
    """Return what the field of a block counts as, at least a part of the steepest in its group."""
    return greatest(slope, part * steepest)


@compiled
def size_in_step(scale, largest):
    """Return the size of a block in the step that is estimated, unless that is next to nothing.

    Parameters
    ----------
    scale, largest : float
        Of the block, and the largest in its group.
    """
    return greatest(greatest(scale, LEAST_BLOCK * largest), SMALLEST)


@compiled
def local_error(h, gamma, slope, scale):
    """Return ``h gamma^2 / (slope scale)``, the error of a coefficient that is left out; see `estimate`."""
    # not h / slope, which has no double in a field near 0
    error = left_out(gamma, gamma, slope) * (h / scale)
    return where(error >= 0.0, error, INFINITY)  # of infinite coefficients, a NaN


@compiled
def note_slow_decay(ctx):
    """Note for each block the largest last coefficient that is as large as at a discontinuity; 0: none."""
    slow_decay = ctx.estimate.slow_decay
    for d in range(ctx.rows):
        gammas = ctx.estimate.coefficients + 8 * d
        low = lowest(gammas[GAMMA_1], gammas[GAMMA_2], gammas[GAMMA_3])
        b = ctx.blocks.of_row[d]
        high = beyond_noise(greatest(gammas[BEFORE_LAST], gammas[LAST]), known_rounding(ctx, d))
        if is_doubtful(low, high, ctx.discontinuities.doubt) and does_not_decay(ctx, d, gammas[LAST]):
            slow_decay[b] = greatest(slow_decay[b], high)


@compiled
def own_size(ctx, b):
    """Return the size of a block in the step that is estimated, unless that is next to nothing."""
    return size_in_step(ctx.estimate.scale[b], ctx.estimate.fastest[ctx.blocks.group[b]] * ctx.blocks.mass[b])


@compiled
def steepest_in_group(ctx, b):
    """Return the steepest field in the group of a block, for its mass."""
    return ctx.estimate.steepest[ctx.blocks.group[b]] * ctx.blocks.mass[b]


@compiled
def block_size(ctx, b):
    """Return the size that a block's errors are relative to: its own, or one that is known from elsewhere."""
    size = max(own_size(ctx, b), ctx.estimate.absolute[b])
    return max(size, ctx.estimate.expected[b]) if ctx.estimate.rescaled else size


@compiled
def estimate(ctx):
    """Return the estimated local error of the solved step, and that of its quadrature.

    gamma_j, the Legendre coefficients of the field that the polynomial leaves out,
    j >= s, are of size h^j. ``h |gamma_s|^2 / |gamma|`` has the order 2s + 1 of the
    local error, and its units; with the last one that k nodes see, gamma_{k-1}, it is
    of the size of the quadrature's error or larger. Both relative to the size of each
    block of the state; the largest of all. A block whose field is nothing beside that of
    others in its group may be moved by their rounding alone, which no step is short
    enough for: its gamma counts as a part of theirs, and what of it does not fall off is no discontinuity.

    All this is true of coefficients that fall off geometrically. At a discontinuity of
    the field they do not: |gamma_j| falls off like 1/j or 1/j^2, and the error of the
    quadrature is of the size of h |gamma_{k-1}| itself. `Discontinuities.not_smooth` says whether there is
    more of that than rounding and tolerance account for. If there is less, nothing is gained by cutting the
    step further, whatever the squares are. Where the formulas tell that a switching surface is crossed
    (`Surfaces.crossed`), all that the last coefficients are counts as that of a discontinuity.

    From rest the size is what the field makes of a block in this very step. If it begins like a power of t,
    the squares are the same at all lengths of the step; if it begins in the field's rounding or with a
    jump, they are about 1. No step is good enough then by the block's own size, and `Estimate.expected`, that
    which it will reach, takes its place until `Estimate.borrowed` is 0 again.
    """
    note_sizes(ctx)
    take_coefficients(ctx)
    ctx.estimate.measured = ctx.estimate.noisy
    error, quadrature_error = judge_blocks(ctx)
    if (ctx.discontinuities.not_smooth or fails(ctx, error, quadrature_error)) and not fails(
        ctx, ctx.estimate.evident_error, ctx.estimate.evident_quadrature_error
    ):
        error, quadrature_error = estimate_beyond_noise(ctx, error, quadrature_error)
    compare_ends(ctx)
    return error, quadrature_error


@compiled
def fails(ctx, error, quadrature_error):
    """Whether a step with these errors is not good enough."""
    controller = ctx.controller
    return not is_good(error, controller.allowed_error, quadrature_error, controller.allowed_quadrature_error)


@compiled
def estimate_beyond_noise(ctx, error, quadrature_error):
    """Return the estimates of what is beyond noise, which is measured unless it has been."""
    if ctx.estimate.measured:
        return error, quadrature_error
    measure_noise(ctx)
    return judge_blocks(ctx)


@compiled
def judge_blocks(ctx):
    """Return the two errors that `estimate` returns, from the coefficients."""
    discontinuities = ctx.discontinuities
    h = abs(ctx.h)
    doubtful = measure_blocks(ctx)
    if ctx.surfaces.crossed:
        doubtful = True
        for b in range(ctx.blocks.count):
            ctx.estimate.slow_decay[b] = greatest(ctx.estimate.gamma_error[b], ctx.estimate.gamma_last[b])
    elif doubtful:
        note_slow_decay(ctx)
    allowed, allowed_quadrature_error, negligible = (
        ctx.controller.allowed_error,
        ctx.controller.allowed_quadrature_error,
        discontinuities.negligible,
    )
    narrow = h <= NARROWEST * abs(ctx.t0)
    error, quadrature_error, evident, evident_quadrature = 0.0, 0.0, 0.0, 0.0
    not_smooth = borrowed = 0
    rescaled, slopes, absolute = ctx.estimate.rescaled, ctx.estimate.slope, ctx.estimate.absolute
    for b in range(ctx.blocks.count):
        steepest = steepest_in_group(ctx, b)
        slope = floored_slope(slopes[b], steepest, ctx.estimate.least_slope)
        if slope > 0.0:
            own, scale = own_size(ctx, b), block_size(ctx, b)
            largest = largest_in_group(ctx, b)
            gamma_error, gamma_last, high = (
                ctx.estimate.gamma_error[b],
                ctx.estimate.gamma_last[b],
                ctx.estimate.slow_decay[b],
            )
            if slope > slopes[b] and high <= STAGNATION * steepest:
                high = 0.0
            most, most_quadrature_error = INFINITY, INFINITY
            if doubtful and high > 0.0:
                slight = NARROW_STEP_FACTOR * negligible if narrow else negligible
                if (
                    discontinuities.count > 0
                    and h * max(high, max(gamma_error, gamma_last)) <= slight * scale
                ):
                    most, most_quadrature_error = SLIGHT * allowed, SLIGHT * allowed_quadrature_error
                elif h * high > negligible * scale and not narrow:
                    not_smooth = 1
                    evident = INFINITY if is_evident(h, high, largest) else evident
            block_error = least(most, local_error(h, gamma_error, slope, scale))
            error = greatest(error, block_error)
            if is_evident(h, gamma_error, largest):
                evident = greatest(evident, block_error)
            if absolute[b] > own:
                scale = max(own, ctx.estimate.expected[b]) if rescaled else own
            block_quadrature_error = least(most_quadrature_error, local_error(h, gamma_last, slope, scale))
            quadrature_error = greatest(quadrature_error, block_quadrature_error)
            if is_evident(h, gamma_last, largest):
                evident_quadrature = greatest(evident_quadrature, block_quadrature_error)
            if rescaled:
                times = scale / own
                fits = (
                    block_error * times <= allowed
                    and block_quadrature_error * times <= allowed_quadrature_error
                )
                if not fits or (doubtful and h * high > negligible * own):
                    borrowed = 1
    forget_old_sizes(ctx)
    discontinuities.not_smooth, ctx.estimate.borrowed = not_smooth, borrowed
    ctx.estimate.evident_error, ctx.estimate.evident_quadrature_error = evident, evident_quadrature
    return error, quadrature_error


@compiled
def forget_old_sizes(ctx):
    """Let the next step measure the blocks where one has decayed since: it would be solved to what it was."""
    if ctx.second:
        return
    blocks = ctx.blocks
    for b in range(blocks.count):
        least = LEAST_BLOCK * blocks.largest[blocks.group[b]]
        if greatest(ctx.estimate.scale[b], least) < DECAYED * blocks.size[b]:
            blocks.age = 0


@compiled
def measure_blocks(ctx):
    """Set the blocks' scales and coefficients; return whether one does not fall off well enough."""
    blocks = ctx.blocks
    h, doubt = abs(ctx.h), ctx.discontinuities.doubt
    error_decay, quadrature_error_decay = ctx.estimate.error_decay, ctx.estimate.quadrature_error_decay
    scale, slopes, gamma_error, gamma_last = (
        ctx.estimate.scale,
        ctx.estimate.slope,
        ctx.estimate.gamma_error,
        ctx.estimate.gamma_last,
    )
    group, top, steepest = blocks.group, ctx.estimate.fastest, ctx.estimate.steepest
    for b in range(blocks.count):
        scale[b] = slopes[b] = gamma_error[b] = gamma_last[b] = ctx.estimate.slow_decay[b] = 0.0
    for g in range(blocks.groups):
        top[g] = steepest[g] = 0.0
    doubtful, changing = False, False
    for d in range(ctx.rows):
        b, gammas = blocks.of_row[d], ctx.estimate.coefficients + 8 * d
        low, high, slope, error, quadrature_error = judged(
            gammas[GAMMA_0],
            gammas[GAMMA_1],
            gammas[GAMMA_2],
            gammas[GAMMA_3],
            gammas[BEFORE_ERROR],
            gammas[AT_ERROR],
            gammas[BEFORE_LAST],
            gammas[LAST],
            error_decay,
            quadrature_error_decay,
        )
        noise = known_rounding(ctx, d)
        error, quadrature_error = beyond_noise(error, noise), beyond_noise(quadrature_error, noise)
        high = beyond_noise(high, noise)
        doubtful |= is_doubtful(low, high, doubt)
        changing |= changes(low, high, gammas[GAMMA_0])
        scale[b] = greatest(scale[b], size(momentum(ctx, d)) + h * greatest(slope, blocks.terms[d]))
        slopes[b] = greatest(slopes[b], slope)
        gamma_error[b] = greatest(gamma_error[b], error)
        gamma_last[b] = greatest(gamma_last[b], quadrature_error)
    for b in range(blocks.count):
        g = group[b]
        top[g] = greatest(top[g], scale[b] * blocks.speed[b])
        steepest[g] = greatest(steepest[g], slopes[b] * blocks.speed[b])
    ctx.estimate.constant_field = 0 if changing else 1
    return doubtful


@compiled
def log_decay(ctx):
    """Return the logarithm of the factor from one low coefficient of the field to the next, after `estimate`.

    Of the component where they fall off slowest. High ones drown in rounding where h J is
    large and the solution smooth; 0 where one of them does not, for `estimate` is right then. A component
    whose low ones do not fall off either, and would not be an error even if they were what is left out, is a
    fast mode at rest that rounding moves: it says nothing about the step.
    """
    steps = min(3, ctx.controller.error_degree - 1)
    if steps < 1:
        return 0.0
    h = abs(ctx.h)
    slowest = -INFINITY
    for d in range(ctx.rows):
        b, gammas = ctx.blocks.of_row[d], ctx.estimate.coefficients + 8 * d
        last, size = gammas[GAMMA_3], block_size(ctx, b)
        if steps == 3:
            last = next_coefficient(last, gammas[GAMMA_2], ctx.estimate.error_decay)
        if last > NOT_DECAYING * ctx.estimate.slope[b]:
            slope = floored_slope(ctx.estimate.slope[b], steepest_in_group(ctx, b), ctx.estimate.least_slope)
            if local_error(h, last, slope, size) <= AT_REST * ctx.controller.allowed_error:
                continue
        if is_visible(
            h, next_coefficient(gammas[AT_ERROR], gammas[BEFORE_ERROR], ctx.estimate.error_decay), size
        ):
            return 0.0
        if is_visible(h, last, size):
            slowest = max(slowest, log(last / ctx.estimate.slope[b]) / steps)
    return max(slowest, log(TINY))


@compiled
def estimate_implicit(ctx):
    """As `estimate`, after the implicit solver, which leaves the polynomial's values in place of the field's.

    Those stay: where h J is large, rounding spoils the field's.
    """
    kept = ctx.values
    ctx.values = ctx.scratch.sums
    evaluate(ctx)
    result = estimate(ctx)
    ctx.values = kept
    ctx.counters.evaluations += ctx.k
    return result


@compiled
def estimate_again(ctx, error, quadrature_error, implicit):
    """Return the estimates of what is beyond noise, after `estimate` or `estimate_implicit`."""
    if not implicit:
        return estimate_beyond_noise(ctx, error, quadrature_error)
    kept = ctx.values
    ctx.values = ctx.scratch.sums
    result = estimate_beyond_noise(ctx, error, quadrature_error)
    ctx.values = kept
    return result


@compiled
def first_length(ctx):
    """Return a first step from the field at the state: short, the following grow.

    Where the state is 0, or the field is 0 or infinite, there is no time scale: `Controller.no_time_scale` is
    1 then, and the step the shorter one of what it would be with a unit for the state and a part of the
    interval.
    """
    controller = ctx.controller
    set_step(ctx, 0.0)
    prepare(ctx)
    start_plain(ctx)
    evaluate(ctx)
    rows, lanes, values = ctx.rows, ctx.lanes, ctx.values
    position, speed, pull = 0.0, 0.0, 0.0
    for d in range(rows):
        slope = abs(values[lanes * d])
        position = max(position, abs(ctx.scratch.row_state[d]))
        if ctx.second:
            velocity = ctx.factors.velocity[d]
            speed = max(speed, abs(velocity * momentum(ctx, d)))
            pull = max(pull, abs(velocity) * slope)
        else:
            speed = max(speed, slope)
    rate = speed
    if position > 0.0:
        rate = max(speed / position, (pull / position) ** 0.5)
    length = controller.allowed_error ** error_power(controller.error_degree)
    controller.no_time_scale = 0 if position > 0.0 and 0.0 < rate < INFINITY else 1
    return max(length / rate, RESTART * abs(ctx.t0)) if 0.0 < rate < INFINITY else length


@compiled
def shorten_first(ctx):
    """Let the first step be a part of the interval at most where nothing else tells how long it may be."""
    controller = ctx.controller
    most = FIRST_AT_REST * controller.interval
    if controller.no_time_scale and 0.0 < most < abs(controller.next_length):
        controller.next_length = most if controller.next_length > 0.0 else -most
