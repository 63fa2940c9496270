"""The stopping rule of the fixed-point iteration, and what follows from how it ended."""

from math import log2

from integrators.kernel.context import BY_VALUES, DIVERGED, DONE, NOT_FINITE, RUNNING
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.lanes import binary_log
from integrators.kernel.step.begin import INFINITY, rewind, start_plain
from integrators.kernel.step.rule import FALL, LEAST, PATIENCE, ROUNDING, STAGNATION, STEEP
from integrators.kernel.step.size import change, is_rounding, take_sizes
from integrators.kernel.step.sweep import sweep_measured, sweep_to_the_end

MAX_ITERATIONS = 200
LOG_TRUSTED, LOG_STEEP = log2(1e-11), log2(STEEP)
LOG_PROMISE, LOG_FALL = log2(3.0 * LEAST), log2(FALL)
FASTEST, SLOWEST = -10.0, -1.0  # contraction, as far as it is believed
MOST_EXTRA = 16  # sweeps of `polish`


@compiled
def test(ctx, strict):
    """Apply the stopping rule to the change of the last sweep; `Context.outcome` says what came of it.

    The iteration has converged when the change, relative to its block, is at most the tolerance, or
    when it has stopped decreasing where rounding accounts for it, or when it is small and falls so
    steeply that the rest is known. Then `polish` takes it on.
    """
    last, ctx.last = ctx.last, strict
    ctx.tests += 1
    if ctx.age == 0:
        take_sizes(ctx)
    size = binary_log(max(strict, LEAST))
    rate = size - binary_log(last)
    # From 1 on, a change is no part of a size: a block was 0, or there was no change before.
    follows = last < 1.0
    if follows and (strict > ROUNDING or rate < ctx.rate):  # if it is rounding, it falls that fast at least
        ctx.rate = min(max(rate, FASTEST), SLOWEST)
    if not strict < INFINITY:
        # Growing changes overflow in the end; a NaN out of the blue is the field's own.
        restart(ctx, DIVERGED if 1.0 < last < INFINITY else NOT_FINITE)
    elif strict <= ctx.tolerance:
        polish(ctx, ctx.tolerance)
    elif strict < ctx.best:
        ctx.best, ctx.stalled = strict, 0
        steep = follows and rate <= LOG_STEEP and size <= LOG_TRUSTED
        if steep and ctx.tried * (size - LOG_PROMISE) <= LOG_FALL:
            polish(ctx, strict)
        elif ctx.tried >= MAX_ITERATIONS:
            restart(ctx, DIVERGED)
    else:
        ctx.stalled += 1
        if is_rounding(change(ctx, ctx.floored), ctx.stalled >= PATIENCE):
            if ctx.best <= STAGNATION:
                polish(ctx, ctx.best)
            else:  # a block that is nothing beside the others, and may be growing
                ctx.outcome = DONE
        elif ctx.tried >= MAX_ITERATIONS:
            restart(ctx, DIVERGED)


@compiled
def polish(ctx, change):
    """Iterate until next to nothing is left of a change, without a test, and let the step be solved.

    The last evaluation is at the newest stages: the field's values have the error of the
    stages that they were taken at. What is left there acts on the energy in the same direction in every step.
    """
    more = int((ctx.log_rest - binary_log(change)) / ctx.rate)
    sweep_to_the_end(ctx, min(max(more, 0), MOST_EXTRA))
    ctx.outcome = DONE


@compiled
def settle(ctx):
    """Iterate with tests until the step is solved or has failed; return the outcome."""
    while ctx.outcome == RUNNING:
        test(ctx, sweep_measured(ctx, 0))
    return close(ctx)


@compiled
def count(ctx):
    """Add the evaluations of a start to the counters."""
    ctx.iterations += ctx.tried
    ctx.evaluations += ctx.tried * ctx.k


@compiled
def restart(ctx, outcome):
    """Try again without extrapolation, if there was any; else the step has failed."""
    if ctx.predicted == 0:
        ctx.outcome = outcome
    else:
        count(ctx)
        ctx.restarts += 1
        rewind(ctx)
        start_plain(ctx)
        take_sizes(ctx)


@compiled
def close(ctx):
    """Keep the books of an iteration that has come to its end; return the outcome."""
    count(ctx)
    if ctx.outcome == DONE:
        ctx.solved = BY_VALUES
        if ctx.predicted:
            # Two tests tell how the changes fall, or that they do not any more; more mean that the
            # first came early. It came late where nothing was left to fall.
            late = ctx.stalled > 0 or ctx.last <= ROUNDING
            ctx.free = max(ctx.free + ctx.tests - (3 if late and ctx.tests <= 2 else 2), 0)
    else:
        ctx.length = 0.0
    return ctx.outcome
