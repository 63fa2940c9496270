"""Whole trajectories: own steps to the times asked for."""

from integrators.kernel.context import BUDGET, DONE, UNSOLVED, Context
from integrators.kernel.native.attributes import view
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import put, splat8
from integrators.kernel.step.advance import looked, step
from integrators.kernel.step.begin import set_factors
from integrators.kernel.step.estimate import first_length
from integrators.kernel.step.finish import arrive
from integrators.kernel.step.sample import dimension, read, sample, vectors_of_state, write
from integrators.kernel.step.vary import CLOSE, ready, remaining, take

context = view(Context)


@compiled
def repeat(ctx, target, budget):
    """Take steps of one length to step number ``target``; return the outcome, and what is left to do."""
    for _ in range(ctx.n, target):
        if budget == 0:
            return BUDGET, budget
        outcome = step(ctx)
        if outcome != DONE:
            return outcome, budget
        budget -= 1
    return DONE, budget


@compiled
def approach(ctx, t, budget):
    """Take steps of varying length to the last one before t; return the outcome, and what is left to do."""
    while True:
        rest = remaining(ctx, t)
        if rest == 0.0:
            return DONE, budget
        outcome = ready(ctx)
        if outcome != DONE:
            return outcome, budget
        if abs(rest) < abs(ctx.h) - CLOSE * abs(t):
            return DONE, budget
        if budget == 0:
            return BUDGET, budget
        outcome = looked(ctx)
        if outcome != DONE:
            return outcome, budget
        budget -= 1
        take(ctx)


@compiled
def advance(ctx, side, between, count, times, targets, parts, first, out, budget):
    """Take own steps, and make the states asked for.

    Parameters
    ----------
    ctx, side : Context
        Of the trajectory, and for partial steps.
    between : {SIDE, LAND, DENSE}
        How states between steps are made.
    count : int
        Samples.
    times, targets, parts : doubles, integers, doubles; ``count`` of each
        Sample i is at times[i]. With steps of one length that is parts[i] beyond step
        n = targets[i]; `LAND` counts from sample i - 1.
    first : int
        The first sample still to be made.
    out : (count, dim) doubles
        Samples; overwritten.
    budget : int
        Own steps after which to come back.

    Returns
    -------
    int
        The outcome; `Context.made` tells how many samples are made.
    """
    dim = dimension(ctx)
    for i in range(first, count):
        ctx.made = i
        if ctx.varying:
            outcome, budget = approach(ctx, times[i], budget)
            part = remaining(ctx, times[i])
        else:
            outcome, budget = repeat(ctx, targets[i], budget)
            part = parts[i]
        if outcome == DONE:
            outcome = sample(ctx, side, between, times[i], part, out + dim * i)
        if outcome != DONE:
            return outcome
    ctx.made = count
    return DONE


@compiled
def walk(ctx, times, out, budget):
    """Take ``budget`` steps of varying length at most, and note their times and states.

    None goes beyond times[0]. With a budget of 0, only look whether a step remains to be taken.
    """
    dim, end = dimension(ctx), times[0]
    made = 0
    while True:
        ctx.made = made
        rest = remaining(ctx, end)
        if rest == 0.0:
            return DONE
        outcome = ready(ctx)
        if outcome != DONE:
            return outcome
        if abs(rest) < abs(ctx.h) - CLOSE * abs(end):
            return DONE
        if budget == 0:
            return BUDGET
        outcome = looked(ctx)
        if outcome != DONE:
            return outcome
        take(ctx)
        times[made] = ctx.t0
        write(ctx, ctx.state, out + dim * made)
        made += 1
        if made == budget:
            ctx.made = made
            return BUDGET


@compiled
def reset(ctx, start):
    """Put a trajectory at a start, at t0, with h or a first length: no history."""
    for i in range(vectors_of_state(ctx)):
        put(ctx.state, 8 * i, splat8(0.0))
        put(ctx.error, 8 * i, splat8(0.0))
    read(ctx, ctx.state, start)
    set_factors(ctx, ctx.h)
    ctx.length = ctx.older_length = 0.0
    ctx.n = ctx.age = ctx.free = ctx.made = 0
    ctx.solved = UNSOLVED
    ctx.outcome = DONE
    arrive(ctx)
    if ctx.varying and ctx.next_length == 0.0:
        ctx.next_length = first_length(ctx)
        ctx.age = 0
