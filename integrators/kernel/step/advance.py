"""One step of HBVM(k, s), as on paper.

    gamma_j = sum_l b_l P_j(c_l) f(t + c_l h, Y_l),    Y_l = y + h sum_j gamma_j int_0^{c_l} P_j,
    y_1     = y + h gamma_0:

first stages from the polynomial of the step before; iterations, each of which evaluates the field
at the stages and makes new ones of its values; a test of how much they still change; the state
at the end, with what rounding took from it.
"""

from integrators.kernel.context import DONE, STEP
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import call_follow, call_look
from integrators.kernel.step.begin import begin
from integrators.kernel.step.finish import commit, finish
from integrators.kernel.step.fixed_point import iterate_measured
from integrators.kernel.step.iterate import iterate_to_end, test
from integrators.kernel.step.solver_switch import solve_implicitly, switch_if_slow


@compiled
def solve(ctx):
    """Solve the step ahead, unless that is done; return the outcome."""
    if ctx.solved:
        return DONE
    if ctx.implicit.active:
        return solve_implicitly(ctx, ctx, 0)
    begin(ctx)
    test(ctx, iterate_measured(ctx, ctx.solver.free if ctx.solver.predicted else 0))
    return switch_if_slow(ctx, iterate_to_end(ctx))


@compiled
def watched(ctx):
    """Whether each step is to be seen before it is taken, and so no step that is undone."""
    return ctx.events.code != 0 or ctx.follow != 0


@compiled
def looked(ctx):
    """Look for events in the step ahead, and let vectors follow it, if that is asked for; the outcome."""
    events = ctx.events
    outcome = call_look(events.code, ctx, events.memory) if events.code and events.act == 0 else DONE
    if outcome == DONE and ctx.follow:
        outcome = call_follow(ctx.follow, STEP, ctx, ctx.follow_memory)
    return outcome


@compiled
def step(ctx):
    """Take one step; the state stays where it was if the step fails."""
    outcome = solve(ctx)
    if outcome == DONE:
        outcome = finish(ctx)
    if outcome == DONE:
        outcome = looked(ctx)
    if outcome == DONE:
        commit(ctx)
    return outcome
