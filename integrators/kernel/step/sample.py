"""Where a state is in memory, and the polynomial of a step."""

from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import get, put
from integrators.kernel.step.fixed_point import project
from integrators.kernel.step.stages import momentum_place, place


@compiled
def dimension(ctx):
    """Return the length of the state."""
    return ctx.rows * (2 if ctx.second else 1)


@compiled
def velocity(ctx, d):
    """Return the rate of position d, in second-order form."""
    return ctx.factors.velocity[d] * ctx.state[place(ctx, ctx.rows + d)]


@compiled
def put_in_lanes(ctx, times, stages, t, end, at_end):
    """Put a time and the present state to the first lane, another time and state to all others."""
    for lane in range(ctx.lanes):
        times[lane] = end if lane else t
        for d in range(ctx.rows):
            stages[ctx.lanes * d + lane] = (at_end if lane else ctx.state)[place(ctx, d)]


@compiled
def write(ctx, state, out):
    """Write a state in the layout of `Context.state` to memory as (q, p) or y."""
    for d in range(dimension(ctx)):
        out[d] = state[place(ctx, d)]


@compiled
def read(ctx, state, given):
    """Read a state that is laid out as `write` does."""
    for d in range(dimension(ctx)):
        state[place(ctx, d)] = given[d]


@compiled
def copy(outof, into, vectors):
    """Copy so many vectors of eight doubles."""
    for i in range(vectors):
        put(into, 8 * i, get(outof, 8 * i))


@compiled
def vectors_of_state(ctx):
    """Return how many vectors the state takes."""
    return (ctx.rows + 3) // 4 if ctx.second else (ctx.rows + 7) // 8


@compiled
def interpolate(ctx, c, out):
    """Write the collocation polynomial of the solved step at t + c h."""
    take_polynomial(ctx)
    write_polynomial(ctx, c, out)


@compiled
def take_polynomial(ctx):
    """Set the coefficients that `write_polynomial` reads."""
    project(ctx, ctx.tables.projection, ctx.tables.groups)


@compiled
def write_polynomial(ctx, c, out):
    """As `interpolate`, after `take_polynomial`.

    With the coefficients gamma of the field, y + h sum_j gamma_j int_0^c P_j; in
    second-order form the positions take the integrals of that polynomial's slope,
    projected like it: q + c h q' + h kh sum_j gamma_j (int_0^c P) X_s, column j.
    """
    tables = ctx.tables
    rows, second, h = ctx.rows, ctx.second, ctx.h
    state, gamma = ctx.state, ctx.scratch.coefficients
    write(ctx, ctx.error, out)
    x = 2.0 * c - 1.0
    # Integrals of P_{j-1}, P_j, P_{j+1}, by int_0^c L_j = (L_{j+1} - L_{j-1}) / (2 (2j+1)) for j > 0.
    lower, here = 0.0, c
    before, legendre = 1.0, x
    for j in range(ctx.s):
        after = ((2.0 * j + 3.0) * x * legendre - (j + 1.0) * before) / (j + 2.0)
        upper = (after - before) / (2.0 * (2.0 * j + 3.0) ** 0.5) if j + 1 < ctx.s else 0.0
        slope_weight = h * here
        weight = 0.0
        if second:
            weight = 0.5 * here if j == 0 else -lower / (2.0 * (4.0 * j * j - 1.0) ** 0.5)
            weight = h * (weight + upper / (2.0 * (4.0 * (j + 1.0) * (j + 1.0) - 1.0) ** 0.5))
        i = tables.first + j
        for d in range(rows):
            value = gamma[((i // 8) * ctx.padded + d) * 8 + i % 8]
            if second:
                out[d] = out[d] + ctx.factors.row[d] * (weight * value)
                out[rows + d] = out[rows + d] + slope_weight * value
            else:
                out[d] = out[d] + slope_weight * value
        lower, here = here, upper
        before, legendre = legendre, after
    for d in range(rows):
        if second:
            i = momentum_place(d)
            drift = c * (ctx.factors.drift[i] * state[i])
            out[d] = state[i + 4] + (drift + out[d])
            out[rows + d] = state[i] + out[rows + d]
        else:
            out[d] = state[d] + out[d]
