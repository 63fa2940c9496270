"""Estimates from the Legendre coefficients that the polynomial of a step leaves out."""

from math import log

from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.lanes import fma
from integrators.kernel.simd.memory import get, put, splat8, sums, total
from integrators.kernel.step.begin import prepare, set_step, start_plain
from integrators.kernel.step.control import INFINITY, TINY
from integrators.kernel.step.rule import FIRST_AT_REST, NOTHING, SMALLEST
from integrators.kernel.step.stages import offset
from integrators.kernel.step.sweep import evaluate

UNSEEN = 1e-13  # part of a block that rounding accounts for in a step that the fixed-point iteration solves
SQUARABLE = 1e150  # the square of a larger number, or of one below its inverse, has no double
SLIGHT = 1e-3  # part of the error allowed that a kink counts as where it is negligible
NARROWEST = 1e-12  # part of the time: shorter steps do not look for a kink any more
# Times as much is negligible in such a step: next to a zero of a component none might be short enough.
BESIDE_NOTHING = 1e3
OUTSIDE = 100.0  # times the last coefficients: a smooth field is no farther from its polynomial at the ends
# Rows of the estimators: what the polynomial of the step says of the field at its ends.
AT_START, AT_END = 10, 11
ALIKE = 1e-14  # part of the field's mean that its other coefficients are at most where it does not change


@compiled
def coefficient(ctx, row, which):
    """Return eight partial sums of what row ``which`` of the estimators makes of a row of values."""
    values, i, chunks = ctx.values, ctx.lanes * row, ctx.chunks
    table = ctx.estimators + 8 * chunks * which
    if ctx.route == 8:
        return get(table, 0) * get(values, i)
    if ctx.route == 16:
        return fma(get(table, 8), get(values, i + 8), get(table, 0) * get(values, i))
    result = splat8(0.0)
    for chunk in range(chunks):
        result = fma(get(table, 8 * chunk), get(values, i + offset(ctx, chunk)), result)
    return result


@compiled
def take_coefficients(ctx):
    """Set what is known of the field from its values in the solved step, row by row."""
    found = ctx.estimates
    for d in range(ctx.rows):
        first = coefficient(ctx, d, 0), coefficient(ctx, d, 1), coefficient(ctx, d, 2), coefficient(ctx, d, 3)
        last = coefficient(ctx, d, 4), coefficient(ctx, d, 5), coefficient(ctx, d, 6), coefficient(ctx, d, 7)
        put(found, 8 * d, abs(sums(*first, *last)))


@compiled
def of_two(table, which, low, high):
    """As `coefficient`, of two times eight values."""
    return fma(get(table, 16 * which + 8), high, get(table, 16 * which) * low)


@compiled
def take_coefficients_of_two(ctx):
    """As `take_coefficients`, for two times eight stages: the same sums, with each value loaded once."""
    found, table, values = ctx.estimates, ctx.estimators, ctx.values
    for d in range(ctx.rows):
        x, y = get(values, 16 * d), get(values, 16 * d + 8)
        first = of_two(table, 0, x, y), of_two(table, 1, x, y), of_two(table, 2, x, y), of_two(table, 3, x, y)
        last = of_two(table, 4, x, y), of_two(table, 5, x, y), of_two(table, 6, x, y), of_two(table, 7, x, y)
        put(found, 8 * d, abs(sums(*first, *last)))


@compiled
def is_gap(ctx, d):
    """Whether the polynomials of two steps are farther apart where they meet than for a smooth field."""
    return ctx.gaps[d] > OUTSIDE * (ctx.lasts[d] + ctx.lasts_behind[d])


@compiled
def compare_ends(ctx):
    """Compare the field at the start of the solved step with that at the end of the step behind.

    As their polynomials say. It is done last, since the length of the next step has not to wait for it.
    """
    found, borders, behind, gaps = ctx.estimates, ctx.borders, ctx.borders_behind, ctx.gaps
    lasts, lasts_behind = ctx.lasts, ctx.lasts_behind
    table, values, two = ctx.estimators, ctx.values, ctx.route == 16
    apart = False
    for d in range(ctx.rows):
        if two:
            x, y = get(values, 16 * d), get(values, 16 * d + 8)
            start, end = of_two(table, AT_START, x, y), of_two(table, AT_END, x, y)
        else:
            start, end = coefficient(ctx, d, AT_START), coefficient(ctx, d, AT_END)
        put(borders, 8 * d, end)
        gaps[d] = far = abs(total(start - get(behind, 8 * d)))
        lasts[d] = last = max(found[8 * d + 6], found[8 * d + 7])
        apart |= far > OUTSIDE * (last + lasts_behind[d])
    ctx.apart = 1 if apart else 0


@compiled
def stays(ctx, d, last):
    """Whether the last coefficient of a row is as large, beside those from the middle, as at a kink."""
    middle = max(abs(total(coefficient(ctx, d, 8))), abs(total(coefficient(ctx, d, 9))))
    return last > ctx.slowest_decay * middle


