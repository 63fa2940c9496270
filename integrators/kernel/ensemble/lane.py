"""A lane: where the numbers of its trajectory are, its samples, and its end."""

from integrators.kernel.context import Context
from integrators.kernel.ensemble.group import ARRIVED, LEFT
from integrators.kernel.inside.discontinuities import confirm_previous_step
from integrators.kernel.native.attributes import view
from integrators.kernel.native.jit import compiled
from integrators.kernel.step.stages import place
from integrators.kernel.trajectory.vary import remaining

context_at = view(Context)


@compiled
def clear(group, lane):
    """Forget the lane's values of the field, and their polynomial."""
    for i in range(group.k * group.rows):
        group.values[group.lanes * i + lane] = group.ahead[group.lanes * i + lane] = 0.0


@compiled
def unload(group, lane, how):
    """Take the trajectory from a lane."""
    i = group.member[lane]
    group.arrived[i] = how
    group.all_iterations[i] = int(group.iterations[lane])
    group.all_steps[i] = context_at(group.contexts[lane]).counters.steps
    group.member[lane] = -1


@compiled
def fetch(group, lane, ctx):
    """Let the context of a lane have the solved step: its end, and the values of the field."""
    lanes, rows = group.lanes, group.rows
    for d in range(group.dim):
        ctx.next_state[place(ctx, d)] = group.next_state[lanes * d + lane]
        ctx.next_error[place(ctx, d)] = group.next_error[lanes * d + lane]
    for d in range(rows):
        for i in range(group.k):
            ctx.values[ctx.lanes * d + i] = group.values[lanes * (rows * i + d) + lane]


@compiled
def write_sample(group, lane, state, sample):
    """Write a row of a lane, its state or its next state, as a sample of its trajectory."""
    dim = group.dim
    out = group.out + dim * (group.count * group.member[lane] + sample)
    for d in range(dim):
        out[d] = state[group.lanes * d + lane]


@compiled
def write_until(group, lane, stop, sign):
    """Write the samples at the end of the step in which the trajectory stops, if that is no earlier."""
    count = group.samples_written[lane]
    while count < group.count and (group.times[count] - stop) * sign <= 0.0:
        write_sample(group, lane, group.next_state, count)
        count += 1
    group.samples_written[lane] = count


@compiled
def write(group, lane, ctx):
    """Write the samples that are at the present time; after the last one the trajectory is at its end."""
    count = group.samples_written[lane]
    while count < group.count:
        ctx.controller.stop = group.times[count]
        if remaining(ctx, ctx.controller.stop) != 0.0:
            break
        write_sample(group, lane, group.state, count)
        count += 1
    group.samples_written[lane] = count
    if count == group.count:
        unload(group, lane, ARRIVED if confirm_previous_step(ctx) and knows_events(group, lane) else LEFT)


@compiled
def knows_events(group, lane):
    """Whether all event functions were finite somewhere."""
    known = True
    for i in range(group.events):
        known = known and group.function_finite[group.events * lane + i] == 1
    return known
