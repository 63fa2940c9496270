"""Functions on states: on the polynomial of the step eight at a time, and on one state."""

from integrators.kernel.events.memory import FINE, FINEST
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import call_field, get, put, splat8, spread

ROUNDING = 4 * 2.0**-52
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
    """Return the place of sample i."""
    return (1.0 - search.cosines[i * (FINE * FINEST // degree)]) / 2.0


@compiled
def time_at(search, x):
    """Return the time of a place, which may be a little beyond the end."""
    if x == 0.0:
        return search.start
    return search.end if x == 1.0 else search.start + x * (search.end - search.start)


@compiled
def part_at(search, t):
    """Return how far a time is from the start of the step."""
    return (t - search.time) - search.time_low


@compiled
def interpolate8(ctx, search):
    """Write the polynomial of the solved step at eight times to the block.

    As `integrators.kernel.step.sample.interpolate`, which has the formulas; coefficients are projected already.
    """
    rows, second, h = ctx.rows, ctx.second, ctx.h
    state, gamma, block = ctx.state, ctx.coefficients, search.block
    c = ((get(search.times, 0) - search.time) - search.time_low) / h
    for d in range(rows):
        if second:
            i = 8 * (d // 4) + d % 4
            put(block, 8 * d, spread(ctx.error, i + 4))
            put(block, 8 * (rows + d), spread(ctx.error, i))
        else:
            put(block, 8 * d, spread(ctx.error, d))
    x = 2.0 * c - 1.0
    lower, here = splat8(0.0), c
    before, legendre = splat8(1.0), x
    for j in range(ctx.s):
        after = ((2.0 * j + 3.0) * x * legendre - (j + 1.0) * before) / (j + 2.0)
        upper = splat8(0.0)
        if j + 1 < ctx.s:
            upper = (after - before) / (2.0 * (2.0 * j + 3.0) ** 0.5)
        slope_weight = h * here
        weight = 0.5 * here
        if j > 0:
            weight = lower / (-2.0 * (4.0 * j * j - 1.0) ** 0.5)
        weight = h * (weight + upper / (2.0 * (4.0 * (j + 1.0) * (j + 1.0) - 1.0) ** 0.5))
        i = ctx.first + j
        for d in range(rows):
            value = gamma[((i // 8) * ctx.padded + d) * 8 + i % 8]
            if second:
                put(block, 8 * d, get(block, 8 * d) + (ctx.row_factor[d] * value) * weight)
                put(block, 8 * (rows + d), get(block, 8 * (rows + d)) + slope_weight * value)
            else:
                put(block, 8 * d, get(block, 8 * d) + slope_weight * value)
        lower, here = here, upper
        before, legendre = legendre, after
    for d in range(rows):
        if second:
            i = 8 * (d // 4) + d % 4
            drift = c * (ctx.drift_factor[i] * state[i])
            put(block, 8 * d, spread(state, i + 4) + (drift + get(block, 8 * d)))
            put(block, 8 * (rows + d), spread(state, i) + get(block, 8 * (rows + d)))
        else:
            put(block, 8 * d, spread(state, d) + get(block, 8 * d))


@compiled
def fill(ctx, search, chunk, degree):
    """Put states to the block: at samples 1 + 8 chunk and those that follow, the exact one at the end."""
    for i in range(8):
        j = 1 + 8 * chunk + i
        search.times[i] = time_at(search, node(search, j, degree)) if j < degree else search.end
    interpolate8(ctx, search)
    for i in range(max(degree - 1 - 8 * chunk, 0), 8):
        for d in range(search.dim):
            search.block[8 * d + i] = search.end_state[d]


@compiled
def call(ctx, search, event):
    """Set `Search.found` to the values of a function on the block."""
    found = search.found
    if search.raised:
        put(found, 0, splat8(NAN))
        return
    call_field(search.functions[event], search.times, search.block, ctx.par, found)
    if found[8] != 0.0:
        search.raised = 1
        found[8] = 0.0


@compiled
def sample(ctx, search, degree):
    """Set `Search.values` of the function that is looked for, at more samples of the stretch."""
    for chunk in range((degree + 7) // 8):
        fill(ctx, search, chunk, degree)
        call(ctx, search, search.event)
        for i in range(min(8, degree - 8 * chunk)):
            search.values[1 + 8 * chunk + i] = search.found[i]
    search.values[0] = search.start_value
    search.values[degree] = search.end_value


@compiled
def sample_first(ctx, search):
    """Set `Search.sampled` of all functions."""
    degree = search.degree
    for chunk in range((degree + 7) // 8):
        fill(ctx, search, chunk, degree)
        for event in range(search.count):
            call(ctx, search, event)
            for i in range(min(8, degree - 8 * chunk)):
                search.sampled[FINEST * event + 8 * chunk + i] = search.found[i]


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
    return search.found[0]


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
            slope = abs(search.found[i] - value) / NUDGE
            total += slope if is_finite(slope) else 0.0
            search.block[8 * (first + i) + i] = state[first + i]
    return ROUNDING * total
