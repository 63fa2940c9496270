"""What the steps call of a line integral: the one C function."""

from integrators.kernel.context import DONE, END, NOT_FINITE, NOT_KEPT, VALUES
from integrators.kernel.line.context import INVARIANTS, LineContext
from integrators.kernel.line.invariants import correction, find_change, keep_invariants, measure_gap
from integrators.kernel.line.poisson import keep_energy
from integrators.kernel.native.attributes import view
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.lanes import fma, two_sum
from integrators.kernel.simd.memory import call_field
from integrators.kernel.step.finish import added
from integrators.kernel.step.stages import group_offset

context = view(LineContext)

KEPT = 1e-8  # an invariant that changes faster, relative to the terms of its change, is none


@compiled
def entry(operation, address):
    """Do what ``what`` names for the context at an address; see `integrators.kernel.context.Context.line`."""
    ctx = context(address)
    if operation == VALUES:
        evaluate(ctx)
        return DONE
    if operation == END:
        if ctx.mode == INVARIANTS and find_change(ctx, KEPT):
            return NOT_KEPT
        return end(ctx)
    if ctx.mode == INVARIANTS:
        measure_gap(ctx)
    return DONE


@compiled
def evaluate(ctx):
    """Set ``values`` at the stages to those of a polynomial with the line integral's coefficients."""
    lanes = ctx.lanes
    stage, row = lanes * ctx.padded, lanes * ctx.every
    for call in range(ctx.calls):
        call_field(
            ctx.field,
            ctx.times + lanes * call,
            ctx.stages + stage * call,
            ctx.par,
            ctx.gradients + row * call,
        )
    if ctx.mode == INVARIANTS:
        keep_invariants(ctx)
    else:
        keep_energy(ctx)


@compiled
def end(ctx):
    """Set the next state, y + h rho_0, rounded once; return DONE or NOT_FINITE.

    The mean of the field over the stages is summed up with the rounding errors of
    its terms, and its weights with their low parts.
    """
    lanes, h = ctx.lanes, ctx.h
    several = ctx.mode == INVARIANTS
    values = ctx.gradients if several else ctx.values
    block = lanes * (ctx.every if several else ctx.padded)
    weights, weights_low, state, error = ctx.tables.weights, ctx.tables.weights_low, ctx.state, ctx.error
    damage = 0.0
    for d in range(ctx.rows):
        mean, low = 0.0, 0.0
        for i in range(ctx.k):
            value = values[group_offset(i // 8, block, lanes) + lanes * d + i % 8]
            term = weights[i] * value
            mean, rounding = two_sum(mean, term)
            low += rounding + fma(weights[i], value, -term) + weights_low[i] * value
        if several:
            mean, rounding = two_sum(mean, -correction(ctx, d))
            low += rounding
        ctx.next_state[d], ctx.next_error[d] = added(state[d], error[d], h, mean, low)
        damage += ctx.next_state[d] * 0.0
    return DONE if damage == 0.0 else NOT_FINITE
