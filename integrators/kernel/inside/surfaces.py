"""Steps that end on a switching surface, where the field jumps by more than the tolerance allows.

A step whose nodes are not all on one side is tried again with the length at which its distance from the
surface vanishes, until no node is beyond and the surface is where the step ends: the polynomial of a step
whose nodes are on one side tells where, a little beyond its end too. The next step begins on the other side.
Where the fields on both sides push to the surface, the trajectory would slide along it, or stick; see
`inside.filippov`.
"""

from integrators.kernel.context import DONE
from integrators.kernel.inside.discontinuities import previous_end
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.surfaces import AT_ORIGIN, END_ACROSS, MOST_SIDES, NO_SURFACE
from integrators.kernel.simd.memory import call_field
from integrators.kernel.step.begin import INFINITY
from integrators.kernel.step.control import is_distinct
from integrators.kernel.step.sample import put_in_lanes, take_polynomial, velocity, write_polynomial

# What comes of a step that crosses a surface, or was to end on one: judged like all others; tried again with
# `Controller.next_length`; it ends on the surface.
ORDINARY, AGAIN, REACHED = range(3)

MOST_TRIALS = 16  # of lengths of a step
MOST_EXTRAPOLATED = 1.25  # of a step is as far as its polynomial is trusted
SECANTS = 12  # evaluations of a distance
LAST_SECANT = 2.0**-56  # the product of two moves of a secant is about the next one
ON_SURFACE = 2.0**-50  # part of a step that its end may be from the surface
NEAR_SURFACE = 1e-9  # so near, the polynomial of a step tells to the last bit where the surface is
NUDGE = 2.0**-20  # part of a step by which is looked beyond a surface


@compiled
def is_number(x):
    """Whether x is finite."""
    return abs(x) < INFINITY


@compiled
def value_at_node(ctx, i, j):
    """Return output i of the sides at node j."""
    call, lane = j // ctx.lanes, j % ctx.lanes
    return ctx.surfaces.values[ctx.lanes * (MOST_SIDES * call + i) + lane]


@compiled
def value_at(ctx, i, j):
    """Return output i of the sides at the start, j = -1, or at node j."""
    return ctx.surfaces.ends[ctx.lanes * i] if j < 0 else value_at_node(ctx, i, j)


@compiled
def first_point(ctx):
    """Return the first point that tells on which side a step is: a start on a surface tells nothing."""
    return 0 if ctx.surfaces.on_surface else -1


@compiled
def look_across(ctx, outcome):
    """Set and return `Surfaces.across`: the first node on another side than the start, if any."""
    surfaces = ctx.surfaces
    lanes = ctx.lanes
    size = lanes * ctx.padded
    for call in range(ctx.calls):
        values = surfaces.values + lanes * MOST_SIDES * call
        call_field(surfaces.code, ctx.times + lanes * call, ctx.stages + size * call, ctx.par, values)
    times, ends = surfaces.times, ctx.scratch.sums
    put_in_lanes(ctx, times, ends, ctx.t0, ctx.t0 + ctx.h, ctx.next_state)
    call_field(surfaces.code, times, ends, ctx.par, surfaces.ends)
    surfaces.across = NO_SURFACE
    here = value_at(ctx, 0, first_point(ctx))
    for j in range(ctx.k):
        value = value_at_node(ctx, 0, j)
        if value != here:
            if is_number(value):
                surfaces.across = j
            return surfaces.across
    if outcome == DONE and surfaces.ends[1] != here:
        surfaces.across = END_ACROSS
    return surfaces.across


@compiled
def locate(ctx, outcome, fits):
    """Return what comes of a step that crosses a surface by more than is allowed, or was to end on one.

    Parameters
    ----------
    ctx : Context
    outcome : int
        How its equations were solved.
    fits : bool
        Whether its errors are small enough.
    """
    surfaces = ctx.surfaces
    h = abs(ctx.h)
    first = surfaces.locating == 0
    if first:
        surfaces.near, surfaces.far, surfaces.distance = 0.0, INFINITY, INFINITY
        surfaces.length_wanted = ctx.h
    surfaces.locating += 1
    if surfaces.locating > MOST_TRIALS:
        return ORDINARY
    if surfaces.across >= 0:
        surfaces.far = min(surfaces.far, h)
        length = first_crossing(ctx) * h
        if not surfaces.near < length:
            length = 0.5 * (surfaces.near + h)
        return try_length(ctx, length)
    if outcome != DONE or not (fits or (first and surfaces.across == END_ACROSS)):
        return ORDINARY
    if surfaces.distance <= NEAR_SURFACE and fits:
        return REACHED
    part = part_to_surface(ctx)
    if part == 0.0:
        return ORDINARY
    apart = abs(part - 1.0)
    if apart <= ON_SURFACE:
        return REACHED if fits else ORDINARY
    surfaces.distance = apart
    length = part * h
    if surfaces.across == NO_SURFACE:
        surfaces.near = max(surfaces.near, h)
        if length >= surfaces.far:
            length = 0.5 * (h + surfaces.far)
            if length - h <= NEAR_SURFACE * h:
                return ORDINARY
        if length > ctx.controller.longest or length > abs((ctx.controller.stop - ctx.t0) - ctx.time_low):
            return ORDINARY
    return try_length(ctx, length)


@compiled
def try_length(ctx, length):
    """Let the next attempt have a length; ORDINARY if that is too short."""
    if not is_distinct(length, ctx.t0):
        return ORDINARY
    ctx.controller.next_length = length if ctx.h > 0.0 else -length
    return AGAIN


@compiled
def changes_sign(before, after):
    """Whether a distance passes 0: one that is 0 before, as a height at rest, tells no place."""
    return before != 0.0 and (before > 0.0) != (after > 0.0)


