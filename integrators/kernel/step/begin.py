"""The start of a step: what its stages have in common, and their first values.

Round-off is handled where it arises. Nodes come as hi + lo pairs whose low
part enters before anything is rounded at the size of the state; h^2 is never
formed; the state is a compensated pair whose error enters the stages.
"""

from integrators.kernel import layout as at
from integrators.kernel.simd.lanes import fma
from integrators.kernel.simd.memory import (
    get,
    get_float,
    get_int,
    largest,
    put,
    put_float,
    put_int,
    put_lower,
    put_upper,
    splat8,
    spread,
)  # fmt: skip
from integrators.kernel.step.sweep import compiled, multiply, offset, product, project, through

FLOOR = 1e-3  # of the largest size in its group: where rounding of the field may hide a small component
SIZES_LAST = 8  # steps for which the sizes of the blocks are good
SMALLEST, LARGE = 1e-200, 1e200  # a block smaller than that has no size to divide by
FARTHEST = 2.0  # no extrapolation farther than this many previous steps


@compiled
def set_factors(ctx, h):
    """Set H and what is h times the velocities."""
    put_float(ctx, at.H, h)
    if get_int(ctx, at.SECOND):
        velocity = get_int(ctx, at.VELOCITY)
        factor = get_int(ctx, at.ROW_FACTOR)
        drift = get_int(ctx, at.STEP_FACTOR)
        kick = get_int(ctx, at.KICK_FACTOR)
        for d in range(get_int(ctx, at.ROWS)):
            kh = h * get_float(velocity, d)
            put_float(factor, d, kh)
            put_float(drift, 8 * (d // 4) + d % 4, kh)
            put_float(kick, 8 * (d // 4) + 4 + d % 4, kh)


@compiled
def set_step(ctx, h):
    """Scale the matrix and the velocities by a step h that is taken once (`tables.scaled` is for many)."""
    set_factors(ctx, h)
    twice = get_int(ctx, at.SECOND) and get_int(ctx, at.UNIT)
    raw = get_int(ctx, at.RAW_MATRIX)
    matrix = get_int(ctx, at.MATRIX)
    for i in range(get_int(ctx, at.MATRIX_SIZE)):
        value = h * get(raw, 8 * i)
        put(matrix, 8 * i, h * value if twice else value)


@compiled
def set_times(ctx):
    """Set TIMES to t0 + n h + c h, with t0 and n h as sums of two doubles."""
    h = get_float(ctx, at.H)
    t0 = get_float(ctx, at.T0)
    n = float(get_int(ctx, at.N))
    elapsed = n * h
    t = t0 + elapsed
    part = t - t0
    rest = (t0 - (t - part)) + (elapsed - part) + fma(n, h, -elapsed)
    low = splat8(rest + get_float(ctx, at.TIME_LOW))
    step = splat8(h)
    times = get_int(ctx, at.TIMES)
    nodes = get_int(ctx, at.NODES)
    for chunk in range(get_int(ctx, at.CHUNKS)):
        put(times, 8 * chunk, t + fma(get(nodes, 8 * chunk), step, low))


@compiled
def prepare(ctx):
    """ROW_..., BASE and TIMES of the step from STATE."""
    state = get_int(ctx, at.STATE)
    error = get_int(ctx, at.ERROR)
    rows = get_int(ctx, at.ROWS)
    row_state = get_int(ctx, at.ROW_STATE)
    row_error = get_int(ctx, at.ROW_ERROR)
    lanes = get_int(ctx, at.LANES)
    set_times(ctx)
    if get_int(ctx, at.SECOND) == 0:
        for i in range((rows + 7) // 8):
            put(row_state, 8 * i, get(state, 8 * i))
            put(row_error, 8 * i, get(error, 8 * i))
        for chunk in range(get_int(ctx, at.CHUNKS)):
            base = get_int(ctx, at.BASE) + 8 * offset(ctx, chunk)
            for d in range(rows):
                put(base, lanes * d, spread(row_error, d))
        return
    drift = get_int(ctx, at.ROW_DRIFT)
    drift_low = get_int(ctx, at.ROW_DRIFT_LOW)
    factor = get_int(ctx, at.STEP_FACTOR)
    for i in range((rows + 3) // 4):
        z = get(state, 8 * i)
        e = get(error, 8 * i)
        kh = get(factor, 8 * i)
        u = kh * z
        put_upper(row_state, 4 * i, z)
        put_upper(row_error, 4 * i, e)
        put_lower(drift, 4 * i, u)
        put_lower(drift_low, 4 * i, fma(kh, e, fma(kh, z, -u)))
    nodes = get_int(ctx, at.NODES)
    nodes_low = get_int(ctx, at.NODES_LOW)
    for chunk in range(get_int(ctx, at.CHUNKS)):
        c = get(nodes, 8 * chunk)
        c_low = get(nodes_low, 8 * chunk)
        base = get_int(ctx, at.BASE) + 8 * offset(ctx, chunk)
        for d in range(rows):
            u = spread(drift, d)
            low = fma(c, spread(drift_low, d), fma(c_low, u, spread(row_error, d)))
            put(base, lanes * d, fma(c, u, low))


@compiled
def start_plain(ctx):
    """First stages without a force (second-order form), or constant."""
    rows = get_int(ctx, at.ROWS)
    lanes = get_int(ctx, at.LANES)
    state = get_int(ctx, at.ROW_STATE)
    for chunk in range(get_int(ctx, at.CHUNKS)):
        start = 8 * offset(ctx, chunk)
        q = get_int(ctx, at.Q) + start
        base = get_int(ctx, at.BASE) + start
        for d in range(rows):
            put(q, lanes * d, spread(state, d) + get(base, lanes * d))
    put_int(ctx, at.PREDICTED, 0)


@compiled
def start_extrapolated(ctx):
    """First stages from F of the previous step, of the same length."""
    if get_int(ctx, at.ROUTE) == at.THROUGH:
        projection = get_int(ctx, at.MODE_PROJECTION)
        through(ctx, projection, get_int(ctx, at.MODE_CHUNKS), get_int(ctx, at.EXTRAPOLATION))
    else:
        product(ctx, get_int(ctx, at.EXTRAPOLATION))
    put_int(ctx, at.PREDICTED, 1)


@compiled
def start_elsewhere(ctx, source, first, ratio):
    """First stages from F of the context ``source``, whose own nodes are at ``first + ratio * c``."""
    rows = get_int(ctx, at.ROWS)
    chunks = get_int(ctx, at.CHUNKS)
    modes = get_int(ctx, at.MODES)
    groups = get_int(ctx, at.MODE_CHUNKS)
    nodes = get_int(ctx, at.NODES)
    basis = get_int(ctx, at.BASIS)
    recurrence = get_int(ctx, at.RECURRENCE)
    for chunk in range(chunks):
        x = 2.0 * (first + ratio * get(nodes, 8 * chunk)) - 1.0
        before = splat8(0.0)
        here = splat8(1.0)
        for j in range(modes):
            put(basis, 8 * (chunk * 8 * groups + j), here)
            after = fma(get_float(recurrence, 2 * j) * x, here, -get_float(recurrence, 2 * j + 1) * before)
            before = here
            here = after
    project(source, get_int(ctx, at.MODE_PROJECTION), groups)
    multiply(
        basis, chunks, groups, get_int(source, at.COEFFICIENTS), 8,
        get_int(ctx, at.F), get_int(ctx, at.LANES), rows, get_int(ctx, at.PADDED),
    )  # fmt: skip
    product(ctx, get_int(ctx, at.MATRIX))
    put_int(ctx, at.PREDICTED, 1)


@compiled
def start(ctx):
    """First stages of a step after the previous one, from whatever F holds."""
    length = get_float(ctx, at.LENGTH)
    h = get_float(ctx, at.H)
    if length == h:
        start_extrapolated(ctx)
    elif length != 0.0 and abs(h / length) <= FARTHEST:
        start_elsewhere(ctx, ctx, 1.0, h / length)
    else:
        start_plain(ctx)


@compiled
def take_sizes(ctx):
    """Measure the blocks on the present stages: changes are judged relative to them."""
    rows = get_int(ctx, at.ROWS)
    lanes = get_int(ctx, at.LANES)
    block = get_int(ctx, at.BLOCK)
    group = get_int(ctx, at.GROUP)
    size = get_int(ctx, at.SIZE)
    biggest = get_int(ctx, at.LARGEST)
    strict = get_int(ctx, at.STRICT)
    floored = get_int(ctx, at.FLOORED)
    for b in range(get_int(ctx, at.BLOCK_COUNT)):
        put_float(size, b, 0.0)
    for g in range(get_int(ctx, at.GROUP_COUNT)):
        put_float(biggest, g, 0.0)
    for d in range(rows):
        top = splat8(0.0)
        for chunk in range(get_int(ctx, at.CHUNKS)):
            top = max(top, abs(get(get_int(ctx, at.Q), offset(ctx, chunk) + lanes * d)))
        b = get_int(block, d)
        g = get_int(group, b)
        value = largest(top)
        put_float(size, b, max(get_float(size, b), value))
        put_float(biggest, g, max(get_float(biggest, g), value))
    known = True
    for d in range(rows):
        b = get_int(block, d)
        own = get_float(size, b)
        floor = max(own, FLOOR * get_float(biggest, get_int(group, b)))
        known = known and own > SMALLEST
        # Whatever moves a block of no size is a large change; and then it has a size: look again.
        put_float(strict, d, 1.0 / own if own > SMALLEST else LARGE)
        put_float(floored, d, 1.0 / floor if floor > SMALLEST else LARGE)
    put_int(ctx, at.AGE, SIZES_LAST if known else 0)
