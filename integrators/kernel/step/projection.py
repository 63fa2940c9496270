"""The end of a step moved onto the surface of the energy that the trajectory started with.

With the energy H at the end z of a step and its gradient g, and the sizes s of the blocks of z,

    z_i  <-  z_i - s_i^2 g_i (H(z) - H_0) / sum_j (s_j g_j)^2,

which is of all changes that mend the energy, to first order, the smallest relative to the sizes, whatever
the units; again until the rest is rounding. What the change rounds away goes to the state's low part.
"""

from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.lanes import two_sum
from integrators.kernel.simd.memory import call_field, put, splat8
from integrators.kernel.step.rule import SMALLEST

MOST_CORRECTIONS = 5
# The square of a relative change of the state after which the energy is right to rounding: what is left is of
# this size.
SMALL = 1e-16


@compiled
def evaluate_energy(ctx, state):
    """Set `Energy.outputs` to the gradient at a state, and then the energy; return that."""
    energy = ctx.energy
    rows = energy.rows - 1
    state_indices, given, outputs = energy.state_indices, energy.state, energy.outputs
    for i in range(rows):
        put(given, 8 * i, splat8(state[state_indices[i]]))
    call_field(energy.code, ctx.times, given, ctx.par, outputs)
    return outputs[8 * rows]


@compiled
def block_size(ctx, first):
    """Return the size of the block that begins at a component, in the state that is evaluated."""
    given, size = ctx.energy.state, 0.0
    for i in range(first, first + ctx.energy.width):
        size = max(size, abs(given[8 * i]))
    return size


@compiled
def take_energy(ctx):
    """Let steps end with the energy of the present state, and take how much of it the components make."""
    energy = ctx.energy
    energy.start = evaluate_energy(ctx, ctx.state)
    top = 0.0
    for i in range(energy.rows - 1):
        first = i - i % energy.width
        top = max(top, block_size(ctx, first) * abs(energy.outputs[8 * i]))
    energy.scale = 1.0 / top if top > SMALLEST else 1.0


@compiled
def project_onto_energy(ctx):
    """Move the next state to the energy `Energy.start`; leave it where its energy cannot be changed so."""
    energy = ctx.energy
    rows, width, scale = energy.rows - 1, energy.width, energy.scale
    state_indices, slope, state, error = energy.state_indices, energy.outputs, ctx.next_state, ctx.next_error
    for _ in range(MOST_CORRECTIONS):
        gap = evaluate_energy(ctx, state) - energy.start
        steepness = 0.0
        for first in range(0, rows, width):
            size = block_size(ctx, first)
            for i in range(first, first + width):
                gap += slope[8 * i] * error[state_indices[i]]
                weighted = size * (slope[8 * i] * scale)
                steepness += weighted * weighted
                slope[8 * i] = size * weighted
        gap *= scale
        if not gap * gap < steepness:  # the change would be as large as the state; or it is not a number
            return
        factor = -gap / steepness
        for i in range(rows):
            j = state_indices[i]
            new, low = two_sum(state[j], factor * slope[8 * i] + error[j])
            state[j] = new
            error[j] = low
        if gap * gap <= SMALL * steepness:
            return
