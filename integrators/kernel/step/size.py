"""Changes of the stages, the sizes they are relative to, and what of them rounding accounts for.

The size of a row is that of its block: the coordinates, or the momenta, of one body, else
the row itself. Rounding of the field may hide a block that is small beside the largest in
its group, so there are two measures: `strict`, by the block's own size, and `floored`.
"""

from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import get, larger, largest, splat8, spread
from integrators.kernel.step.rule import FLOOR, LARGE, NOTHING, SMALLEST
from integrators.kernel.step.stages import offset

SIZES_LAST = 8  # steps for which the sizes of the blocks are good


@compiled
def change(ctx, scale):
    """Return the largest of the stages' change in size, each row times its scale; NaN if any is."""
    new, old = ctx.stages, ctx.old_stages
    rows, lanes = ctx.rows, ctx.lanes
    top = splat8(0.0)
    for chunk in range(ctx.chunks):
        start = offset(ctx, chunk)
        for d in range(rows):
            moved = abs(get(new + start, lanes * d) - get(old + start, lanes * d))
            top = larger(top, moved * spread(scale, d))
    return largest(top)


@compiled
def stage_size(ctx, d, least):
    """Return the size of row d over all stages, or eight numbers ``least`` if they are larger."""
    top, lanes = least, ctx.lanes
    for chunk in range(ctx.chunks):
        top = max(top, abs(get(ctx.stages, offset(ctx, chunk) + lanes * d)))
    return largest(top)


@compiled
def forget_sizes(ctx):
    """Begin to measure blocks."""
    for b in range(ctx.block_count):
        ctx.size[b] = 0.0
    for g in range(ctx.group_count):
        ctx.largest[g] = 0.0


@compiled
def enter_size(ctx, d, value):
    """Let the block of row d have at least the size ``value``."""
    b = ctx.block[d]
    g = ctx.group[b]
    ctx.size[b] = max(ctx.size[b], value)
    ctx.largest[g] = max(ctx.largest[g], value)


@compiled
def invert_sizes(ctx, strict, floored):
    """Write the inverse sizes of all rows, by both measures; return whether all blocks have a size."""
    known = True
    nothing = NOTHING if ctx.varying else 0.0
    for d in range(ctx.rows):
        b = ctx.block[d]
        largest = ctx.largest[ctx.group[b]]
        own = max(ctx.size[b], nothing * largest)
        if ctx.rescaled:
            own = max(own, ctx.expected[b])
        floor = max(max(own, FLOOR * largest), ctx.absolute[b])
        known = known and ctx.size[b] > SMALLEST
        # Whatever moves a block of no size is a large change; and then it has a size: look again.
        strict[d] = 1.0 / own if own > SMALLEST else LARGE
        floored[d] = 1.0 / floor if floor > SMALLEST else LARGE
    return known


@compiled
def take_sizes(ctx):
    """Measure the blocks on the present stages: changes are judged relative to them."""
    forget_sizes(ctx)
    for d in range(ctx.rows):
        enter_size(ctx, d, stage_size(ctx, d, splat8(0.0)))
    known = invert_sizes(ctx, ctx.strict, ctx.floored)
    ctx.age = SIZES_LAST if known else 0
