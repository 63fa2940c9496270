"""States between steps, and where a state is in memory."""

from integrators.kernel.context import DENSE, DONE, MISSED, PART_END, PARTIAL, STATE, STOP, STOPPED, UNSOLVED
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import call_follow, get, put
from integrators.kernel.step.advance import solve
from integrators.kernel.step.begin import predict, prepare, rewind, set_step
from integrators.kernel.step.discontinuities import keep_end_of_part
from integrators.kernel.step.estimate import EQUAL_VALUES
from integrators.kernel.step.finish import arrive, finish
from integrators.kernel.step.fixed_point import project
from integrators.kernel.step.size import take_sizes
from integrators.kernel.step.solver_switch import solve_part
from integrators.kernel.step.sums import time_of_step


@compiled
def dimension(ctx):
    """Return the length of the state."""
    return ctx.rows * (2 if ctx.second else 1)


@compiled
def write(ctx, state, out):
    """Write a state in the layout of `Context.state` to memory as (q, p) or y."""
    rows = ctx.rows
    for d in range(rows):
        if ctx.second:
            i = 8 * (d // 4) + d % 4
            out[d] = state[i + 4]
            out[rows + d] = state[i]
        else:
            out[d] = state[d]


@compiled
def read(ctx, state, given):
    """Read a state that is laid out as `write` does."""
    rows = ctx.rows
    for d in range(rows):
        if ctx.second:
            i = 8 * (d // 4) + d % 4
            state[i + 4] = given[d]
            state[i] = given[rows + d]
        else:
            state[d] = given[d]


@compiled
def copy(outof, into, vectors):
    """Copy so many vectors of eight doubles."""
    for i in range(vectors):
        put(into, 8 * i, get(outof, 8 * i))


@compiled
def vectors_of_state(ctx):
    """Return how many vectors the state takes."""
    return (ctx.rows + 3) // 4 if ctx.second else (ctx.rows + 7) // 8


@compiled
def interpolate(ctx, c, out):
    """Write the collocation polynomial of the solved step at t + c h.

    With the coefficients gamma of the field, y + h sum_j gamma_j int_0^c P_j; in
    second-order form the positions take the integrals of that polynomial's slope,
    projected like it: q + c h q' + h kh sum_j gamma_j (int_0^c P) X_s, column j.
    """
    tables = ctx.tables
    rows, second, h = ctx.rows, ctx.second, ctx.h
    state, gamma = ctx.state, ctx.scratch.coefficients
    project(ctx, tables.projection, tables.groups)
    write(ctx, ctx.error, out)
    x = 2.0 * c - 1.0
    # Integrals of P_{j-1}, P_j, P_{j+1}, by int_0^c L_j = (L_{j+1} - L_{j-1}) / (2 (2j+1)) for j > 0.
    lower, here = 0.0, c
    before, legendre = 1.0, x
    for j in range(ctx.s):
        after = ((2.0 * j + 3.0) * x * legendre - (j + 1.0) * before) / (j + 2.0)
        upper = (after - before) / (2.0 * (2.0 * j + 3.0) ** 0.5) if j + 1 < ctx.s else 0.0
        slope_weight = h * here
        weight = 0.5 * here if j == 0 else -lower / (2.0 * (4.0 * j * j - 1.0) ** 0.5)
        weight = h * (weight + upper / (2.0 * (4.0 * (j + 1.0) * (j + 1.0) - 1.0) ** 0.5))
        i = tables.first + j
        for d in range(rows):
            value = gamma[((i // 8) * ctx.padded + d) * 8 + i % 8]
            if second:
                out[d] = out[d] + ctx.factors.row[d] * (weight * value)
                out[rows + d] = out[rows + d] + slope_weight * value
            else:
                out[d] = out[d] + slope_weight * value
        lower, here = here, upper
        before, legendre = legendre, after
    for d in range(rows):
        if second:
            i = 8 * (d // 4) + d % 4
            drift = c * (ctx.factors.drift[i] * state[i])
            out[d] = state[i + 4] + (drift + out[d])
            out[rows + d] = state[i] + out[rows + d]
        else:
            out[d] = state[d] + out[d]


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
