"""Whole trajectories: own steps to the times asked for, one by one or in step with others."""

from integrators.kernel.context import BUDGET, DONE, RUNNING, UNSOLVED, Context
from integrators.kernel.native.attributes import view
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import put, splat8
from integrators.kernel.step.advance import step
from integrators.kernel.step.begin import begin, set_factors
from integrators.kernel.step.estimate import first_length
from integrators.kernel.step.finish import arrive, commit, finish
from integrators.kernel.step.handover import reconsider
from integrators.kernel.step.iterate import close, test
from integrators.kernel.step.sample import dimension, read, sample, vectors_of_state, write
from integrators.kernel.step.sweep import sweep, sweep_measured
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
    ctx.alive = 1
    arrive(ctx)
    if ctx.varying and ctx.next_length == 0.0:
        ctx.next_length = first_length(ctx)
        ctx.age = 0


# --- several trajectories in step with each other -----------------------------------------------------


@compiled
def busy(ctx):
    """Whether a trajectory of a batch has a step to solve."""
    return ctx.alive == 1 and ctx.outcome == RUNNING


@compiled
def together(contexts, count):
    """Take one step on each living trajectory, all of them at the same time; see `advance.step`.

    One trajectory's field waits for its own square roots and divisions; the
    others' work fills that time. Each sees the operations it would see alone.
    """
    most = 0
    for m in range(count):
        ctx = context(contexts[m])
        if ctx.alive:
            ctx.outcome = DONE
            if ctx.solved == UNSOLVED:
                begin(ctx)
                ctx.untested = ctx.free if ctx.predicted else 0
                most = max(most, ctx.untested)
    for j in range(most):
        for m in range(count):
            ctx = context(contexts[m])
            if busy(ctx) and j < ctx.untested:
                sweep(ctx, 1)
    running = True
    while running:
        running = False
        for m in range(count):
            ctx = context(contexts[m])
            if busy(ctx):
                test(ctx, sweep_measured(ctx))
                running = running or ctx.outcome == RUNNING
                if ctx.outcome != RUNNING:
                    ctx.outcome = reconsider(ctx, close(ctx))
    for m in range(count):
        ctx = context(contexts[m])
        if ctx.alive:
            if ctx.outcome == DONE:
                ctx.outcome = finish(ctx)
            if ctx.outcome == DONE:
                commit(ctx)
            else:
                ctx.alive = 0


@compiled
def advance_batch(contexts, members, between, count, times, targets, parts, first, out, budget):
    """Make the samples from ``first`` on of all living members of a batch; see `advance`.

    ``contexts`` holds the addresses of the members' contexts and then of those for
    their partial steps; ``out`` (members, count, dim) doubles. A member that fails stops living,
    with its outcome and its samples made; the others go on. One that needs the implicit solver stops
    so as well, and wants it. Returns the sample that is next after ``budget`` steps, or ``count``.
    """
    dim = dimension(context(contexts[0]))
    for i in range(first, count):
        n, living = 0, False
        for m in range(members):
            ctx = context(contexts[m])
            if ctx.alive:
                ctx.made = i
                n, living = ctx.n, True
        if not living:
            return count
        for _ in range(n, targets[i]):
            if budget == 0:
                return i
            budget -= 1
            together(contexts, members)
        for m in range(members):
            ctx = context(contexts[m])
            if ctx.alive:
                side, place = context(contexts[members + m]), out + dim * (count * m + i)
                ctx.outcome = sample(ctx, side, between, times[i], parts[i], place)
                ctx.alive = 1 if ctx.outcome == DONE else 0
                ctx.made = i + 1 if ctx.outcome == DONE else i
    return count
