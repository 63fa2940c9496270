"""Whole trajectories: steps to the times asked for."""

from integrators.kernel.context import BUDGET, DONE, MISSED, NOISY, STATE, UNSCALED, Context
from integrators.kernel.inside.discontinuities import confirm_previous_step, is_smooth_to_end
from integrators.kernel.native.attributes import view
from integrators.kernel.native.jit import compiled
from integrators.kernel.step.advance import looked, step, watched
from integrators.kernel.step.estimate import shorten_first
from integrators.kernel.step.sample import dimension, write
from integrators.kernel.trajectory.act import act, length_to_take, look_for_action, step_or_act
from integrators.kernel.trajectory.part import followed, sample
from integrators.kernel.trajectory.vary import TIME_TOLERANCE, remaining, solve_adaptive, take

context = view(Context)


@compiled
def repeat(ctx, target, budget):
    """Take fixed steps to step number ``target``; return the outcome, and what is left to do."""
    for _ in range(ctx.n, target):
        if budget == 0:
            return BUDGET, budget
        outcome = step_or_act(ctx, 0.0, False) if ctx.events.act else step(ctx)
        if outcome != DONE:
            return outcome, budget
        budget -= 1
    return DONE, budget


@compiled
def approach(ctx, t, budget):
    """Take adaptive steps to the last one before t; return the outcome, and what is left to do."""
    while True:
        time_left, begin = remaining(ctx, t), ctx.t0
        if time_left == 0.0:
            if confirm_previous_step(ctx):
                return DONE, budget
            continue
        outcome = solve_adaptive(ctx)
        if outcome != DONE:
            return outcome, budget
        if ctx.t0 != begin:  # the previous step was undone
            time_left = remaining(ctx, t)
        time_left, h = abs(time_left), abs(ctx.h)
        inside = time_left < h - TIME_TOLERANCE * abs(t)
        if (
            watched(ctx) or (inside and time_left > (1.0 - ctx.tables.nodes[0]) * h)
        ) and not is_smooth_to_end(ctx):
            continue
        outcome = look_for_action(ctx)
        if outcome != DONE:
            return outcome, budget
        if time_left < length_to_take(ctx) - TIME_TOLERANCE * abs(t):
            return DONE, budget
        if budget == 0:
            return BUDGET, budget
        acts = ctx.events.acting
        outcome = act(ctx) if acts else looked(ctx)
        if outcome != DONE:
            return outcome, budget
        budget -= 1
        if not acts:
            take(ctx)


@compiled
def advance(ctx, partial, between, count, times, targets, parts, first, out, budget):
    """Take steps, and make the states asked for.

    Parameters
    ----------
    ctx, partial : Context
        Of the trajectory, and for partial steps.
    between : {PARTIAL, STOP, DENSE}
        How states between steps are made.
    count : int
        Samples.
    times, targets, parts : doubles, integers, doubles; ``count`` of each
        Sample i is at times[i]. With fixed step size that is parts[i] beyond step
        n = targets[i]; `STOP` counts from sample i - 1.
    first : int
        The first sample still to be made.
    out : (count, dim) doubles
        Samples; overwritten.
    budget : int
        Steps after which to come back.

    Returns
    -------
    int
        The outcome; `Context.samples_written` tells how many samples are made.
    """
    dim = dimension(ctx)
    if ctx.varying:
        shorten_first(ctx)
    for i in range(first, count):
        ctx.samples_written = i
        outcome = MISSED
        while outcome == MISSED:
            if ctx.varying:
                outcome, budget = approach(ctx, times[i], budget)
                part = remaining(ctx, times[i])
            else:
                outcome, budget = repeat(ctx, targets[i], budget)
                part = parts[i]
                if outcome == DONE and ctx.events.act and part != 0.0:
                    outcome = step_or_act(ctx, times[i], True)
            if outcome == DONE:
                outcome = sample(ctx, partial, between, times[i], part, out + dim * i)
        if outcome != DONE:
            return outcome
    ctx.samples_written = count
    return DONE


@compiled
def take_steps(ctx, times, out, budget):
    """Take ``budget`` adaptive steps at most, and note their times and states.

    None goes beyond times[0]. With a budget of 0, only look whether a step remains to be taken.
    """
    dim, end = dimension(ctx), times[0]
    count = 0
    shorten_first(ctx)
    while True:
        ctx.samples_written = count
        taken = ctx.counters.steps
        over = remaining(ctx, end) == 0.0 or count == budget > 0
        outcome = DONE if over else solve_adaptive(ctx)
        # What is handed out before others follow is not undone any more.
        comes_back = over or (count > 0 and outcome in (BUDGET, NOISY, UNSCALED))
        confirmed = not comes_back or confirm_previous_step(ctx)
        if ctx.counters.steps < taken and count > 0:  # else it was no step of these
            count -= 1
            ctx.samples_written = count
        if confirmed and over:
            return DONE if remaining(ctx, end) == 0.0 else BUDGET
        if confirmed and outcome != DONE:
            return outcome
        if not confirmed or (watched(ctx) and not is_smooth_to_end(ctx)):
            continue
        outcome = look_for_action(ctx)
        if outcome != DONE:
            return outcome
        if abs(remaining(ctx, end)) < length_to_take(ctx) - TIME_TOLERANCE * abs(end):
            return DONE
        if budget == 0:
            return BUDGET
        taken, acts = ctx.counters.steps, ctx.events.acting
        outcome = act(ctx) if acts else looked(ctx)
        if outcome != DONE and not acts:
            return outcome
        if not acts:
            take(ctx)
        if ctx.counters.steps > taken:  # else an event at the start of the step has changed the state
            times[count] = ctx.t0
            write(ctx, ctx.state, out + dim * count)
            followed(ctx, ctx, STATE)
            count += 1
        if outcome != DONE:
            ctx.samples_written = count
            return outcome
