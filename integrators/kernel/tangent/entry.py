r"""Tangent vectors in a step: the derivative of the step, its length held fixed.

A Runge-Kutta method on ``y' = f(y)`` together with ``d' = f'(y) d`` makes of a vector ``d`` the derivative
of what it makes of ``y``:

    D_i = d + h sum_j a_ij f'(Y_j) D_j,    d_1 = d + h sum_j b_j f'(Y_j) D_j,

and where the vector has a part in the parameters, ``f'(Y_j) D_j`` has that of ``f`` too. The stages
``Y_j`` are known, so these equations are linear. They are solved by the same iteration, with the same
matrices, first stages and stopping rule as those of the step, or by the implicit solver, where that solved
the step or the iteration does not converge: the vectors of a group are the rows of a
`Context`, whose field is the derivative of the trajectory's along them. It finds ``Y_j`` in the rows that
follow those of the vectors. In second-order form, ``q' = v(par) p`` with a derivative ``v' dpar`` adds
``(v' dpar / v) (Q_i - q)`` to the stages of positions, and the same with ``q_1`` to the end.
"""

from integrators.kernel.context import (
    BUDGET,
    BY_INCREMENT,
    DONE,
    PART_END,
    STATE,
    STEP,
    STOPPED,
    UNSOLVED,
    Context,
)
from integrators.kernel.native.attributes import view
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.implicit import FIXED_POINT, FOR_VECTORS
from integrators.kernel.simd.memory import get, put, spread
from integrators.kernel.simd.views import doubles
from integrators.kernel.step.begin import choose, predict, prepare, rewind, set_factors, set_step
from integrators.kernel.step.finish import commit, finish
from integrators.kernel.step.fixed_point import iterate_measured
from integrators.kernel.step.iterate import iterate_to_end, test
from integrators.kernel.step.sample import copy, vectors_of_state, write
from integrators.kernel.step.size import take_sizes
from integrators.kernel.step.solver_switch import solve_implicitly
from integrators.kernel.step.stages import offset, place
from integrators.kernel.tangent.memory import Tangents

context, tangents = view(Context), view(Tangents)


@compiled
def show_stages(ctx, vectors):
    """Copy the stages of a solved step to behind the rows of the vectors."""
    lanes = ctx.lanes
    for chunk in range(ctx.chunks):
        source, target = offset(ctx, chunk), offset(vectors, chunk) + lanes * vectors.rows
        for d in range(ctx.rows):
            stage = get(ctx.stages, source + lanes * d)
            put(vectors.stages, target + lanes * d, stage)
            put(vectors.scratch.old_stages, target + lanes * d, stage)


@compiled
def pull_stages(ctx, vectors, pulls):
    """Add to the positions' stages what follows from the derivative of the velocities."""
    lanes, rows = ctx.lanes, ctx.rows
    for chunk in range(ctx.chunks):
        source, target = offset(ctx, chunk), offset(vectors, chunk)
        for d in range(vectors.rows):
            moved = get(ctx.stages, source + lanes * (d % rows)) - spread(ctx.state, place(ctx, d % rows))
            i = target + lanes * d
            put(vectors.scratch.base, i, get(vectors.scratch.base, i) + pulls[d] * moved)


@compiled
def pull_end(ctx, vectors, pulls):
    """Add the same to the end of the step."""
    for d in range(vectors.rows):
        i = place(ctx, d % ctx.rows)
        vectors.next_state[place(vectors, d)] += pulls[d] * (ctx.next_state[i] - ctx.state[i])


@compiled
def finish_implicitly(vectors, part):
    """Solve the equations by the implicit solver and set the end of the step; return the outcome."""
    outcome = solve_implicitly(vectors, vectors, int(part))
    return finish(vectors) if outcome == DONE else outcome