@compiled
def first_crossing(ctx):
    """Return the part of the step after which a surface is crossed, from the distances at nodes.

    Sets `Surfaces.row`, the row of the distance that vanishes there; 0: none tells.
    """
    surfaces = ctx.surfaces
    j = surfaces.across
    before = j - 1 if j > 0 else first_point(ctx)
    low = 0.0 if before < 0 or before == j else ctx.tables.nodes[before]
    high = ctx.tables.nodes[j]
    part, surfaces.row = high, 0
    for i in range(1, 1 + surfaces.count):
        a, b = value_at(ctx, i, before), value_at(ctx, i, j)
        if changes_sign(a, b):
            crossing = low + (high - low) * abs(a) / (abs(a) + abs(b))
            if crossing <= part:
                part, surfaces.row = crossing, i
    return part if part > low else 0.5 * (low + high)


@compiled
def part_to_surface(ctx):
    """Return the part of the step at which its polynomial is on the surface, near its end; 0: nowhere there.

    Of all surfaces that are known to be crossed, the first.
    """
    surfaces = ctx.surfaces
    if surfaces.row == 0 or surfaces.across == END_ACROSS:
        here = value_at(ctx, 0, first_point(ctx))
        earliest, row = INFINITY, 0
        for i in range(1, 1 + surfaces.count):
            a, b = value_at_node(ctx, i, ctx.k - 1), surfaces.ends[ctx.lanes * i + 1]
            if changes_sign(a, b) or (i == surfaces.row and surfaces.ends[1] != here):
                part = abs(a) / (abs(a) + abs(b))
                if part < earliest:
                    earliest, row = part, i
        if row:
            surfaces.row = row
    if surfaces.row == 0:
        return 0.0
    row = surfaces.row
    take_polynomial(ctx)
    before, at = ctx.tables.nodes[ctx.k - 1], 1.0
    value_before, value = distance_at(ctx, row, before), distance_at(ctx, row, at)
    if value_before == 0.0:  # stages of a longer step were beyond this one: in fact it is 0 all along
        return 0.0
    # Secants without a bracket: a surface that is only touched has the same side before and after.
    for _ in range(SECANTS):
        if value == 0.0:
            break
        decrease = value_before - value
        if decrease == 0.0:
            break
        move = value * (at - before) / decrease
        if not is_number(move):
            return 0.0
        after = min(max(at + move, 0.5), MOST_EXTRAPOLATED)
        apart = abs(at - before)
        before, at, value_before = at, after, value
        if abs(after - before) * apart <= LAST_SECANT:
            break
        value = distance_at(ctx, row, at)
    return (
        at
        if is_number(value) and at > 0.5 and not (at == MOST_EXTRAPOLATED and value > value_before)
        else 0.0
    )


@compiled
def distance_at(ctx, row, c):
    """Return a distance at part c of the step, negative beyond a surface; after `take_polynomial`."""
    surfaces = ctx.surfaces
    lanes, state = ctx.lanes, surfaces.state
    write_polynomial(ctx, c, state)
    for lane in range(lanes):
        surfaces.times[lane] = ctx.t0 + c * ctx.h
        for d in range(ctx.rows):
            ctx.scratch.sums[lanes * d + lane] = state[d]
    call_field(surfaces.code, surfaces.times, ctx.scratch.sums, ctx.par, surfaces.between)
    size = abs(surfaces.between[lanes * row])
    return size if surfaces.between[0] == value_at(ctx, 0, first_point(ctx)) else -size


@compiled
def find_surface(ctx):
    """Set `Surfaces.on_surface` at a trajectory's start, and the row of the surface that it is on."""
    surfaces = ctx.surfaces
    surfaces.on_surface = surfaces.reached = surfaces.row = surfaces.locating = 0
    if surfaces.code == 0:
        return
    put_in_lanes(ctx, surfaces.times, ctx.scratch.sums, ctx.t0, ctx.t0, ctx.state)
    call_field(surfaces.code, surfaces.times, ctx.scratch.sums, ctx.par, surfaces.between)
    for i in range(1, 1 + surfaces.count):
        if surfaces.between[ctx.lanes * i] == 0.0:
            surfaces.on_surface, surfaces.row = AT_ORIGIN, i


@compiled
def leave(ctx):
    """Let the first stages of the step ahead be beyond the surface that the trajectory leaves."""
    surfaces, scratch = ctx.surfaces, ctx.scratch
    lanes, rows, values, h = ctx.lanes, ctx.rows, ctx.values, ctx.controller.next_length
    move = NUDGE * h
    later = ctx.t0 + move
    put_in_lanes(ctx, surfaces.times, scratch.sums, later, later, ctx.state)
    if ctx.second == 0 and surfaces.on_surface == AT_ORIGIN:
        call_field(ctx.field, surfaces.times, scratch.sums, ctx.par, values)
        ctx.counters.evaluations += 1
    for d in range(rows):
        if ctx.second:
            slope = velocity(ctx, d)
        else:
            slope = values[lanes * d] if surfaces.on_surface == AT_ORIGIN else previous_end(ctx, d)
        for lane in range(lanes):
            scratch.sums[lanes * d + lane] += move * slope
    call_field(ctx.field, surfaces.times, scratch.sums, ctx.par, values)
    ctx.counters.evaluations += 1
    for call in range(ctx.calls):
        for d in range(rows):
            value, start = values[lanes * d], lanes * (ctx.padded * call + d)
            for lane in range(lanes):
                values[start + lane] = value
    ctx.length, ctx.controller.rejected, ctx.blocks.age = h, 1, 0
