"""Trajectories in lanes, each with an adaptive step size, and the next one where one has ended.

Steps are done on all lanes at once by the code of `integrators.kernel.ensemble.steps`, and most of them
are judged and followed there too (`integrators.kernel.ensemble.control`). Elsewhere, whether a step is
good enough and how long the next one is follows as it does for a single trajectory
(`integrators.kernel.trajectory.vary`): each lane has a `Context` of its own, which catches up then. A step
does not pass the time of the next sample, but ends there. Events are looked for in
every step (`integrators.kernel.ensemble.watch`).
"""

from math import log

from integrators.kernel.context import DIVERGED, DONE
from integrators.kernel.ensemble.group import LEFT, Group
from integrators.kernel.ensemble.lane import clear, context_at, fetch, unload, write
from integrators.kernel.ensemble.watch import has_room, keep_start, look_at_start, watch, watch_ordinary
from integrators.kernel.inside.discontinuities import is_near_discontinuity, previous_end
from integrators.kernel.native.attributes import view
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.discontinuities import EXTRAPOLATED
from integrators.kernel.parts.implicit import FIXED_POINT
from integrators.kernel.simd.memory import call_steps, put, splat8
from integrators.kernel.step.begin import INFINITY, can_extrapolate
from integrators.kernel.step.control import error_power, is_distinct
from integrators.kernel.step.rule import FIRST_RATE, SMALLEST
from integrators.kernel.step.size import speed_of
from integrators.kernel.step.stages import place
from integrators.kernel.trajectory.anew import reset
from integrators.kernel.trajectory.vary import (
    LIMITED_STEPS,
    MOST_ATTEMPTS,
    TARGET_ITERATIONS,
    accepts,
    begin_attempts,
    log_worth,
    take,
    within,
)
from integrators.running import watchdog
from integrators.running.watchdog import STALL_STEPS

group_at = view(Group)
makes_no_progress = compiled(watchdog.makes_no_progress)


@compiled
def load(group, lane):
    """Put the next trajectory on a lane, at its start."""
    i, lanes, parameters, rows = group.at, group.lanes, group.parameters, group.rows
    ctx = context_at(group.contexts[lane])
    group.at += 1
    group.member[lane] = i
    for d in range(parameters):
        ctx.par[d] = group.all_par[parameters * i + d]
        group.par[lanes * d + lane] = ctx.par[d]
    for d in range(rows):
        ctx.factors.velocity[d] = group.all_velocity[rows * i + d]
        group.velocity[lanes * d + lane] = ctx.factors.velocity[d]
        speed = speed_of(ctx.factors.velocity[d])  # 1 in first-order form
        ctx.blocks.speed[ctx.blocks.of_row[d]], ctx.blocks.mass[ctx.blocks.of_row[d]] = speed, 1.0 / speed
    for j in range(ctx.padded * ctx.lanes):
        ctx.values[j] = 0.0
    ctx.t0 = group.start_time
    ctx.controller.stop = ctx.controller.length_limit = INFINITY
    ctx.controller.next_length, ctx.controller.previous_length = group.first_length, 0.0
    ctx.discontinuities.doubt_end = group.start_time
    ctx.discontinuities.count = ctx.counters.steps = 0
    begin_attempts(ctx)
    reset(ctx, group.starts + group.dim * i)
    for d in range(group.dim):
        group.state[lanes * d + lane] = ctx.state[place(ctx, d)]
        group.error[lanes * d + lane] = 0.0
    if group.times[group.count - 1] < group.start_time:
        ctx.controller.next_length = -ctx.controller.next_length
    clear(group, lane)
    group.iterations[lane], group.rate[lane] = 0.0, FIRST_RATE
    group.mark[lane] = group.start_time
    group.samples_written[lane] = 0
    if group.events and not look_at_start(group, lane, ctx):
        unload(group, lane, LEFT)
    else:
        write(group, lane, ctx)


