"""Estimates from the Legendre coefficients that the polynomial of a step leaves out."""

from math import log

from integrators.kernel import layout as at
from integrators.kernel.simd.lanes import fma
from integrators.kernel.simd.memory import (
    get,
    get_float,
    get_int,
    put,
    put_float,
    put_int,
    splat8,
    sums,
    total,
)
from integrators.kernel.step.begin import prepare, set_step, start_plain
from integrators.kernel.step.control import INFINITY, NOTHING, TINY
from integrators.kernel.step.sweep import compiled, evaluate, offset

UNSEEN = (
    1e-13  # part of a block that rounding may account for in a step that the fixed-point iteration solves
)
SQUARABLE = 1e150  # the square of a larger number, or of one below its inverse, has no double
SLIGHT = 1e-3  # part of the error allowed that a kink counts as where it is negligible
NARROWEST = 1e-12  # part of the time: shorter steps do not look for a kink any more


@compiled
def coefficient(ctx, row, which):
    """Return eight partial sums of the coefficient that row ``which`` of ESTIMATORS makes of the field."""
    f = get_int(ctx, at.F)
    i = get_int(ctx, at.LANES) * row
    chunks = get_int(ctx, at.CHUNKS)
    table = get_int(ctx, at.ESTIMATORS) + 64 * chunks * which
    result = splat8(0.0)
    for chunk in range(chunks):
        result = fma(get(table, 8 * chunk), get(f, i + offset(ctx, chunk)), result)
    return result


@compiled
def stays(ctx, d, last):
    """Whether the last coefficient of a row is as large, beside those from the middle, as at a kink."""
    middle = max(abs(total(coefficient(ctx, d, 8))), abs(total(coefficient(ctx, d, 9))))
    return last > get_float(ctx, at.SLOWEST_DECAY) * middle


@compiled
def stay(ctx, room):
    """Note for each block the largest last coefficient that is as large as at a kink; 0: none."""
    found, block = get_int(ctx, at.ESTIMATES), get_int(ctx, at.BLOCK)
    doubt = get_float(ctx, at.DOUBT)
    for d in range(get_int(ctx, at.ROWS)):
        i = 8 * d
        low = max(max(get_float(found, i + 1), get_float(found, i + 2)), get_float(found, i + 3))
        high = max(get_float(found, i + 6), get_float(found, i + 7))
        if high > doubt * low and stays(ctx, d, get_float(found, i + 7)):
            b = at.BLOCK_ROOM * get_int(block, d)
            put_float(room, b + 4, max(get_float(room, b + 4), high))


