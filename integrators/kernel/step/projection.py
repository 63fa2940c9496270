"""The end of a step moved onto the surface of the energy that the trajectory started with.

With the energy H at the end z of a step and its gradient g, and the sizes s of the blocks of z,

    z_i  <-  z_i - s_i^2 g_i (H(z) - H_0) / sum_j (s_j g_j)^2,

which is of all changes that mend the energy, to first order, the smallest relative to the sizes, whatever
the units; again until the rest is rounding. What the change rounds away goes to the state's low part.
"""

from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.lanes import two_sum
from integrators.kernel.simd.memory import call_field, put, splat8

MOST_CORRECTIONS = 5
# A relative change of the state after which the energy is right to rounding: what is left is of its square.
SMALL = 1e-8


@compiled
def place(ctx, i):
    """Return where component i of (q, p) or y is in `Context.state`."""
    if ctx.second == 0:
        return i
    d = i if i < ctx.rows else i - ctx.rows
    return 8 * (d // 4) + d % 4 + (4 if i < ctx.rows else 0)


@compiled
def measure_energy(ctx, state, error):
    """Set `Context.energy_found` at a state; return its energy."""
    last = ctx.energy_rows - 1
    given, found = ctx.energy_state, ctx.energy_found
    for i in range(last):
        put(given, 8 * i, splat8(state[place(ctx, i)]))
    call_field(ctx.energy_code, ctx.times, given, ctx.par, found)
    low = 0.0
    for i in range(last):
        low += found[8 * i] * error[place(ctx, i)]
    return found[8 * last] + low


@compiled
def block_size(ctx, first):
    """Return the size of the block of the next state whose first component is given."""
    size = 0.0
    for i in range(first, first + ctx.energy_width):
        size = max(size, abs(ctx.next_state[place(ctx, i)]))
    return size


@compiled
def project_onto_energy(ctx):
    """Move the next state to the energy `Context.energy`; leave it where it is not moved by that."""
    dim, width = ctx.energy_rows - 1, ctx.energy_width
    slope, state, error = ctx.energy_found, ctx.next_state, ctx.next_error
    for _ in range(MOST_CORRECTIONS):
        gap = measure_energy(ctx, state, error) - ctx.energy
        steepness = 0.0
        for first in range(0, dim, width):
            size = block_size(ctx, first)
            for i in range(first, first + width):
                slope[8 * i] *= size
                steepness += slope[8 * i] * slope[8 * i]
                slope[8 * i] *= size
        factor = -gap / steepness if steepness > 0.0 else 0.0
        if not abs(factor) * steepness**0.5 < 1.0:
            return
        for i in range(dim):
            j = place(ctx, i)
            new, lost = two_sum(state[j], factor * slope[8 * i] + error[j])
            state[j] = new
            error[j] = lost
        if abs(factor) * steepness**0.5 <= SMALL:
            return