@compiled
def set_attempt(group, lane):
    """Set the length of a lane's next step; return 0 if none is short enough."""
    ctx = context_at(group.contexts[lane])
    h, length = within(ctx, ctx.controller.next_length), ctx.length
    if not is_distinct(h, ctx.t0):
        return 0
    group.h[lane], group.t0[lane], group.time_low[lane] = h, ctx.t0, ctx.time_low
    # Where the step begins and how long it is on the one whose values are there; 0: on none.
    group.ratio[lane] = h / length if can_extrapolate(h, length) else 0.0
    group.begin[lane] = 0.0 if ctx.controller.rejected else 1.0
    group.before[lane] = group.iterations[lane]
    group.alive[lane] = 1.0
    group.previous_length[lane] = ctx.controller.previous_length
    group.length_limit[lane] = ctx.controller.length_limit
    group.previous_error[lane] = ctx.controller.previous_error
    group.previous_quadrature_error[lane] = ctx.controller.previous_quadrature_error
    group.stop[lane] = ctx.controller.stop
    suspect = ctx.controller.attempts > 0 or is_near_discontinuity(ctx, h)
    first = ctx.controller.previous_length == 0.0 or h != ctx.controller.next_length
    group.unwatched[lane] = 0.0 if suspect or first else float(STALL_STEPS - ctx.counters.steps % STALL_STEPS)
    group.since[lane] = 0.0
    return 1


@compiled
def fill_lane(group, lane):
    """Have a lane ready for a step, with the next trajectory if it has none; return 0 if there is none."""
    while True:
        if group.member[lane] < 0:
            if group.at >= group.end:
                group.alive[lane] = 0.0
                return 0
            load(group, lane)
        elif set_attempt(group, lane):
            return 1
        else:
            unload(group, lane, LEFT)


@compiled
def catch_up(group, lane, ctx):
    """Let a lane's context know of the steps that were taken without it."""
    controller, discontinuities = ctx.controller, ctx.discontinuities
    ctx.t0, ctx.time_low = group.t0[lane], group.time_low[lane]
    controller.next_length = group.h[lane]
    ctx.length = controller.previous_length = group.previous_length[lane]
    controller.previous_error = group.previous_error[lane]
    controller.previous_quadrature_error = group.previous_quadrature_error[lane]
    controller.length_limit = group.length_limit[lane]
    ctx.counters.steps += int(group.since[lane])
    ctx.implicit.slow = 0
    for d in range(group.dim):
        ctx.state[place(ctx, d)] = group.state[group.lanes * d + lane]
    for d in range(group.rows):
        put(discontinuities.previous_boundary_values, 8 * d, splat8(0.0))
        discontinuities.previous_boundary_values[8 * d] = group.ends[group.lanes * d + lane]
        discontinuities.previous_last_coefficients[d] = group.last_coefficients[group.lanes * d + lane]
    discontinuities.boundary = EXTRAPOLATED


@compiled
def end_attempt(group, lane):
    """Take the step that was tried in a lane, if it is good enough."""
    ctx = context_at(group.contexts[lane])
    if group.since[lane] > 0.0:
        catch_up(group, lane, ctx)
    ctx.h = group.h[lane]
    outcome = DONE if group.alive[lane] == 1.0 else DIVERGED
    if outcome == DONE:
        fetch(group, lane, ctx)
        for d in range(group.rows):
            ctx.scratch.row_state[d] = group.state[group.lanes * d + lane]
    else:
        clear(group, lane)
    if accepts(ctx, outcome, int(group.iterations[lane] - group.before[lane]), 0):
        if group.events == 0 or watch(group, lane, ctx):
            step(group, lane, ctx)
        leave_if_slow(group, lane, ctx)
    elif ctx.discontinuities.count or ctx.controller.attempts >= MOST_ATTEMPTS:
        unload(group, lane, LEFT)


@compiled
def step(group, lane, ctx):
    """Take the step of a lane, which is good enough."""
    controller = ctx.controller
    wanted = controller.next_length
    take(ctx)
    if ctx.h != wanted:  # it was to end at a sample: what comes after it need not be as short
        controller.previous_length = 0.0
        if abs(controller.next_length) < abs(wanted):
            controller.next_length = wanted
    begin_attempts(ctx)
    for d in range(group.dim):
        group.state[group.lanes * d + lane] = group.next_state[group.lanes * d + lane]
        group.error[group.lanes * d + lane] = group.next_error[group.lanes * d + lane]
    for d in range(group.rows):
        group.ends[group.lanes * d + lane] = previous_end(ctx, d)
        group.last_coefficients[group.lanes * d + lane] = ctx.discontinuities.previous_last_coefficients[d]
    write(group, lane, ctx)


