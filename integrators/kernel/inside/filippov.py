"""Whether a trajectory slides along a switching surface that it is on, by Filippov's definition.

With a function g that is 0 on the surface, and the fields on its two sides, it does where both point to the
surface: where dg/dt along the field is negative on the side on which g is positive, and the other way round
(A. F. Filippov, "Differential Equations with Discontinuous Righthand Sides", Kluwer 1988, paragraph 4). A
speed that vanishes at the surface decides nothing; then the next derivative does. A speed vanishes if it
becomes smaller as the surface is approached. Where the field beyond does not carry a state away that has
reached the surface, rounding must not decide which field it has: it is put beyond.
"""

from integrators.kernel.inside.discontinuities import previous_end
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.surfaces import AT_STEP_END
from integrators.kernel.simd.memory import call_field
from integrators.kernel.step.control import INFINITY
from integrators.kernel.step.rounding import rounding_of
from integrators.kernel.step.sample import put_in_lanes, velocity
from integrators.kernel.step.stages import place

NEAR, FAR = 2.0**-28, 2.0**-20  # of how far states move in a step: distances from the surface
STAYS = 0.5  # of a speed at the larger distance is left at the smaller one, if it does not vanish
DIFFERENCE = 2.0**-18  # of the same: for derivatives of g
SHORT = 2.0**-17  # of a step: for its second derivative
RESOLVED = 2.0**-12  # of a state's component counts as a move of it
REACH = 2.0**-4  # of a step: where the field tells how far states move that have no slope yet
CANCELLED = 2.0**-40  # of the terms of dg/dt, from differences: what rounding may leave where they cancel
BEYOND = 2.0  # times that sum a state is put beyond a surface
NEAR_ABOVE, FAR_ABOVE, NEAR_BELOW, FAR_BELOW = range(4)


@compiled
def slides(ctx):
    """Whether the trajectory slides along a surface that the present state is on."""
    surfaces = ctx.surfaces
    if ctx.line:
        return False
    set_moves(ctx)
    for i in range(1, 1 + surfaces.count):
        put_in_lanes(ctx, surfaces.times, ctx.scratch.sums, ctx.t0, ctx.t0, ctx.state)
        call_field(surfaces.code, surfaces.times, ctx.scratch.sums, ctx.par, surfaces.between)
        g = surfaces.between[ctx.lanes * i]
        if (g == 0.0 or i == surfaces.row) and slides_along(ctx, i, g):
            return True
    return False


@compiled
def set_moves(ctx):
    """Set in `Surfaces.state` how far each component moves in a step, which is what is near a surface."""
    surfaces, lanes, values, states = ctx.surfaces, ctx.lanes, ctx.values, ctx.scratch.sums
    moves, h = surfaces.state, abs(ctx.controller.next_length)
    put_in_lanes(ctx, surfaces.times, states, ctx.t0, ctx.t0, ctx.state)
    call_field(ctx.field, surfaces.times, states, ctx.par, values)
    for d in range(ctx.rows):
        slope = abs(values[lanes * d])
        if ctx.second:
            moves[d] = h * (abs(velocity(ctx, d)) + h * abs(ctx.factors.velocity[d]) * slope)
        else:
            before = abs(previous_end(ctx, d)) if surfaces.on_surface == AT_STEP_END else 0.0
            moves[d] = h * max(slope, before)
        moves[d] += RESOLVED * abs(ctx.state[place(ctx, d)])
    ctx.counters.evaluations += 1
    if ctx.second:
        return
    for d in range(ctx.rows):
        for lane in range(lanes):
            states[lanes * d + lane] += REACH * ctx.controller.next_length * values[lanes * d]
    call_field(ctx.field, surfaces.times, states, ctx.par, values)
    ctx.counters.evaluations += 1
    for d in range(ctx.rows):
        later = h * abs(values[lanes * d])
        if later > moves[d] and later * 0.0 == 0.0:
            moves[d] = later


@compiled
def set_gradient(ctx, i, g):
    """Set the derivatives of function i behind the moves in `Surfaces.state`; return that in time."""
    surfaces, lanes, rows, states = ctx.surfaces, ctx.lanes, ctx.rows, ctx.scratch.sums
    moves, gradient = surfaces.state, surfaces.state + ctx.padded
    for first in range(0, rows, lanes):
        count = min(lanes, rows - first)
        put_in_lanes(ctx, surfaces.times, states, ctx.t0, ctx.t0, ctx.state)
        for lane in range(count):
            states[lanes * (first + lane) + lane] += DIFFERENCE * moves[first + lane]
        call_field(surfaces.code, surfaces.times, states, ctx.par, surfaces.between)
        for lane in range(count):
            d = first + lane
            moved = states[lanes * d + lane] - ctx.state[place(ctx, d)]
            gradient[d] = (surfaces.between[lanes * i + lane] - g) / moved if moved != 0.0 else 0.0
    change = DIFFERENCE * abs(ctx.controller.next_length)
    put_in_lanes(ctx, surfaces.times, states, ctx.t0 + change, ctx.t0 + change, ctx.state)
    call_field(surfaces.code, surfaces.times, states, ctx.par, surfaces.between)
    return (surfaces.between[lanes * i] - g) / (surfaces.times[0] - ctx.t0)


