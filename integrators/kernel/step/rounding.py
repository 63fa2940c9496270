"""What rounding explains of the field: its noise, measured where nothing else is left of it.

On a straight line that is a small enough part of a step, a smooth field is a polynomial of low degree but for
less than rounding. Its Legendre coefficients of high degree are then noise, whatever the field's terms are
and however they cancel (the idea of J. J. More and S. M. Wild, "Estimating computational noise", SIAM J. Sci.
Comput. 33 (2011) 1292-1314, with coefficients in place of differences). A coefficient that noise explains is
evidence of nothing: of no error, of no approach, of no discontinuity.
"""

from math import copysign

from integrators.kernel.native.jit import compiled, for_both_widths
from integrators.kernel.parts.estimate import AFTER_MIDDLE, BEFORE_LAST, LAST, MIDDLE
from integrators.kernel.simd.memory import get, put, splat8, total
from integrators.kernel.simd.operations import greatest, size, where
from integrators.kernel.step.begin import start_plain
from integrators.kernel.step.coefficients import coefficient
from integrators.kernel.step.control import INFINITY
from integrators.kernel.step.fixed_point import evaluate
from integrators.kernel.step.rule import STAGNATION
from integrators.kernel.step.stages import offset

# Times the measured noise that a coefficient may be. That is the largest of four coefficients, on the less
# noisy of two lines: of normally distributed ones smaller than a tenth of their deviation in one measurement
# of 13,000; those of a step that rounding makes are up to four deviations.
BEYOND_NOISE = 40.0
# Part of the largest size in the group: what rounding adds to a block in a step is a tenth at most, or the
# iteration would not converge.
EVIDENT = 10.0 * STAGNATION
# Of a component: a line on which it moves by so little tells nothing of the field but noise.
LEAST_WAY = 2.0**-46


@for_both_widths
def beyond_noise(gamma, noise):
    """Return a coefficient of the field, or 0 where noise explains it."""
    return where(gamma > BEYOND_NOISE * noise, gamma, 0.0)


@for_both_widths
def is_evident(h, gamma, largest):
    """Whether a coefficient is more than rounding explains in any field that steps can be solved with.

    Parameters
    ----------
    h, gamma : float
        Length of the step, and the coefficient.
    largest : float
        The largest size that a block of the group has had, for the mass of this one.
    """
    return h * gamma > EVIDENT * largest


@compiled
def known_noise(ctx, d):
    """Return the noise of row d of the field, 0 where it was not measured in the step that was estimated."""
    return ctx.estimate.noise[ctx.blocks.of_row[d]] if ctx.estimate.measured else 0.0


@compiled
def measure_noise(ctx):
    """Set `Estimate.noise` of each block, on lines from both ends of the solved step towards the other one.

    A discontinuity is on one of them at most.
    """
    if not ctx.estimate.line > 0.0:
        return
    measure_on_both_lines(ctx)
    noise = ctx.estimate.noise
    for b in range(ctx.blocks.count):
        if not abs(ctx.h) * noise[b] <= ctx.solver.stagnation * largest_in_group(ctx, b):
            noise[b] = 0.0
    ctx.estimate.measured = 1


@compiled
def largest_in_group(ctx, b):
    """Return the largest size that a block of the group of block b has had, for the mass of that."""
    return ctx.estimate.largest[ctx.blocks.group[b]] * ctx.blocks.mass[b]


@compiled
def measure_on_both_lines(ctx):
    """Set `Estimate.noise` of each block, whatever it is."""
    estimate = ctx.estimate
    noise, other = estimate.noise, estimate.slow_decay
    measure_on_line(ctx, ctx.state, estimate.line, 0.0, noise)
    measure_on_line(ctx, ctx.next_state, -estimate.line, ctx.h, other)
    for b in range(ctx.blocks.count):
        noise[b] = min(noise[b], other[b])
    ctx.counters.evaluations += 2 * ctx.k


@compiled
def noise_in_step(ctx):
    """Return what noise adds in the attempted step, which has failed: the largest part of a size in a group.

    The end of the step, which is unknown, is taken from the field at its start.
    """
    start_plain(ctx)
    evaluate(ctx)
    for d in range(ctx.rows):
        if ctx.second:
            i = 8 * (d // 4) + d % 4
            ctx.next_state[i + 4] = ctx.state[i + 4] + ctx.h * ctx.factors.velocity[d] * ctx.state[i]
        else:
            ctx.next_state[d] = ctx.state[d] + ctx.h * ctx.values[ctx.lanes * d]
    note_sizes(ctx)
    measure_on_both_lines(ctx)
    most = 0.0
    for b in range(ctx.blocks.count):
        added, largest = abs(ctx.h) * ctx.estimate.noise[b], largest_in_group(ctx, b)
        if largest > 0.0:
            most = max(most, added / largest)
    return most


@compiled
def note_sizes(ctx):
    """Let the largest sizes of the groups be at least those of the present state."""
    blocks, largest = ctx.blocks, ctx.estimate.largest
    for d in range(ctx.rows):
        b = blocks.of_row[d]
        g = blocks.group[b]
        largest[g] = greatest(size(momentum(ctx, d)) * blocks.speed[b], largest[g])


@compiled
def momentum(ctx, d):
    """Return the component of the state whose slope is row d of the field."""
    i = 8 * (d // 4) + d % 4 if ctx.second else d
    return ctx.state[i]


@compiled
def measure_on_line(ctx, state, part, start, noise):
    """Set the largest coefficient of high degree of each block, on a line from ``state``.

    It is a part of the solved step, and begins ``start`` after that.
    """
    rows, lanes, scratch = ctx.rows, ctx.lanes, ctx.scratch
    for chunk in range(ctx.chunks):
        c = get(ctx.tables.nodes, 8 * chunk)
        put(ctx.times, 8 * chunk, splat8(ctx.t0) + (splat8(start) + c * splat8(part * ctx.h)))
        for d in range(rows):
            i = 8 * (d // 4) + 4 + d % 4 if ctx.second else d
            way = part * (ctx.next_state[i] - ctx.state[i])
            way += copysign(LEAST_WAY * abs(state[i]), way if way != 0.0 else part)
            put(scratch.old_stages, offset(ctx, chunk) + lanes * d, splat8(state[i]) + c * splat8(way))
    stages, values = ctx.stages, ctx.values
    ctx.stages, ctx.values = scratch.old_stages, scratch.base
    evaluate(ctx)
    for b in range(ctx.blocks.count):
        noise[b] = 0.0
    for d in range(rows):
        b = ctx.blocks.of_row[d]
        for which in (MIDDLE, AFTER_MIDDLE, BEFORE_LAST, LAST):
            high = abs(total(coefficient(ctx, d, which)))
            noise[b] = greatest(where(high < INFINITY, high, 0.0), noise[b])
    ctx.stages, ctx.values = stages, values
