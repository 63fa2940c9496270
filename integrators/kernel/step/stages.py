"""Where a group of eight stages is in stage memory."""

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
