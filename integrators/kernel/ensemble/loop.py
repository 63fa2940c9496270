"""Groups of trajectories one after another, each from its start through its samples."""

from integrators.kernel.ensemble.group import Group
from integrators.kernel.native.attributes import view
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import call_steps
from integrators.kernel.step.rule import FIRST_RATE
from integrators.kernel.step.sums import time_of_step

group_at = view(Group)


@compiled
def load(group):
    """Put the trajectories from number ``at`` on at their starts; spare lanes repeat the last one."""
    lanes, dim, rows, parameters = group.lanes, group.dim, group.rows, group.parameters
    for lane in range(lanes):
        i = min(group.at + lane, group.trajectories - 1)
        for d in range(dim):
            group.state[lanes * d + lane] = group.starts[dim * i + d]
            group.error[lanes * d + lane] = 0.0
        for d in range(parameters):
            group.par[lanes * d + lane] = group.all_par[parameters * i + d]
        for d in range(rows):
            group.velocity[lanes * d + lane] = group.all_velocity[rows * i + d]
        group.alive[lane] = 1.0
        group.iterations[lane], group.rate[lane] = 0.0, FIRST_RATE
    for i in range(group.k * rows * lanes):
        group.values[i] = 0.0
    group.n = group.sample = 0
    group.living = 1


@compiled
def unload(group):
    """Keep how the trajectories of the group ended, and go on to the next."""
    for lane in range(min(group.lanes, group.trajectories - group.at)):
        group.arrived[group.at + lane] = 1 if group.alive[lane] == 1.0 else 0
        group.all_iterations[group.at + lane] = int(group.iterations[lane])
    group.at += group.lanes
    group.sample = -1


@compiled
def write(group, source, sample):
    """Write the state in ``source`` as a sample of the trajectories of ``group``."""
    lanes, dim = group.lanes, group.dim
    for lane in range(min(lanes, group.trajectories - group.at)):
        out = group.out + dim * (group.count * (group.at + lane) + sample)
        for d in range(dim):
            out[d] = source.state[lanes * d + lane]


@compiled
def copy(source, target, count):
    """Copy so many doubles."""
    for i in range(count):
        target[i] = source[i]


@compiled
def part_step(group, partial, sample):
    """Solve in ``partial`` the step of a sample's part from the state of ``group``, which stays as it is."""
    lanes, part = group.lanes, group.parts[sample]
    copy(group.state, partial.state, lanes * group.dim)
    copy(group.error, partial.error, lanes * group.dim)
    copy(group.par, partial.par, lanes * group.parameters)
    copy(group.velocity, partial.velocity, lanes * group.rows)
    copy(group.values, partial.values, lanes * group.rows * group.k)
    for lane in range(lanes):
        partial.t0[lane], partial.time_low[lane] = time_of_step(
            group.t0[lane], group.time_low[lane], float(group.n), group.h[lane]
        )
        partial.h[lane] = part
        partial.alive[lane], partial.iterations[lane] = group.alive[lane], 0.0
        partial.rate[lane] = group.rate[lane]  # not that of another partial step
    partial.n = 0
    length = group.part_indices[sample]
    start = group.k * group.k * length
    partial.matrix = group.part_matrix + start
    partial.extrapolation = group.part_extrapolation + start
    partial.matrix_norm = group.part_norms[length]
    call_steps(partial.code, partial, 1)
    group.living = partial.living
    for lane in range(lanes):
        group.alive[lane] = partial.alive[lane]
        group.iterations[lane] += partial.iterations[lane]


@compiled
def run(first, second, budget):
    """Integrate the groups from ``at`` to ``end``; return 1 at their end, or 0 after ``budget`` steps.

    Parameters
    ----------
    first, second : int
        Addresses of a `Group`, and of another for partial steps.
    budget : int
        Steps of groups.
    """
    group, partial = group_at(first), group_at(second)
    while group.at < group.end:
        if group.sample < 0:
            load(group)
        while group.sample < group.count and group.living:
            sample = group.sample
            left = group.targets[sample] - group.n
            if left > 0:
                if budget <= 0:
                    return 0
                taken = min(left, budget)
                budget -= taken
                call_steps(group.code, group, taken)
            elif group.parts[sample] == 0.0:
                write(group, group, sample)
                group.sample += 1
            else:
                budget -= 1
                part_step(group, partial, sample)
                write(group, partial, sample)
                group.sample += 1
        unload(group)
    return 1
