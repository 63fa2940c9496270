"""When the implicit solver takes over from the fixed-point iteration, and how it is called."""

from integrators.kernel.context import BUDGET, DONE
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.implicit import FIXED_POINT, FOR_STEPS
from integrators.kernel.simd.memory import call_solver
from integrators.kernel.step.iterate import iterate_to_end

SLOW_ITERATIONS = 100  # iterations of a step at which the fixed-point iteration is slow
SLOW_STEPS = 4  # slow steps in a row after which the implicit solver takes over
LEAST_STEPS, MOST_STEPS = 16, 256  # steps for which it then stays, twice as many each time


@compiled
def solve_implicitly(ctx, partial, started):
    """Solve the step in ``partial``, ``ctx`` itself or a partial step of it, by the implicit solver."""
    ctx.counters.implicit_steps += 1 - started
    ctx.older_length = 0.0
    return call_solver(partial.implicit.code, partial, partial.implicit.memory, started)


@compiled
def request_solver(ctx):
    """Come back for the implicit solver, which has to be loaded first; the step is continued then."""
    ctx.implicit.wanted = FOR_STEPS
    return BUDGET


@compiled
def switch_if_slow(ctx, outcome):
    """Let the implicit solver take over from a fixed-point iteration that failed or was slow."""
    implicit = ctx.implicit
    if implicit.strategy == FIXED_POINT:
        return outcome
    implicit.slow = implicit.slow + 1 if outcome != DONE or ctx.solver.tried >= SLOW_ITERATIONS else 0
    if outcome == DONE and implicit.slow < SLOW_STEPS:
        return outcome
    if implicit.code == 0:
        return request_solver(ctx)
    implicit.held = implicit.left = min(max(2 * implicit.held, LEAST_STEPS), MOST_STEPS)
    implicit.slow = 0
    implicit.active = 1
    ctx.counters.switches += 1
    return outcome if outcome == DONE else solve_implicitly(ctx, ctx, 0)


@compiled
def solve_part(ctx, partial):
    """Solve a partial step of ``ctx``, prepared in ``partial``; return the outcome."""
    partial.solver.stagnation = ctx.solver.stagnation
    if ctx.implicit.active:
        return solve_implicitly(ctx, partial, 1)
    outcome = iterate_to_end(partial)
    if outcome == DONE or ctx.implicit.strategy == FIXED_POINT:
        return outcome
    if partial.implicit.code == 0:
        return request_solver(ctx)
    partial.solver.predicted = 0
    return solve_implicitly(ctx, partial, 1)