@compiled
def leave_if_slow(group, lane, ctx):
    """Let a trajectory leave its lane where it needs another solver, vanishes, or does not get anywhere."""
    if group.member[lane] >= 0 and (
        ctx.implicit.slow >= LIMITED_STEPS or is_near_zero(ctx) or has_stalled(group, lane, ctx)
    ):
        unload(group, lane, LEFT)


@compiled
def is_near_zero(ctx):
    """Whether a state is so near 0 that its steps are solved to less and less of its size in lanes."""
    result = False
    for g in range(ctx.blocks.groups):
        result = result or 0.0 < ctx.estimate.fastest[g] < SMALLEST
    return result


@compiled
def has_stalled(group, lane, ctx):
    """Whether a trajectory does not get anywhere; see `integrators.running.watchdog`."""
    if ctx.counters.steps % STALL_STEPS:
        return False
    mark = group.mark[lane]
    group.mark[lane] = ctx.t0
    way, left = abs(ctx.t0 - mark), abs(group.times[group.count - 1] - mark)
    return makes_no_progress(way, left, abs(mark - group.start_time), ctx.counters.steps - STALL_STEPS)


@compiled
def set_tolerances(group, ctx):
    """Let a group know what its steps are judged by."""
    controller, estimate, discontinuities = ctx.controller, ctx.estimate, ctx.discontinuities
    group.allowed_error = controller.allowed_error
    group.allowed_quadrature_error = controller.allowed_quadrature_error
    group.error_power = error_power(controller.error_degree)
    group.quadrature_error_power = error_power(ctx.k - 1)
    group.error_aim, group.quadrature_error_aim = controller.error_aim, controller.quadrature_error_aim
    group.error_decay, group.quadrature_error_decay = estimate.error_decay, estimate.quadrature_error_decay
    group.least_slope = estimate.least_slope
    group.doubt = discontinuities.doubt
    group.target_iterations = TARGET_ITERATIONS
    group.negligible = discontinuities.negligible if discontinuities.doubt < INFINITY else INFINITY
    group.outermost = ctx.tables.nodes[0]
    group.longest = controller.longest
    group.worth = INFINITY
    if ctx.implicit.strategy != FIXED_POINT:
        group.worth = log_worth(ctx)
        if log(estimate.error_decay) > group.worth:
            group.worth = -INFINITY


@compiled
def run(first, budget):
    """Integrate the trajectories from ``at`` to ``end``; return 1 at their end, or 0 after ``budget`` steps.

    Where `Group.more` is set it returns as soon as a lane is without a trajectory: the others go on in the
    next call, beside those that follow. It also returns where events have filled their room.

    Parameters
    ----------
    first : int
        Address of a `Group`.
    budget : int
        Steps of all lanes.
    """
    group = group_at(first)
    lanes = group.lanes
    if group.sample < 0:
        group.sample = 0
        set_tolerances(group, context_at(group.contexts[0]))
        for lane in range(lanes):
            group.member[lane] = -1
            group.ordinary[lane] = 0.0
    while True:
        running = 0
        for lane in range(lanes):
            running += 1 if group.ordinary[lane] == 1.0 else fill_lane(group, lane)
        if running == 0 or (group.more and running < lanes):
            return 1
        if budget <= 0 or not (group.events == 0 or has_room(group)):
            return 0
        group.n = 0
        if group.events:
            keep_start(group)
        # They go on by themselves while there is nothing to be looked after in any lane.
        call_steps(group.code, group, 1 if group.events else budget)
        budget -= group.n
        for lane in range(lanes):
            if group.member[lane] < 0:
                continue
            if group.ordinary[lane] == 0.0:
                end_attempt(group, lane)
            elif group.events and not watch_ordinary(group, lane):
                leave_if_slow(group, lane, context_at(group.contexts[lane]))
