"""How an iteration of one trajectory ends, by the stopping rule, and what follows from it."""

from integrators.kernel.context import BY_VALUES, DIVERGED, DONE, NOT_FINITE, RUNNING
from integrators.kernel.native.jit import compiled
from integrators.kernel.step.begin import INFINITY, rewind, start_plain
from integrators.kernel.step.fixed_point import iterate_and_evaluate, iterate_measured
from integrators.kernel.step.rule import MOST_ITERATIONS
from integrators.kernel.step.size import SIZES_LAST, change, take_sizes
from integrators.kernel.step.stopping import further, judge, residual_at_end, stagnates, untested_next


@compiled
def test(ctx, moved):
    """Apply the stopping rule to the change of the last iteration; `Solver.outcome` says what came of it."""
    solver, blocks = ctx.solver, ctx.blocks
    last, solver.last = solver.last, moved
    solver.tests += 1
    if blocks.age == 0:
        take_sizes(ctx)
    best, stalled, solver.rate, converged, residual = judge(
        moved,
        last,
        solver.best,
        solver.stalled,
        solver.rate,
        solver.tried,
        solver.tolerance,
        solver.tolerance,
    )
    if not moved < INFINITY:
        # Growing changes overflow in the end; a NaN out of the blue is the field's own.
        restart(ctx, DIVERGED if 1.0 < last < INFINITY else NOT_FINITE)
        return
    solver.best, solver.stalled = best, int(stalled)
    if stalled > 0.0 and blocks.age < SIZES_LAST and ctx.varying == 0:
        take_sizes(ctx)  # of now: what has grown since is moved by more rounding
    if converged or (
        stalled > 0.0 and stagnates(change(ctx, blocks.floored_weights), stalled, solver.stagnation)
    ):
        left = residual_at_end(converged, residual, best)
        if left > 0.0:
            extra_iterations(ctx, left)
        else:
            solver.outcome = DONE
    elif solver.tried >= MOST_ITERATIONS:
        restart(ctx, DIVERGED)


@compiled
def extra_iterations(ctx, change):
    """Iterate until next to nothing is left of a change, without a test, and let the step be solved.

    The last evaluation is at the newest stages: the field's values have the error of the
    stages that they were taken at.
    """
    solver = ctx.solver
    iterate_and_evaluate(ctx, int(further(change, solver.rate, solver.log_residual)))
    solver.outcome = DONE


@compiled
def iterate_to_end(ctx):
    """Iterate with tests until the step is solved or has failed; return the outcome."""
    while ctx.solver.outcome == RUNNING:
        test(ctx, iterate_measured(ctx, 0))
    return end_iteration(ctx)


@compiled
def count(ctx):
    """Add the evaluations of a start to the counters."""
    ctx.counters.iterations += ctx.solver.tried
    ctx.counters.evaluations += ctx.solver.tried * ctx.k


@compiled
def restart(ctx, outcome):
    """Try again without extrapolation, if there was any; else the step has failed."""
    if ctx.solver.predicted == 0:
        ctx.solver.outcome = outcome
    else:
        count(ctx)
        ctx.counters.restarts += 1
        rewind(ctx)
        start_plain(ctx)
        take_sizes(ctx)


@compiled
def end_iteration(ctx):
    """Keep the books of an iteration that has come to its end; return the outcome."""
    solver = ctx.solver
    count(ctx)
    if solver.outcome == DONE:
        ctx.solved = BY_VALUES
        if solver.predicted:
            solver.free = untested_next(solver.free, solver.tests, solver.stalled, solver.last)
    else:
        ctx.length = 0.0
    return solver.outcome
