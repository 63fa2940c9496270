r"""The adjoint of a step: how the derivatives of a number with respect to its end become those to its start.

A step is ``y_1 = y + h sum_j b_j f(Y_j)``, ``Y_i = y + h sum_j a_ij f(Y_j)``. If ``l_1`` is the gradient of a
number with respect to ``y_1``, the one with respect to ``y`` is, by the chain rule,

    V_i = f_y(Y_i)' L_i,    L_i = l_1 + h sum_j (b_j a_ji / b_i) V_j,    l = l_1 + h sum_j b_j V_j,

and the derivatives with respect to parameters grow by ``h sum_i b_i f_par(Y_i)' L_i``. With the stages
numbered from the last to the first these are the equations of a Runge-Kutta method that takes a step of -h
on ``l' = -f_y' l`` from ``l_1``: for Gauss the same method, and for k > s another one
(`integrators.kernel.adjoint.tableau`). So the iteration, first stages and stopping rule are those of a step.
The adjoint is the state of a `Context`, whose field finds ``Y_i`` in the rows that follow those of the
adjoint, as with tangent vectors (`integrators.kernel.tangent`).
"""

from integrators.kernel.adjoint.memory import HEAD, Pullback, Tape
from integrators.kernel.context import DONE, PART_END, STEP, Context
from integrators.kernel.native.attributes import view
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import call_field, get, put
from integrators.kernel.simd.operations import two_sum
from integrators.kernel.step.begin import choose, prepare, rewind, set_step
from integrators.kernel.step.finish import commit, finish
from integrators.kernel.step.fixed_point import iterate_measured
from integrators.kernel.step.iterate import iterate_to_end, test
from integrators.kernel.step.sample import write
from integrators.kernel.step.sums import time_of_step

context, tape_at, pullback = view(Context), view(Tape), view(Pullback)


@compiled
def copy_stages(source, source_block, target, target_block, count, calls):
    """Copy the first ``count`` doubles of each block of stages; all are multiples of eight."""
    for call in range(calls):
        for i in range(0, count, 8):
            put(target + target_block * call, i, get(source + source_block * call, i))


@compiled
def record(event, address, memory_address):
    """Keep a solved step, or partial step; `integrators.kernel.context.Context.follow`."""
    if event not in (STEP, PART_END):
        return DONE
    ctx, tape = context(address), tape_at(memory_address)
    if tape.count == tape.capacity:
        tape.full = 1
        return DONE
    out, block = tape.records + tape.size * tape.count, ctx.rows * ctx.lanes
    out[0], out[1], out[2], out[3] = ctx.t0, ctx.time_low, float(ctx.n), ctx.h
    copy_stages(ctx.stages, ctx.padded * ctx.lanes, out + HEAD, block, block, ctx.calls)
    write(ctx, ctx.state, out + HEAD + block * ctx.calls)
    tape.count += 1
    return DONE


@compiled
def show_stages(ctx, stages, count):
    """Copy the stages of a recorded step to behind the rows of the adjoint."""
    block, rows_before = ctx.padded * ctx.lanes, ctx.rows * ctx.lanes
    copy_stages(stages, count, ctx.stages + rows_before, block, count, ctx.calls)
    copy_stages(stages, count, ctx.scratch.old_stages + rows_before, block, count, ctx.calls)


@compiled
def add_slopes(ctx, memory, h):
    """Add what a step of length h contributes to the derivatives by parameters."""
    block, lanes, values = ctx.padded * ctx.lanes, ctx.lanes, memory.values
    for call in range(ctx.calls):
        call_field(memory.slopes, ctx.times + lanes * call, ctx.stages + block * call, ctx.par, values)
        used = min(lanes, 8 * ctx.chunks - lanes * call)
        for p in range(memory.parameters):
            total = 0.0
            for i in range(used):
                total += ctx.tables.weights[lanes * call + i] * values[lanes * p + i]
            memory.sums[p], low = two_sum(memory.sums[p], h * total)
            memory.sums_low[p] += low


@compiled
def pull(address, memory_address):
    """Follow recorded steps backwards; return DONE, or how the equations of step `Pullback.next` ended."""
    ctx, memory = context(address), pullback(memory_address)
    size = memory.states * ctx.lanes
    while memory.next < memory.count:
        head = memory.heads + HEAD * memory.next
        h = head[3]
        ctx.t0, ctx.time_low = time_of_step(head[0], head[1], head[2] + 1.0, h)
        ctx.n = 0
        set_step(ctx, -h)
        show_stages(ctx, memory.stages + size * ctx.calls * memory.next, size)
        rewind(ctx)
        prepare(ctx)
        choose(ctx)
        test(ctx, iterate_measured(ctx, ctx.solver.free if ctx.solver.predicted else 0))
        outcome = iterate_to_end(ctx)
        if outcome == DONE:
            outcome = finish(ctx)
        if outcome != DONE:
            return outcome
        if memory.slopes:
            add_slopes(ctx, memory, h)
        commit(ctx)
        memory.next += 1
    return DONE