@compiled
def note_what_stays(ctx):
    """Note for each block the largest last coefficient that is as large as at a kink; 0: none."""
    found, abrupt = ctx.estimates, ctx.abrupt
    for d in range(ctx.rows):
        i = 8 * d
        low = max(max(found[i + 1], found[i + 2]), found[i + 3])
        high = max(found[i + 6], found[i + 7])
        if high > ctx.doubt * low and stays(ctx, d, found[i + 7]):
            b = ctx.block[d]
            abrupt[b] = max(abrupt[b], high)


@compiled
def momentum(ctx, d):
    """Return the component of the state whose slope is row d of the field."""
    i = 8 * (d // 4) + d % 4 if ctx.second else d
    return ctx.state[i]


@compiled
def own_size(ctx, b):
    """Return the size of a block in the step that is estimated, unless that is next to nothing."""
    return max(max(ctx.extent[b], NOTHING * ctx.largest[ctx.group[b]]), SMALLEST)


@compiled
def block_size(ctx, b):
    """Return the size that a block's errors are relative to: its own, or one that is known from elsewhere."""
    size = max(own_size(ctx, b), ctx.absolute[b])
    return max(size, ctx.expected[b]) if ctx.rescaled else size


@compiled
def squared(h, missing, slope, size, part):
    """Return h missing^2 / (slope size); ``part`` is h / slope / size."""
    if missing < SQUARABLE and missing * SQUARABLE > 1.0:
        return part * missing**2
    return h * (missing / size) * (missing / slope)


@compiled
def estimate(ctx):
    """Return the estimated local error of the solved step, and that of its quadrature.

    gamma_j, the Legendre coefficients of the field that the polynomial leaves out,
    j >= s, are of size h^j. ``h |gamma_s|^2 / |gamma|`` has the order 2s + 1 of the
    local error, and its units; with the last one that k nodes see, gamma_{k-1}, it is
    of the size of the quadrature's error or larger. Both relative to the size of each
    block of the state; the largest of all. A block whose field is nothing beside that of
    others in its group may be moved by their rounding alone, which no step is short
    enough for: its gamma counts as a part of theirs, and what of it does not fall off is no kink.

    All this is true of coefficients that fall off geometrically. At a jump or a kink of
    the field they do not: |gamma_j| falls off like 1/j or 1/j^2, and the error of the
    quadrature is of the size of h |gamma_{k-1}| itself. `Context.kinked` says whether there is more
    of that than rounding and tolerance account for. If there is less, nothing is gained
    by cutting the step further, whatever the squares are. Where the formulas tell that a switching surface
    is crossed (`Context.crossed`), all that the last coefficients are counts as a kink's.

    From rest the size is what the field makes of a block in this very step. If it begins like a power of t,
    the squares are the same at all lengths of the step; if it begins in the field's rounding or with a
    jump, they are about 1. No step is good enough then by the block's own size, and `Context.expected`, that
    which it will reach, takes its place until `Context.borrowed` is 0 again.
    """
    h = abs(ctx.h)
    if ctx.route == 16:
        take_coefficients_of_two(ctx)
    else:
        take_coefficients(ctx)
    doubtful = measure_blocks(ctx)
    if ctx.crossed:
        doubtful = True
        for b in range(ctx.block_count):
            ctx.abrupt[b] = max(ctx.missing[b], ctx.unseen[b])
    elif doubtful:
        note_what_stays(ctx)
    group, largest, steepest = ctx.group, ctx.largest, ctx.steepest
    for b in range(ctx.block_count):
        g = group[b]
        largest[g] = max(largest[g], ctx.extent[b])
        steepest[g] = max(steepest[g], ctx.slope[b])
    allowed, allowed_defect, negligible = ctx.allowed_error, ctx.allowed_defect, ctx.negligible
    narrow = h <= NARROWEST * abs(ctx.t0)
    error, defect = 0.0, 0.0
    kinked = borrowed = 0
    rescaled, slopes, absolute = ctx.rescaled, ctx.slope, ctx.absolute
    for b in range(ctx.block_count):
        slope = max(slopes[b], ctx.least_slope * steepest[group[b]])
        if slope > 0.0:
            own, size = own_size(ctx, b), block_size(ctx, b)
            missing, unseen, high = ctx.missing[b], ctx.unseen[b], ctx.abrupt[b]
            if slope > slopes[b] and high <= UNSEEN * steepest[group[b]]:
                high = 0.0
            most, most_unseen = INFINITY, INFINITY
            if doubtful and high > 0.0:
                slight = BESIDE_NOTHING * negligible if narrow else negligible
                if ctx.kinks > 0 and h * max(high, max(missing, unseen)) <= slight * size:
                    most, most_unseen = SLIGHT * allowed, SLIGHT * allowed_defect
                elif h * high > negligible * size and not narrow:
                    kinked = 1
            part = h / slope / size
            block_error = min(most, squared(h, missing, slope, size, part))
            error = max(error, block_error)
            if absolute[b] > own:
                size = max(own, ctx.expected[b]) if rescaled else own
                part = h / slope / size
            block_defect = min(most_unseen, squared(h, unseen, slope, size, part))
            defect = max(defect, block_defect)
            if rescaled:
                times = size / own
                fits = block_error * times <= allowed and block_defect * times <= allowed_defect
                if not fits or (doubtful and h * high > negligible * own):
                    borrowed = 1
    ctx.kinked, ctx.borrowed = kinked, borrowed
    compare_ends(ctx)
    return error, defect


@compiled
def measure_blocks(ctx):
    """Set the blocks' extents and coefficients; return whether one does not fall off well enough."""
    h, found, doubt = abs(ctx.h), ctx.estimates, ctx.doubt
    error_decay, defect_decay = ctx.error_decay, ctx.defect_decay
    extent, slopes, missed, unseen = ctx.extent, ctx.slope, ctx.missing, ctx.unseen
    for b in range(ctx.block_count):
        extent[b] = slopes[b] = missed[b] = unseen[b] = ctx.abrupt[b] = 0.0
    for g in range(ctx.group_count):
        ctx.largest[g] = ctx.steepest[g] = 0.0
    doubtful, changes = False, False
    for d in range(ctx.rows):
        b, i = ctx.block[d], 8 * d
        low = max(max(found[i + 1], found[i + 2]), found[i + 3])
        slope = max(found[i], low)
        high = max(found[i + 6], found[i + 7])
        doubtful |= high > doubt * low
        changes |= max(low, high) > ALIKE * found[i]
        extent[b] = max(extent[b], abs(momentum(ctx, d)) + h * slope)
        slopes[b] = max(slopes[b], slope)
        missed[b] = max(missed[b], max(found[i + 5], error_decay * found[i + 4]))
        unseen[b] = max(unseen[b], max(found[i + 7], defect_decay * found[i + 6]))
    ctx.blind = 0 if changes else 1
    return doubtful


@compiled
def log_decay(ctx):
    """Return the logarithm of the factor from one low coefficient of the field to the next, after `estimate`.

    Of the block where they fall off slowest. High ones drown in rounding where h J is
    large and the solution smooth; 0 where one of them does not, for `estimate` is right then.
    """
    steps = min(3, ctx.error_degree - 1)
    if steps < 1:
        return 0.0
    h, found = abs(ctx.h), ctx.estimates
    slowest = -INFINITY
    for b in range(ctx.block_count):
        if h * ctx.missing[b] > UNSEEN * block_size(ctx, b):
            return 0.0
    for d in range(ctx.rows):
        b, i = ctx.block[d], 8 * d
        last = found[i + 3]
        if steps == 3:
            last = max(last, ctx.error_decay * found[i + 2])
        if h * last > UNSEEN * block_size(ctx, b):
            slowest = max(slowest, log(last / ctx.slope[b]) / steps)
    return max(slowest, log(TINY))


@compiled
def estimate_implicit(ctx):
    """As `estimate`, after the implicit solver, which leaves the polynomial's values in place of the field's.

    Those stay: where h J is large, rounding spoils the field's.
    """
    kept = ctx.values
    ctx.values = ctx.sums
    evaluate(ctx)
    found = estimate(ctx)
    ctx.values = kept
    ctx.evaluations += ctx.k
    return found


@compiled
def first_length(ctx):
    """Return a first step from the field at the state: short, the following grow.

    Where the state is 0, or the field is 0 or infinite, there is no time scale: `Context.restful` is 1 then,
    and the step the shorter one of what it would be with a unit for the state and a part of the interval.
    """
    set_step(ctx, 0.0)
    prepare(ctx)
    start_plain(ctx)
    evaluate(ctx)
    rows, lanes, values = ctx.rows, ctx.lanes, ctx.values
    position, speed, pull = 0.0, 0.0, 0.0
    for d in range(rows):
        slope = abs(values[lanes * d])
        position = max(position, abs(ctx.row_state[d]))
        if ctx.second:
            velocity = ctx.velocity[d]
            speed = max(speed, abs(velocity * momentum(ctx, d)))
            pull = max(pull, abs(velocity) * slope)
        else:
            speed = max(speed, slope)
    rate = speed
    if position > 0.0:
        rate = max(speed / position, (pull / position) ** 0.5)
    length = ctx.allowed_error ** (1.0 / (2.0 * ctx.error_degree + 1.0))
    ctx.restful = 0 if position > 0.0 and 0.0 < rate < INFINITY else 1
    return length / rate if 0.0 < rate < INFINITY else length


@compiled
def shorten_first(ctx):
    """Let the first step be a part of the interval at most where nothing else tells how long it may be."""
    most = FIRST_AT_REST * ctx.interval
    if ctx.restful and 0.0 < most < abs(ctx.next_length):
        ctx.next_length = most if ctx.next_length > 0.0 else -most