@compiled
def slides_along(ctx, i, g):
    """Whether on both sides of surface i, whose function is g at the state, the field points to it."""
    surfaces, lanes, rows, states, values = ctx.surfaces, ctx.lanes, ctx.rows, ctx.stages, ctx.values
    moves, gradient, h = surfaces.state, surfaces.state + ctx.padded, ctx.controller.next_length
    rate = set_gradient(ctx, i, g)
    largest, square, terms = 0.0, 0.0, 0.0
    for d in range(rows):
        largest = max(largest, abs(moves[d] * gradient[d]))
        terms += abs(gradient[d] * ctx.state[place(ctx, d)])
    if not 0.0 < largest < INFINITY:
        return False
    for d in range(rows):
        square += (moves[d] * gradient[d] / largest) ** 2
    size, rounding = square**0.5 * largest, rounding_of(terms)
    put_in_lanes(ctx, surfaces.times, states, ctx.t0, ctx.t0, ctx.state)
    for d in range(rows):
        part = moves[d] * (moves[d] * gradient[d] / size)
        states[lanes * d + NEAR_ABOVE] += (NEAR - g / size) * part
        states[lanes * d + FAR_ABOVE] += (FAR - g / size) * part
        states[lanes * d + NEAR_BELOW] += (-NEAR - g / size) * part
        states[lanes * d + FAR_BELOW] += (-FAR - g / size) * part
    call_field(ctx.field, surfaces.times, states, ctx.par, values)
    ctx.counters.evaluations += 4
    set_curved(ctx, SHORT * h)
    call_field(surfaces.code, surfaces.times, states, ctx.par, surfaces.ends)
    for lane in range(lanes):
        surfaces.times[lane] = ctx.t0 + SHORT * h
    call_field(surfaces.code, surfaces.times, ctx.scratch.sums, ctx.par, surfaces.between)
    ahead = 1.0 if h > 0.0 else -1.0
    above = way(ctx, i, NEAR_ABOVE, rate, rounding) * ahead
    below = way(ctx, i, NEAR_BELOW, rate, rounding) * ahead
    if ctx.second == 0 and surfaces.on_surface == AT_STEP_END:
        arrival = rate
        for d in range(rows):
            arrival += gradient[d] * previous_end(ctx, d)
        beyond = 1.0 if arrival * ahead > 0.0 else -1.0
        if (above if beyond > 0.0 else below) == 0.0:
            move = beyond * max(BEYOND * rounding, rounding_of(size)) - g
            for d in range(rows):
                ctx.state[d] += move / size * (moves[d] * (moves[d] * gradient[d] / size))
    return above < 0.0 and below > 0.0


@compiled
def set_curved(ctx, move):
    """Set states a time later than those of the lanes, to second order."""
    surfaces, lanes, rows, states, values = ctx.surfaces, ctx.lanes, ctx.rows, ctx.stages, ctx.values
    after = ctx.scratch.sums
    for d in range(rows):
        for lane in range(lanes):
            j = lanes * d + lane
            if ctx.second:
                curved = 0.5 * move * ctx.factors.velocity[d] * values[j]
                after[j] = states[j] + move * (velocity(ctx, d) + curved)
            else:
                after[j] = states[j] + move * values[j]
    if ctx.second:
        return
    slopes = ctx.scratch.old_stages
    for lane in range(lanes):
        surfaces.times[lane] = ctx.t0 + move
    call_field(ctx.field, surfaces.times, after, ctx.par, slopes)
    ctx.counters.evaluations += 4
    for d in range(rows):
        for lane in range(lanes):
            j = lanes * d + lane
            after[j] = states[j] + 0.5 * move * (values[j] + slopes[j])
    for lane in range(lanes):
        surfaces.times[lane] = ctx.t0


@compiled
def speed(ctx, lane, rate):
    """Return the derivative of the function along the field of a lane; 0 if that may be rounding."""
    gradient, total, terms = ctx.surfaces.state + ctx.padded, rate, abs(rate)
    for d in range(ctx.rows):
        slope = velocity(ctx, d) if ctx.second else ctx.values[ctx.lanes * d + lane]
        total += gradient[d] * slope
        terms += abs(gradient[d] * slope)
    return total if abs(total) > CANCELLED * terms else 0.0


@compiled
def way(ctx, i, near, rate, rounding):
    """Return the sign of the first derivative of function i that does not vanish on a side; 0: of none."""
    at_near, at_far = speed(ctx, near, rate), speed(ctx, near + 1, rate)
    if remains(at_near, at_far, 0.0):
        return 1.0 if at_near > 0.0 else -1.0
    surfaces, at = ctx.surfaces, ctx.lanes * i + near
    move = SHORT * ctx.controller.next_length
    at_near = surfaces.between[at] - surfaces.ends[at] - move * at_near
    at_far = surfaces.between[at + 1] - surfaces.ends[at + 1] - move * at_far
    if remains(at_near, at_far, rounding):
        return (1.0 if at_near > 0.0 else -1.0) * (1.0 if move > 0.0 else -1.0)
    return 0.0


@compiled
def remains(at_near, at_far, rounding):
    """Whether a derivative that is so large near and far from a surface does not vanish there."""
    return at_near * at_far > 0.0 and abs(at_near) >= STAYS * abs(at_far) and abs(at_near) > rounding
