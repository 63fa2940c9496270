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
from integrators.kernel.simd.operations import greatest, where
from integrators.kernel.step.coefficients import coefficient
from integrators.kernel.step.control import INFINITY
from integrators.kernel.step.fixed_point import evaluate
from integrators.kernel.step.rule import STAGNATION
from integrators.kernel.step.stages import offset

# Times the measured noise that a coefficient may be. That is the largest of four coefficients, on the less
# noisy of two lines: of normally distributed ones smaller than a tenth of their deviation in one measurement
# of 13,000; those of a step that rounding makes are up to four deviations.
BEYOND_NOISE = 40.0
# Part of the largest size in the group: what noise adds to a block in a step is not more, or the iteration
# would not converge; a coefficient ten times as large is none of rounding, in any field.
MOST_NOISE, EVIDENT = STAGNATION, 10.0 * STAGNATION
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
    estimate, blocks = ctx.estimate, ctx.blocks
    if not estimate.line > 0.0:
        return
    noise, other = estimate.noise, estimate.slow_decay
    measure_on_line(ctx, ctx.state, estimate.line, 0.0, noise)
    measure_on_line(ctx, ctx.next_state, -estimate.line, ctx.h, other)
    for b in range(blocks.count):
        least = min(noise[b], other[b])
        largest = estimate.largest[blocks.group[b]] * blocks.mass[b]
        noise[b] = least if abs(ctx.h) * least <= MOST_NOISE * largest else 0.0
    ctx.counters.evaluations += 2 * ctx.k
    estimate.measured = 1


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
