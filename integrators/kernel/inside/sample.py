"""Functions on states: on the polynomial of the step eight at a time, and on one state."""

from integrators.kernel.inside.memory import FINE, FINEST, WHOLE
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.lanes import fma
from integrators.kernel.simd.memory import call_field, get, put, splat8, spread
from integrators.kernel.step.rounding import rounding_of
from integrators.kernel.step.stages import momentum_place

NUDGE = 1e-6  # relative change of a component that shows how a function depends on it
NAN = float("nan")


@compiled
def is_finite(x):
    """Whether a number is finite."""
    return x * 0.0 == 0.0


@compiled
def sign(x):
    """Return 1, -1 or 0; 0 of a NaN."""
    return 1 if x > 0.0 else -1 if x < 0.0 else 0


@compiled
def node(search, i, degree):
    """Return the point of sample i."""
    return (1.0 - search.cosines[i * (FINE * FINEST // degree)]) / 2.0


@compiled
def time_at(search, x):
    """Return the time of a point, which may be a little beyond the end."""
    if x == 0.0:
        return search.start
    return search.end if x == 1.0 else search.start + x * (search.end - search.start)


@compiled
def part_at(search, t):
    """Return how far a time is from the start of the step."""
    return (t - search.time) - search.time_low


@compiled
def put_nodes(search, chunk, degree):
    """Put the points of samples 1 + 8 chunk and of those that follow to where times are."""
    stride = FINE * FINEST // degree
    for i in range(8):
        search.times[i] = 0.5 * (1.0 - search.cosines[(1 + 8 * chunk + i) * stride])


@compiled
def weigh(ctx, c, terms, table):
    """Set the weights of a polynomial's terms at eight parts ``c`` of a step: for slopes and positions.

    See `integrators.kernel.step.sample.interpolate`, which has the formulas. With s = 1 the mean of the
    second term is no part of a position, which would not arrive at the step's end with it.
    """
    x = 2.0 * c - 1.0
    lower, here = splat8(0.0), c
    before, legendre = splat8(1.0), x
    for j in range(terms):
        after = ((2.0 * j + 3.0) * x * legendre - (j + 1.0) * before) / (j + 2.0)
        upper = splat8(0.0)
        if j + 1 < terms:
            upper = (after - before) / (2.0 * (2.0 * j + 3.0) ** 0.5)
        weight = 0.5 * here
        if j > 0:
            mean = 0.0 if j == ctx.s and j == 1 else 1.0
            weight = mean * lower / (-2.0 * (4.0 * j * j - 1.0) ** 0.5)
        put(table, 16 * j, here)
        put(table, 16 * j + 8, weight + upper / (2.0 * (4.0 * (j + 1.0) * (j + 1.0) - 1.0) ** 0.5))
        lower, here = here, upper
        before, legendre = legendre, after


@compiled
def combine8(search, row, terms, table):
    """Return the sum of a row's coefficients times the weights in every other vector of a table."""
    gamma, group = search.series, 8 * search.dim
    total = splat8(0.0)
    for j in range(terms):
        total = fma(get(table, 16 * j), spread(gamma, (j // 8) * group + 8 * row + j % 8), total)
    return total


@compiled
def interpolate8(ctx, search, c, terms, table, block):
    """Write so many terms of the solved step's polynomial at eight parts of it."""
    rows, h, state, error = ctx.rows, ctx.h, ctx.state, ctx.error
    for d in range(rows):
        moved = h * combine8(search, d, terms, table)
        if ctx.second:
            i = momentum_place(d)
            drift = c * (ctx.factors.drift[i] * state[i])
            bent = (ctx.factors.row[d] * h) * combine8(search, d, terms, table + 8)
            put(block, 8 * d, state[i + 4] + (drift + (error[i + 4] + bent)))
            put(block, 8 * (rows + d), state[i] + (error[i] + moved))
        else:
            put(block, 8 * d, state[d] + (error[d] + moved))


@compiled
def fill(ctx, search, chunk, degree, terms, known):
    """Put states to the block: at samples 1 + 8 chunk and those that follow, the exact one at the end."""
    start, end, time, low = search.start, search.end, search.time, search.time_low
    put_nodes(search, chunk, degree)
    put(search.times, 0, start + get(search.times, 0) * (end - start))
    c = ((get(search.times, 0) - time) - low) * (1.0 / ctx.h)
    weights = search.weights
    if known == 0:
        weigh(ctx, c, terms, weights)
    else:
        weights = search.first_weights + 16 * terms * chunk
    interpolate8(ctx, search, c, terms, weights, search.block)
    if 8 * chunk + 8 == degree:
        search.times[7] = end
        for d in range(search.dim):
            search.block[8 * d + 7] = search.end_state[d]


@compiled
def weigh_first(ctx, search):
    """Set the weights at the first samples of a whole step."""
    for chunk in range(search.chunks):
        put_nodes(search, chunk, search.degree)
        weigh(ctx, get(search.times, 0), search.terms, search.first_weights + 16 * search.terms * chunk)


@compiled
def call(ctx, search, event):
    """Set `Search.outputs` to the values of a function on the block."""
    outputs = search.outputs
    if search.raised:
        put(outputs, 0, splat8(NAN))
        return
    call_field(search.functions[event], search.times, search.block, ctx.par, outputs)
    if outputs[8] != 0.0:
        search.raised = 1 + event
        outputs[8] = 0.0


@compiled
def sample(ctx, search, degree):
    """Set `Search.values` of the function that is looked for, at more samples of the stretch."""
    for chunk in range(degree // 8):
        fill(ctx, search, chunk, degree, search.terms, 0)
        call(ctx, search, search.event)
        for i in range(8):
            search.values[1 + 8 * chunk + i] = search.outputs[i]
    search.values[0] = search.start_value
    search.values[degree] = search.end_value


@compiled
def sample_first(ctx, search):
    """Set `Search.sampled` and `Search.errors` of all functions."""
    degree, known = search.degree, search.mode == WHOLE
    for chunk in range(search.chunks):
        fill(ctx, search, chunk, degree, search.terms, 1 if known else 0)
        for event in range(search.count):
            call(ctx, search, event)
            for i in range(8):
                search.sampled[FINEST * event + 8 * chunk + i] = search.outputs[i]
    if search.terms == ctx.s:
        return
    for event in range(search.count):
        search.errors[event] = 0.0
    for chunk in range(search.chunks):
        fill(ctx, search, chunk, degree, ctx.s, 0)
        for event in range(search.count):
            call(ctx, search, event)
            for i in range(8):
                error = abs(search.outputs[i] - search.sampled[FINEST * event + 8 * chunk + i])
                search.errors[event] = max(search.errors[event], error if is_finite(error) else 0.0)


@compiled
def spread_state(search, t, state):
    """Put one state to all of the block."""
    put(search.times, 0, splat8(t))
    for d in range(search.dim):
        put(search.block, 8 * d, spread(state, d))


@compiled
def function(ctx, search, t, state):
    """Return the value of the function that is looked for."""
    spread_state(search, t, state)
    call(ctx, search, search.event)
    return search.outputs[0]


@compiled
def noise_of(ctx, search, t, state):
    """Return how much of the value rounding of the state may account for."""
    value = function(ctx, search, t, state)
    total = 0.0
    for first in range(0, search.dim, 8):
        count = min(8, search.dim - first)
        for i in range(count):
            search.block[8 * (first + i) + i] += NUDGE * abs(state[first + i])
        call(ctx, search, search.event)
        for i in range(count):
            slope = abs(search.outputs[i] - value) / NUDGE
            total += slope if is_finite(slope) else 0.0
            search.block[8 * (first + i) + i] = state[first + i]
    return rounding_of(total)
