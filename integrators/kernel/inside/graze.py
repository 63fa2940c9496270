"""Contacts that begin and end between two nodes: a switching surface that the trajectory touches.

No node sees such a contact, but the distance from the surface does not fall to 0 unannounced: it has a
minimum at the nodes beside it. There the polynomial of the step is looked at more closely.
"""

from integrators.kernel.inside.surfaces import distance_at
from integrators.kernel.inside.zero import change_of_sign, deepest
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.surfaces import MOST_SIDES
from integrators.kernel.simd.memory import call_field
from integrators.kernel.step.estimate import block_size
from integrators.kernel.step.sample import interpolate, take_polynomial

DEEPER = 2.0  # times as far as a parabola may fall between its points, a distance may fall
NEAREST = 1e-10  # of a step: how well it is known where a distance is smallest, or 0
# Times the coefficients that the polynomial leaves out: between nodes it is no farther from a smooth field.
BESIDE = 10.0


@compiled
def grazes(ctx):
    """Whether the solved step, whose ends and nodes are on one side, touches a surface and it matters."""
    last = ctx.k + 1
    for i in range(1, 1 + ctx.surfaces.count):
        before, here, x_before, x_here = distance(ctx, i, 0), distance(ctx, i, 1), 0.0, ctx.tables.nodes[0]
        for j in range(2, last + 1):
            after, x_after = distance(ctx, i, j), part_at(ctx, j)
            near = may_vanish(before, here, after, x_here - x_before, x_after - x_here)
            if near and touches(ctx, i, x_before, x_after):
                return True
            before, here, x_before, x_here = here, after, x_here, x_after
    return False


@compiled
def part_at(ctx, j):
    """Return the part of the step at which point j is: the start, the nodes, the end."""
    return 0.0 if j == 0 else ctx.tables.nodes[j - 1] if j <= ctx.k else 1.0


@compiled
def distance(ctx, i, j):
    """Return the distance from surface i at point j of `part_at`."""
    lanes = ctx.lanes
    if j == 0 or j > ctx.k:
        return abs(ctx.surfaces.ends[lanes * i + (1 if j else 0)])
    call, lane = (j - 1) // lanes, (j - 1) % lanes
    return abs(ctx.surfaces.values[lanes * (MOST_SIDES * call + i) + lane])


@compiled
def may_vanish(before, here, after, back, ahead):
    """Whether a distance, smallest at the second of three points, may be 0 near that."""
    if here > before or here > after:
        return False
    curvature = ((after - here) / ahead + (before - here) / back) / (back + ahead)
    return here <= DEEPER * 0.25 * curvature * max(back, ahead) ** 2


@compiled
def touches(ctx, i, low, high):
    """Whether surface i is touched between two parts of the step by more than is negligible."""
    take_polynomial(ctx)
    x = deepest(distance_at, ctx, i, low, high, -1.0, NEAREST)
    if not distance_at(ctx, i, x) < 0.0:
        return False
    return matters(ctx, border(ctx, i, low, x), border(ctx, i, x, high))


@compiled
def border(ctx, i, low, high):
    """Return where surface i lies between two parts of the step."""
    at_low, at_high = distance_at(ctx, i, low), distance_at(ctx, i, high)
    low, high, _, _ = change_of_sign(distance_at, ctx, i, low, high, at_low, at_high, low, 0.0, NEAREST)
    return 0.5 * (low + high)


@compiled
def matters(ctx, low, high):
    """Whether between two parts of the step the field is farther from its polynomial than is negligible."""
    lanes, rows, gammas, state = ctx.lanes, ctx.rows, ctx.estimate.coefficients, ctx.surfaces.state
    width = (high - low) / lanes
    for lane in range(lanes):
        c = low + width * (lane + 0.5)
        interpolate(ctx, c, state)
        ctx.surfaces.times[lane] = ctx.t0 + c * ctx.h
        for d in range(rows):
            ctx.scratch.sums[lanes * d + lane] = state[d]
    values = ctx.stages  # the solved step does not need them any more
    call_field(ctx.field, ctx.surfaces.times, ctx.scratch.sums, ctx.par, values)
    ctx.counters.evaluations += lanes
    least = ctx.discontinuities.negligible / (abs(ctx.h) * (high - low))
    for d in range(rows):
        i = 8 * d
        smooth = BESIDE * max(max(gammas[i + 4], gammas[i + 5]), max(gammas[i + 6], gammas[i + 7]))
        most = max(smooth, least * block_size(ctx, ctx.blocks.of_row[d]))
        for lane in range(lanes):
            if abs(values[lanes * d + lane] - polynomial(ctx, d, low + width * (lane + 0.5))) > most:
                return True
    return False


@compiled
def polynomial(ctx, d, c):
    """Return the polynomial of row d of the field at a part of the step, after `interpolate`."""
    x, gamma, total = 2.0 * c - 1.0, ctx.scratch.coefficients, 0.0
    before, here = 0.0, 1.0
    for j in range(ctx.s):
        i = ctx.tables.first + j
        total += (2.0 * j + 1.0) ** 0.5 * here * gamma[((i // 8) * ctx.padded + d) * 8 + i % 8]
        before, here = here, ((2.0 * j + 1.0) * x * here - j * before) / (j + 1.0)
    return total
