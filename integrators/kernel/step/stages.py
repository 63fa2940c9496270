"""Where a group of eight stages is in stage memory, and a component in a state."""

from integrators.kernel.native.jit import compiled


@compiled
def group_offset(chunk, block, lanes):
    """Return where a group of eight lanes begins, where blocks of ``block`` doubles have rows of 8 or 16."""
    shift = lanes >> 4
    return (chunk >> shift) * block + 8 * (chunk & shift)


@compiled
def offset(ctx, chunk):
    """Return where in stage memory the first row of a group of eight stages is."""
    lanes = ctx.lanes
    return group_offset(chunk, ctx.padded * lanes, lanes)


@compiled
def momentum_place(d):
    """Return where momentum d is in a state, in second-order form; position d is four numbers behind it."""
    return 8 * (d // 4) + d % 4


@compiled
def place(ctx, d):
    """Return where component d of (q, p), or of y, is in a state."""
    if ctx.second == 0:
        return d
    return momentum_place(d) + 4 if d < ctx.rows else momentum_place(d - ctx.rows)