@compiled
def differentiate(ctx, trajectory, vectors, earlier, part, pulls):
    """Find the derivative of a step that is solved in ``ctx``; return the outcome.

    Parameters
    ----------
    ctx : Context
        Of the trajectory, or of a partial step.
    trajectory : Context
        Of the trajectory.
    vectors : Context
        Of the vectors at the start of the step; `Context.next_state` becomes those at its end.
    earlier : Context
        Of the vectors in the step before: the same, but for a ``part`` of a step.
    part : bool
        Whether it is one.
    pulls : int
        Address of relative derivatives of velocities, or 0.
    """
    solver = vectors.solver
    vectors.t0, vectors.time_low, vectors.n = ctx.t0, ctx.time_low, ctx.n
    if vectors.h != ctx.h:
        set_factors(vectors, ctx.h)
    if ctx.varying:
        set_step(ctx, ctx.h)
    vectors.tables.matrix = ctx.tables.matrix
    if not part:  # of the same direction
        vectors.tables.extrapolation = ctx.tables.extrapolation
        vectors.tables.extrapolation_two = ctx.tables.extrapolation_two
    show_stages(ctx, vectors)
    if ctx.solved == BY_INCREMENT:
        if part:
            rewind(vectors)
            prepare(vectors)
            predict(vectors, earlier, earlier.length, 1.0)
        return finish_implicitly(vectors, part)
    rewind(vectors)
    prepare(vectors)
    if pulls != 0:
        pull_stages(ctx, vectors, doubles(pulls))
    if part:
        predict(vectors, earlier, earlier.length, 1.0)
        take_sizes(vectors)
    else:
        choose(vectors)
    test(vectors, iterate_measured(vectors, solver.free if solver.predicted else 0))
    outcome = iterate_to_end(vectors)
    if outcome == DONE:
        outcome = finish(vectors)
        if outcome == DONE and pulls != 0:
            pull_end(ctx, vectors, doubles(pulls))
        return outcome
    if trajectory.implicit.strategy == FIXED_POINT or pulls != 0:
        return outcome
    if vectors.implicit.code == 0:
        trajectory.implicit.wanted = FOR_VECTORS
        return BUDGET
    solver.predicted = 0
    return finish_implicitly(vectors, part)


@compiled
def write_vectors(memory, g, first, vectors, state, written):
    """Write the vectors of a group to sample number ``written``."""
    count, dim, rows, room = memory.count, memory.dim, memory.rows, memory.room
    write(vectors, state, room)
    for v in range(memory.vectors[g]):
        for i in range(dim):
            half, d = i // rows, i % rows
            memory.out[(written * dim + i) * count + first + v] = room[half * vectors.rows + v * rows + d]


@compiled
def entry(operation, address, memory_address):
    """Do what `Context.follow` promises; return the outcome.

    BUDGET: come again with the implicit solver.
    """
    ctx, memory = context(address), tangents(memory_address)
    trajectory = context(memory.trajectory)
    first = 0
    for g in range(memory.groups):
        own, partial = context(memory.own[g]), context(memory.partial[g])
        outcome = DONE
        if operation == STATE:
            write_vectors(memory, g, first, own, own.state, ctx.samples_written)
        elif operation == STOPPED:
            copy(partial.next_state, own.state, vectors_of_state(own))
            copy(partial.next_error, own.error, vectors_of_state(own))
            copy(partial.values, own.values, own.calls * own.padded * own.lanes // 8)
            own.length, own.older_length = partial.h, 0.0
        elif operation == PART_END:
            copy(own.state, partial.state, vectors_of_state(own))
            copy(own.error, partial.error, vectors_of_state(own))
            outcome = differentiate(ctx, trajectory, partial, own, True, memory.pulls[g])
            if outcome == DONE:
                write_vectors(memory, g, first, partial, partial.next_state, ctx.samples_written)
        else:
            outcome = differentiate(ctx, trajectory, own, own, False, memory.pulls[g])
        if outcome == BUDGET:
            return outcome
        if outcome != DONE:
            own.solved = partial.solved = UNSOLVED
            memory.failed = 1
            return outcome
        first += memory.vectors[g]
    if operation == STEP:
        for g in range(memory.groups):
            commit(context(memory.own[g]))
    return DONE
