"""What Python calls: the one C function of the steps."""

from integrators.kernel.context import ACT, ADVANCE, ATTEMPT, DONE, GO_ON, PART, RESET
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.views import doubles, integers
from integrators.kernel.step.sample import write
from integrators.kernel.trajectory.act import change, go_on
from integrators.kernel.trajectory.anew import reset
from integrators.kernel.trajectory.loop import advance, context, take_steps
from integrators.kernel.trajectory.part import part_step
from integrators.kernel.trajectory.vary import go_on_attempting


@compiled
def entry(operation, ctx, partial, between, count, times, targets, parts, first, out, budget):
    """Do what ``operation`` names; all arguments are integers or addresses.

    RESET: put the trajectory at the state at ``out``. ADVANCE: see `loop.advance`.
    TAKE: take up to ``budget`` steps, none beyond times[0], which are then in ``times``.
    PART: write the state parts[0] beyond the present one to ``out``, and count nothing; parts[1] is
    the length of the last one from there, or 0. ACT: take the solved step up to an event in it that changes
    the state, and change that. GO_ON: begin at the state that an event has made, with the parameters that are
    now in memory. ATTEMPT: go on with the attempts at the step ahead after NOISY.
    """
    t, n, p, y = doubles(times), integers(targets), doubles(parts), doubles(out)
    if operation == RESET:
        reset(context(ctx), y)
        return DONE
    if operation == ADVANCE:
        return advance(context(ctx), context(partial), between, count, t, n, p, first, y, budget)
    if operation == PART:
        outcome = part_step(context(ctx), context(partial), p[0], p[1])
        if outcome == DONE:
            write(context(partial), context(partial).next_state, y)
        return outcome
    if operation == ACT:
        return change(context(ctx))
    if operation == GO_ON:
        return go_on(context(ctx))
    if operation == ATTEMPT:
        return go_on_attempting(context(ctx))
    return take_steps(context(ctx), t, y, budget)
