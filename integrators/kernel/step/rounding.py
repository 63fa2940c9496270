"""What rounding explains: of a value by the terms that it is a sum of, of the field by its noise.

Nothing below it is evidence: of no error, no approach, no discontinuity, no loss of an invariant, no zero.
Values whose terms are known are those of invariants and of functions whose zeros are looked for. The terms of
the field are not known, but its noise is measured where nothing else is left of it: on a straight line that
is a small enough part of a step a smooth field is a polynomial of low degree but for less than rounding. Its
Legendre coefficients of high degree are then noise, whatever the terms are and however they cancel (the idea
of J. J. More and S. M. Wild, "Estimating computational noise", SIAM J. Sci. Comput. 33 (2011) 1292-1314, with
coefficients in place of differences).
"""

from math import copysign

from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.estimate import AFTER_MIDDLE, BEFORE_LAST, LAST, MIDDLE
from integrators.kernel.simd.memory import get, put, splat8, total
from integrators.kernel.simd.operations import greatest, size, where
from integrators.kernel.step.coefficients import coefficient
from integrators.kernel.step.control import INFINITY
from integrators.kernel.step.fixed_point import evaluate
from integrators.kernel.step.rule import STAGNATION
from integrators.kernel.step.stages import offset, place
from problems.analysis.roundoff import ROUNDING, UNIT

# Times the measured noise that a coefficient may be. That is the largest of four coefficients, on the less
# noisy of two lines: of normally distributed ones smaller than a tenth of their deviation in one measurement
# of 13,000; those of a step that rounding makes are up to four deviations.
BEYOND_NOISE = 40.0
# Part of the largest size in the group: what rounding adds to a block in a step is a tenth at most, or the
# iteration would not converge.
EVIDENT = 10.0 * STAGNATION
# Of a component: a line on which it moves by so little tells nothing of the field but noise.
LEAST_WAY = 2.0**-46
# Random numbers below MODULUS (W. H. Press et al., Numerical Recipes, 2nd edition, section 7.1). With regular
# ones the neighbours of some masses of a chain are moved so that the terms of their field cancel.
MULTIPLIER, INCREMENT, MODULUS = 1664525, 1013904223, 2**32


@compiled
def rounding_of(terms):
    """Return what rounding explains of a value, from the largest sum of its absolute terms so far."""
    return ROUNDING * terms


@compiled
def beyond_noise(gamma, noise):
    """Return a coefficient of the field, or 0 where noise explains it."""
    return where(gamma > BEYOND_NOISE * noise, gamma, 0.0)


@compiled
def is_visible(h, gamma, scale):
    """Whether a coefficient is more than rounding adds in a step that the fixed-point iteration solves."""
    return h * gamma > STAGNATION * scale


@compiled
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
def noise_at_end(ctx, d):
    """Return what noise explains of row d of the field at an end of a step, beside its polynomial there.

    That is the sum of k coefficients times values sqrt(2j + 1): of k times the deviation of one of them.
    """
    return BEYOND_NOISE * ctx.k * known_noise(ctx, d)


@compiled
def known_rounding(ctx, d):
    """As `known_noise`: in a formula, of no more than rounding adds in a step that can be solved."""
    noise = known_noise(ctx, d)
    rounding = EVIDENT * largest_in_group(ctx, ctx.blocks.of_row[d])
    return noise if ctx.estimate.noisy or abs(ctx.h) * noise <= rounding else 0.0


@compiled
def measure_noise(ctx):
    """Set `Estimate.noise` of each block, on lines from both ends of the solved step towards the other one.

    A discontinuity is on one of them at most.
    """
    noise, other, part = ctx.estimate.noise, ctx.estimate.slow_decay, ctx.estimate.line
    if part > 0.0:
        measure_on_line(ctx, ctx.state, ctx.next_state, 0.0, ctx.h, part, noise)
        measure_on_line(ctx, ctx.next_state, ctx.state, ctx.h, -ctx.h, part, other)
        for b in range(ctx.blocks.count):
            noise[b] = min(noise[b], other[b])
        ctx.estimate.measured = 1


