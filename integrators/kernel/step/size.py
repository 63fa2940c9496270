"""Changes of the stages, the sizes they are relative to, and what of them rounding accounts for.

The size of a row is that of its block: the coordinates, or the momenta, of one body, else
the row itself. Rounding of the field may hide a block that is small beside the largest in
its group, so there are two measures, by `Blocks.weights` and by `Blocks.floored_weights`.
"""

from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import get, larger, largest, splat8, spread
from integrators.kernel.simd.operations import greatest, size, where
from integrators.kernel.step.rule import FLOOR, LARGE, LEAST_BLOCK, SMALLEST
from integrators.kernel.step.stages import offset

SIZES_LAST = 8  # steps for which the sizes of the blocks are good


@compiled
def change(ctx, scale):
    """Return the largest of the stages' change in size, each row times its scale; NaN if any is."""
    return largest(change_of_rows(ctx, scale, 0, ctx.rows))


@compiled
def change_of_rows(ctx, scale, first, last):
    """Return eight numbers of which the largest is that of `change`, of the rows from first to last."""
    new, old, lanes = ctx.stages, ctx.scratch.old_stages, ctx.lanes
    top = splat8(0.0)
    for chunk in range(ctx.chunks):
        start = offset(ctx, chunk)
        for d in range(first, last):
            moved = abs(get(new + start, lanes * d) - get(old + start, lanes * d))
            top = larger(top, moved * spread(scale, d))
    return top


@compiled
def stage_size(ctx, d, least):
    """Return the size of row d over all stages, or eight numbers ``least`` if they are larger."""
    top, lanes = least, ctx.lanes
    for chunk in range(ctx.chunks):
        top = max(top, abs(get(ctx.stages, offset(ctx, chunk) + lanes * d)))
    return largest(top)


@compiled
def stage_movement(ctx, d):
    """Return how far row d of the stages is from the state, at most."""
    top, lanes, start = splat8(0.0), ctx.lanes, spread(ctx.scratch.row_state, d)
    for chunk in range(ctx.chunks):
        top = max(top, abs(get(ctx.stages, offset(ctx, chunk) + lanes * d) - start))
    return largest(top)


@compiled
def forget_sizes(ctx):
    """Begin to measure blocks."""
    blocks = ctx.blocks
    for b in range(blocks.count):
        blocks.size[b] = 0.0
    for g in range(blocks.groups):
        blocks.largest[g] = blocks.farthest[g] = 0.0


@compiled
def enter_size(ctx, d, value):
    """Let the block of row d have at least the size ``value``."""
    blocks = ctx.blocks
    b = blocks.of_row[d]
    g = blocks.group[b]
    blocks.size[b] = max(blocks.size[b], value)
    blocks.largest[g] = max(blocks.largest[g], value)


@compiled
def inverse(size):
    """Return 1 / size; whatever moves a block of no size is a large change, and then it has a size."""
    return where(size > SMALLEST, 1.0 / size, LARGE)


@compiled
def inverse_sizes(size, largest, least, expected, absolute):
    """Return the inverse of a block's size, by both measures.

    Parameters
    ----------
    size, largest : float
        Of the block, and of the largest in its group.
    least : float
        Part of the largest that a block counts as.
    expected : float
        What it is known to reach; 0: nothing is known.
    absolute : float
        Size below which its errors do not matter.
    """
    own = greatest(greatest(size, least * largest), expected)
    return inverse(own), inverse(greatest(greatest(own, FLOOR * largest), absolute))


@compiled
def speed_of(velocity):
    """Return the velocity by momentum of a block, by size: what its sizes are multiplied by to be compared.

    Parameters
    ----------
    velocity : float
        Of its rows, q' by p; 0: momenta move nothing, and sizes are compared as they are.
    """
    speed = size(velocity)
    return where(speed > 0.0, speed, 1.0)


@compiled
def least_part(varying):
    """Return the part of the largest block in its group that a block counts as at least.

    Whether steps vary is the same in all lanes.
    """
    return LEAST_BLOCK if varying else 0.0


@compiled
def invert_sizes(ctx, weights, floored_weights):
    """Write the inverse sizes of all rows, by both measures; return whether all blocks have a size."""
    blocks, estimate = ctx.blocks, ctx.estimate
    known = True
    least = least_part(ctx.varying)
    for d in range(ctx.rows):
        b = blocks.of_row[d]
        expected = estimate.expected[b] if estimate.rescaled else 0.0
        g = blocks.group[b]
        unimportant = max(estimate.absolute[b], blocks.farthest[g])
        weights[d], floored_weights[d] = inverse_sizes(
            blocks.size[b], blocks.largest[g], least, expected, unimportant
        )
        known = known and blocks.size[b] > SMALLEST
    return known


@compiled
def take_sizes(ctx):
    """Measure the blocks on the present stages: changes are judged relative to them."""
    blocks = ctx.blocks
    forget_sizes(ctx)
    for d in range(ctx.rows):
        enter_size(ctx, d, max(stage_size(ctx, d, splat8(0.0)), abs(ctx.h) * blocks.terms[d]))
    if ctx.varying == 0 and blocks.count == ctx.rows:
        for d in range(ctx.rows):
            g = blocks.group[blocks.of_row[d]]
            blocks.farthest[g] = max(blocks.farthest[g], stage_movement(ctx, d))
    known = invert_sizes(ctx, blocks.weights, blocks.floored_weights)
    blocks.age = SIZES_LAST if known else 0