@compiled
def momentum(ctx, d):
    """Return the component of the state whose slope is row d of the field."""
    i = 8 * (d // 4) + d % 4 if get_int(ctx, at.SECOND) else d
    return get_float(get_int(ctx, at.STATE), i)


@compiled
def block_size(ctx, room, b):
    """Return the size that a block's errors are relative to, its own unless that is next to nothing."""
    largest = get_float(get_int(ctx, at.LARGEST), get_int(get_int(ctx, at.GROUP), b))
    return max(get_float(room, at.BLOCK_ROOM * b), NOTHING * largest)


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
    enough for: its gamma counts as a part of theirs.

    All this is true of coefficients that fall off geometrically. At a jump or a kink of
    the field they do not: |gamma_j| falls off like 1/j or 1/j^2, and the error of the
    quadrature is of the size of h |gamma_{k-1}| itself. KINKED says whether there is more
    of that than rounding and tolerance account for. If there is less, nothing is gained
    by cutting the step further, whatever the squares are.
    """
    rows = get_int(ctx, at.ROWS)
    h = abs(get_float(ctx, at.H))
    found = get_int(ctx, at.ESTIMATES)
    for d in range(rows):
        first = coefficient(ctx, d, 0), coefficient(ctx, d, 1), coefficient(ctx, d, 2), coefficient(ctx, d, 3)
        last = coefficient(ctx, d, 4), coefficient(ctx, d, 5), coefficient(ctx, d, 6), coefficient(ctx, d, 7)
        put(found, 8 * d, abs(sums(*first, *last)))
    block, group = get_int(ctx, at.BLOCK), get_int(ctx, at.GROUP)
    blocks = get_int(ctx, at.BLOCK_COUNT)
    largest = get_int(ctx, at.LARGEST)
    error_decay, defect_decay = get_float(ctx, at.ERROR_DECAY), get_float(ctx, at.DEFECT_DECAY)
    room = found + 64 * rows
    for i in range(at.BLOCK_ROOM * blocks):
        put_float(room, i, 0.0)
    steepest = room + 8 * at.BLOCK_ROOM * blocks
    doubt, doubtful = get_float(ctx, at.DOUBT), False
    for g in range(get_int(ctx, at.GROUP_COUNT)):
        put_float(largest, g, 0.0)
        put_float(steepest, g, 0.0)
    for d in range(rows):
        b = at.BLOCK_ROOM * get_int(block, d)
        i = 8 * d
        low = max(max(get_float(found, i + 1), get_float(found, i + 2)), get_float(found, i + 3))
        slope = max(get_float(found, i), low)
        missing = max(get_float(found, i + 5), error_decay * get_float(found, i + 4))
        unseen = max(get_float(found, i + 7), defect_decay * get_float(found, i + 6))
        doubtful |= max(get_float(found, i + 6), get_float(found, i + 7)) > doubt * low
        put_float(room, b, max(get_float(room, b), abs(momentum(ctx, d)) + h * slope))
        put_float(room, b + 1, max(get_float(room, b + 1), slope))
        put_float(room, b + 2, max(get_float(room, b + 2), missing))
        put_float(room, b + 3, max(get_float(room, b + 3), unseen))
    if doubtful:
        stay(ctx, room)
    for b in range(blocks):
        g = get_int(group, b)
        put_float(largest, g, max(get_float(largest, g), get_float(room, at.BLOCK_ROOM * b)))
        put_float(steepest, g, max(get_float(steepest, g), get_float(room, at.BLOCK_ROOM * b + 1)))
    least = get_float(ctx, at.LEAST_SLOPE)
    error, defect = 0.0, 0.0
    negligible = get_float(ctx, at.NEGLIGIBLE)
    allowed, allowed_defect = get_float(ctx, at.ALLOWED_ERROR), get_float(ctx, at.ALLOWED_DEFECT)
    kinks = get_int(ctx, at.KINKS) > 0
    narrow = h <= NARROWEST * abs(get_float(ctx, at.T0))
    put_int(ctx, at.KINKED, 0)
    for b in range(blocks):
        i = at.BLOCK_ROOM * b
        slope = max(get_float(room, i + 1), least * get_float(steepest, get_int(group, b)))
        if slope > 0.0:
            size = block_size(ctx, room, b)
            missing, unseen = get_float(room, i + 2), get_float(room, i + 3)
            most, most_unseen = INFINITY, INFINITY
            if doubtful and get_float(room, i + 4) > 0.0:
                high = get_float(room, i + 4)
                if kinks and h * max(high, max(missing, unseen)) <= negligible * size:
                    most, most_unseen = SLIGHT * allowed, SLIGHT * allowed_defect
                elif h * high > negligible * size and not narrow:
                    put_int(ctx, at.KINKED, 1)
            part = h / slope / size
            error = max(error, min(most, squared(h, missing, slope, size, part)))
            defect = max(defect, min(most_unseen, squared(h, unseen, slope, size, part)))
    return error, defect


@compiled
def log_decay(ctx):
    """Return the logarithm of the factor from one low coefficient of the field to the next, after `estimate`.

    Of the block where they fall off slowest. High ones drown in rounding where h J is
    large and the solution smooth; 0 where one of them does not, for `estimate` is right then.
    """
    rows = get_int(ctx, at.ROWS)
    steps = min(3, get_int(ctx, at.ERROR_DEGREE) - 1)
    if steps < 1:
        return 0.0
    h = abs(get_float(ctx, at.H))
    decay = get_float(ctx, at.ERROR_DECAY)
    found, block = get_int(ctx, at.ESTIMATES), get_int(ctx, at.BLOCK)
    room = found + 64 * rows
    slowest = -INFINITY
    for b in range(get_int(ctx, at.BLOCK_COUNT)):
        i = at.BLOCK_ROOM * b
        if h * get_float(room, i + 2) > UNSEEN * block_size(ctx, room, b):
            return 0.0
    for d in range(rows):
        b = get_int(block, d)
        i = 8 * d
        last = get_float(found, i + 3)
        if steps == 3:
            last = max(last, decay * get_float(found, i + 2))
        if h * last > UNSEEN * block_size(ctx, room, b):
            slowest = max(slowest, log(last / get_float(room, at.BLOCK_ROOM * b + 1)) / steps)
    return max(slowest, log(TINY))


@compiled
def estimate_implicit(ctx):
    """As `estimate`, after the implicit solver, which leaves the polynomial's values in place of the field's.

    Those stay: where h J is large, rounding spoils the field's.
    """
    kept = get_int(ctx, at.F)
    put_int(ctx, at.F, get_int(ctx, at.SUM))
    evaluate(ctx)
    found = estimate(ctx)
    put_int(ctx, at.F, kept)
    put_int(ctx, at.EVALUATIONS, get_int(ctx, at.EVALUATIONS) + get_int(ctx, at.STAGES))
    return found


@compiled
def first_length(ctx):
    """Return a first step from the field at the state: short, the following grow."""
    set_step(ctx, 0.0)
    prepare(ctx)
    start_plain(ctx)
    evaluate(ctx)
    rows, lanes = get_int(ctx, at.ROWS), get_int(ctx, at.LANES)
    f = get_int(ctx, at.F)
    position, speed, pull = 0.0, 0.0, 0.0
    for d in range(rows):
        slope = abs(get_float(f, lanes * d))
        position = max(position, abs(get_float(get_int(ctx, at.ROW_STATE), d)))
        if get_int(ctx, at.SECOND):
            velocity = get_float(get_int(ctx, at.VELOCITY), d)
            speed = max(speed, abs(velocity * momentum(ctx, d)))
            pull = max(pull, abs(velocity) * slope)
        else:
            speed = max(speed, slope)
    rate = speed
    if position > 0.0:
        rate = max(speed / position, (pull / position) ** 0.5)
    length = get_float(ctx, at.ALLOWED_ERROR) ** (1.0 / (2.0 * get_int(ctx, at.ERROR_DEGREE) + 1.0))
    return length / rate if 0.0 < rate < INFINITY else length
