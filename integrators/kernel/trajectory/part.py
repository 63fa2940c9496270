"""States between steps: the ends of partial ones."""

from integrators.kernel.context import DENSE, DONE, MISSED, PART_END, PARTIAL, STATE, STOP, STOPPED, UNSOLVED
from integrators.kernel.inside.discontinuities import keep_end_of_part
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import call_follow
from integrators.kernel.step.advance import solve
from integrators.kernel.step.begin import predict, prepare, rewind, set_step
from integrators.kernel.step.estimate import EQUAL_VALUES
from integrators.kernel.step.finish import arrive, finish
from integrators.kernel.step.sample import copy, interpolate, vectors_of_state, write
from integrators.kernel.step.size import take_sizes
from integrators.kernel.step.solver_switch import solve_part
from integrators.kernel.step.sums import time_of_step


@compiled
def part_step(ctx, partial, part, known):
    """Solve in ``partial`` a step of length ``part`` from the state of ``ctx``; leaves ``ctx`` as it is.

    First stages come from the partial step of length ``known`` that ``partial`` has made from there; if that
    is 0, from inside the step ahead if that is solved, else from the previous step.
    """
    set_step(partial, part)
    copy(ctx.state, partial.state, vectors_of_state(ctx))
    copy(ctx.error, partial.error, vectors_of_state(ctx))
    partial.n = 0
    partial.t0, partial.time_low = time_of_step(ctx.t0, ctx.time_low, float(ctx.n), ctx.h)
    rewind(partial)
    prepare(partial)
    if known != 0.0:
        predict(partial, partial, known, 0.0)
    elif ctx.solved:
        predict(partial, ctx, ctx.h, 0.0)
    else:
        predict(partial, ctx, ctx.length, 1.0)
    partial.estimate.rescaled = ctx.estimate.rescaled
    partial.energy.start, partial.energy.scale = ctx.energy.start, ctx.energy.scale
    if ctx.estimate.rescaled:
        for b in range(ctx.blocks.count):
            partial.estimate.expected[b] = ctx.estimate.expected[b]
    take_sizes(partial)
    # Not that of another partial step: states depend on nothing but where they are.
    partial.solver.rate = ctx.solver.rate
    outcome = solve_part(ctx, partial)
    return finish(partial) if outcome == DONE else outcome


@compiled
def changes(ctx):
    """Whether the field has not the same value at all nodes of the solved step."""
    for d in range(ctx.rows):
        first = ctx.values[ctx.lanes * d]
        for i in range(1, ctx.k):
            value = ctx.values[ctx.lanes * ((i // ctx.lanes) * ctx.padded + d) + i % ctx.lanes]
            if abs(value - first) > EQUAL_VALUES * abs(first):
                return True
    return False


@compiled
def add_counters(ctx, partial):
    """Count the work done in ``partial`` as that of ``ctx``, and what of it partial steps have taken."""
    counters, of_part = ctx.counters, partial.counters
    counters.iterations += of_part.iterations
    counters.evaluations += of_part.evaluations
    counters.restarts += of_part.restarts
    counters.partial_iterations += of_part.iterations
    counters.partial_evaluations += of_part.evaluations
    counters.partial_steps += 1
    of_part.iterations = of_part.evaluations = of_part.restarts = 0


@compiled
def set_time(ctx, t):
    """Let the present time be t, and count steps from here."""
    ctx.t0, ctx.time_low, ctx.n = t, 0.0, 0


@compiled
def stop_at(ctx, partial, t):
    """Make the end of the step in ``partial``, at time ``t``, the state of ``ctx``."""
    copy(partial.next_state, ctx.state, vectors_of_state(ctx))
    copy(partial.next_error, ctx.error, vectors_of_state(ctx))
    copy(partial.values, ctx.values, ctx.calls * ctx.padded * ctx.lanes // 8)
    ctx.length, ctx.older_length = partial.h, 0.0
    ctx.surfaces.on_surface = 0
    if ctx.varying:
        keep_end_of_part(ctx, partial)
        ctx.controller.previous_length = partial.h
    set_time(ctx, t)
    ctx.solved = UNSOLVED
    arrive(ctx)


@compiled
def followed(ctx, step, operation):
    """Tell vectors that follow ``ctx`` of an operation on a step, whole or partial; return the outcome."""
    if ctx.follow == 0:
        return DONE
    step.samples_written = ctx.samples_written
    return call_follow(ctx.follow, operation, step, ctx.follow_memory)


@compiled
def sample(ctx, partial, between, t, part, out):
    """Write the state ``part`` beyond the present one; return the outcome."""
    if part == 0.0:
        write(ctx, ctx.state, out)
        followed(ctx, ctx, STATE)
        if between == STOP:
            low = (ctx.t0 - t) + ctx.time_low if ctx.varying else 0.0
            set_time(ctx, t)
            ctx.time_low = low  # the state is where it was: what is between the two times is not lost
        return DONE
    if between in (DENSE, PARTIAL):
        # A part starts from the step ahead. Where that fails, nothing in it is reached: near a
        # singularity the equations of a part may have a solution, far from the trajectory.
        outcome = solve(ctx)
        if outcome != DONE:
            return outcome
    if between == DENSE:
        interpolate(ctx, part / ctx.h, out)
        return DONE
    outcome = part_step(ctx, partial, part, 0.0)
    add_counters(ctx, partial)
    if (
        outcome == DONE
        and ctx.varying
        and ctx.estimate.constant_field
        and ctx.events.act == 0
        and changes(partial)
    ):
        # The step ahead was judged by nodes that see nothing of this: it is solved again, and no longer.
        ctx.solved, ctx.length, ctx.controller.next_length = UNSOLVED, 0.0, part
        ctx.counters.rejections += 1
        return MISSED
    if outcome == DONE:
        outcome = followed(ctx, partial, PART_END)
    if outcome == DONE:
        write(partial, partial.next_state, out)
        if between == STOP:
            followed(ctx, partial, STOPPED)
            stop_at(ctx, partial, t)
    return outcome
