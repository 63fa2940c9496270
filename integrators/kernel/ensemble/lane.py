"""A lane: where the numbers of its trajectory are, its samples, and its end."""

from integrators.kernel.context import Context
from integrators.kernel.native.attributes import view
from integrators.kernel.native.jit import compiled
from integrators.kernel.step.kinks import arrived
from integrators.kernel.step.vary import remaining

context_at = view(Context)


@compiled
def place(ctx, d):
    """Return where component d of (q, p), or of y, is in a state of a `Context`."""
    if ctx.second == 0:
        return d
    rows = ctx.rows
    return 8 * (d // 4) + 4 + d % 4 if d < rows else 8 * ((d - rows) // 4) + (d - rows) % 4


@compiled
def clear(group, lane):
    """Forget the lane's values of the field, and their polynomial."""
    for i in range(group.k * group.rows):
        group.values[group.lanes * i + lane] = group.ahead[group.lanes * i + lane] = 0.0


@compiled
def unload(group, lane, arrived):
    """Take the trajectory from a lane."""
    i = group.member[lane]
    group.arrived[i] = arrived
    group.all_sweeps[i] = int(group.sweeps[lane])
    group.all_steps[i] = context_at(group.contexts[lane]).counters.steps
    group.member[lane] = -1


@compiled
def write(group, lane, ctx):
    """Write the samples that are at the present time; after the last one the trajectory is at its end."""
    i, dim, count = group.member[lane], group.dim, group.samples_written[lane]
    while count < group.count:
        ctx.controller.stop = group.times[count]
        if remaining(ctx, ctx.controller.stop) != 0.0:
            break
        out = group.out + dim * (group.count * i + count)
        for d in range(dim):
            out[d] = group.state[group.lanes * d + lane]
        count += 1
    group.samples_written[lane] = count
    if count == group.count:
        unload(group, lane, 1 if arrived(ctx) else 0)