@compiled
def measure_noise_behind(ctx):
    """As `measure_noise`, on a line from the state towards the start of the previous step."""
    if ctx.estimate.line > 0.0 and not ctx.estimate.measured:
        h, part = ctx.controller.previous_length, ctx.estimate.line
        measure_on_line(ctx, ctx.state, ctx.previous.state, 0.0, -h, part, ctx.estimate.noise)
        ctx.estimate.measured = 1


@compiled
def largest_in_group(ctx, b):
    """Return the largest size that a block of the group of block b has had, for the mass of that.

    In second-order form that is at least what would move the positions by their own size in a step: the
    iteration solves for them alone, and converges whatever rounding leaves of momenta near rest.
    """
    g = ctx.blocks.group[b]
    moving = ctx.blocks.largest[g] / abs(ctx.h) if ctx.second else 0.0
    return max(ctx.estimate.largest[g], moving) * ctx.blocks.mass[b]


@compiled
def largest_added(ctx):
    """Return what `Estimate.noise` adds to a block in the attempted step, as a part of the largest size.

    Or of the size that errors of the block are relative to, where that is larger: from rest.
    """
    estimate, most = ctx.estimate, 0.0
    for b in range(ctx.blocks.count):
        known = max(estimate.absolute[b], estimate.expected[b] if estimate.rescaled else 0.0)
        largest = max(largest_in_group(ctx, b), max(known, estimate.scale[b]))
        if largest > 0.0:
            most = max(most, abs(ctx.h) * estimate.noise[b] / largest)
    return most


@compiled
def change_by_noise(ctx):
    """Return the change that `Estimate.noise` makes of the stages, relative, small blocks raised."""
    most = 0.0
    for d in range(ctx.rows):
        noise = ctx.estimate.noise[ctx.blocks.of_row[d]]
        most = max(most, abs(ctx.h) * noise * ctx.blocks.floored_weights[d])
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
    return ctx.state[place(ctx, ctx.rows + d if ctx.second else d)]


@compiled
def measure_on_line(ctx, state, end, start, h, part, noise):
    """Set the largest coefficient of high degree of each block, on a line from ``state`` towards ``end``.

    Parameters
    ----------
    ctx : Context
    state, end : array
        States ...
    start, h : float
        ... at this time after that of the step, and h later.
    part : float
        The line is this part of the way between them. Its points are beside it by what the stages of a
        solved step may be.
    noise : array
        The coefficients, for all blocks.
    """
    rows, lanes, scratch, random = ctx.rows, ctx.lanes, ctx.scratch, 1 if start == 0.0 else 2
    for chunk in range(ctx.chunks):
        c = get(ctx.tables.nodes, 8 * chunk)
        put(ctx.times, 8 * chunk, splat8(ctx.t0) + (splat8(start) + c * splat8(part * h)))
        for d in range(rows):
            i = place(ctx, d)
            way = part * (end[i] - state[i])
            way += copysign(LEAST_WAY * abs(state[i]), way if way != 0.0 else h)
            put(scratch.old_stages, offset(ctx, chunk) + lanes * d, splat8(state[i]) + c * splat8(way))
    for d in range(rows):
        j = place(ctx, d)
        if state[j] == 0.0 and end[j] == 0.0:
            continue  # what stays 0 is not rounded: the field may not be defined, or another one, beside it
        left = UNIT / ctx.blocks.weights[d]
        for i in range(ctx.k):
            random = (MULTIPLIER * random + INCREMENT) % MODULUS
            away = 4.0 * random / MODULUS - 2.0
            scratch.old_stages[offset(ctx, i // 8) + lanes * d + i % 8] += away * left
    stages, values = ctx.stages, ctx.values
    ctx.stages, ctx.values = scratch.old_stages, scratch.base
    evaluate(ctx)
    ctx.counters.evaluations += ctx.k
    for b in range(ctx.blocks.count):
        noise[b] = 0.0
    for d in range(rows):
        b = ctx.blocks.of_row[d]
        for which in (MIDDLE, AFTER_MIDDLE, BEFORE_LAST, LAST):
            high = abs(total(coefficient(ctx, d, which)))
            noise[b] = greatest(where(high < INFINITY, high, 0.0), noise[b])
    ctx.stages, ctx.values = stages, values
