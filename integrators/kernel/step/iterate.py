"""How an iteration of one trajectory ends, by the stopping rule, and what follows from it."""

from integrators.kernel.context import BY_VALUES, DIVERGED, DONE, NOT_FINITE, RUNNING
from integrators.kernel.native.jit import compiled
from integrators.kernel.step.begin import INFINITY, rewind, start_plain
from integrators.kernel.step.rule import ROUNDING
from integrators.kernel.step.size import SIZES_LAST, change, take_sizes
from integrators.kernel.step.stopping import further, judge, left_over, stagnates
from integrators.kernel.step.sweep import sweep_measured, sweep_to_the_end

MAX_ITERATIONS = 200


@compiled
def test(ctx, strict):
    """Apply the stopping rule to the change of the last sweep; `Context.outcome` says what came of it."""
    last, ctx.last = ctx.last, strict
    ctx.tests += 1
    if ctx.age == 0:
        take_sizes(ctx)
    best, stalled, ctx.rate, converged, rest = judge(
        strict, last, ctx.best, ctx.stalled, ctx.rate, ctx.tried, ctx.tolerance, ctx.tolerance
    )
    if not strict < INFINITY:
        # Growing changes overflow in the end; a NaN out of the blue is the field's own.
        restart(ctx, DIVERGED if 1.0 < last < INFINITY else NOT_FINITE)
        return
    ctx.best, ctx.stalled = best, int(stalled)
    if stalled > 0.0 and ctx.age < SIZES_LAST and ctx.varying == 0:
        take_sizes(ctx)  # of now: what has grown since is moved by more rounding
    if converged or (stalled > 0.0 and stagnates(change(ctx, ctx.floored), stalled)):
        left = left_over(converged, rest, best)
        if left > 0.0:
            polish(ctx, left)
        else:
            ctx.outcome = DONE
    elif ctx.tried >= MAX_ITERATIONS:
        restart(ctx, DIVERGED)


@compiled
def polish(ctx, change):
    """Iterate until next to nothing is left of a change, without a test, and let the step be solved.

    The last evaluation is at the newest stages: the field's values have the error of the
    stages that they were taken at.
    """
    sweep_to_the_end(ctx, int(further(change, ctx.rate, ctx.log_rest)))
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
            # Two tests tell how the changes fall; more mean that the first came early. It came late where
            # nothing was left to fall: then further changes are rounding, however many were looked at.
            falling = ctx.tests - ctx.stalled
            late = ctx.stalled == 0 and ctx.tests <= 2 and ctx.last <= ROUNDING
            ctx.free = max(ctx.free + falling - (3 if late else 2), 0)
    else:
        ctx.length = 0.0
    return ctx.outcome
