"""The end of a step: the new state.

The weights' low parts enter the products with the field before anything is rounded. Of the last sums over
the stages, and of all that is done with them until the state is added, what is rounded away is kept: errors
at the size of an increment would be the largest of a step, and cause a random walk of the energy error. (To
keep the errors of all sums and products makes it a fifth smaller, and steps of eight stages 6 % longer.)
"""

from integrators.kernel.context import ARRIVE, BY_INCREMENT, DONE, END, NOT_FINITE, UNSOLVED
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.team import FINISH
from integrators.kernel.simd.memory import call_line, get, largest, put, splat8, sums_and_errors, swap
from integrators.kernel.simd.operations import fma, two_sum
from integrators.kernel.step.projection import project_onto_energy
from integrators.kernel.step.share import largest_result, share, shared
from integrators.kernel.step.stages import momentum_place, offset
from integrators.kernel.step.sums import multiplied


@compiled
def weighted(ctx, row, high, low):
    """Return the values of a row times weights high + low, added to eight."""
    values, i = ctx.values, ctx.lanes * row
    if ctx.route == 8:
        return fma(get(high, 0), get(values, i), get(low, 0) * get(values, i))
    if ctx.route == 16:
        value, more = get(values, i), get(values, i + 8)
        small = fma(get(low, 8), more, get(low, 0) * value)
        return fma(get(high, 8), more, fma(get(high, 0), value, small))
    result = splat8(0.0)
    for chunk in range(ctx.chunks):
        result = fma(get(low, 8 * chunk), get(values, i + offset(ctx, chunk)), result)
    for chunk in range(ctx.chunks):
        result = fma(get(high, 8 * chunk), get(values, i + offset(ctx, chunk)), result)
    return result


@compiled
def impulses(ctx, d):
    """For the rows d .. d+3, means of the force with the weights b, then the position's, and low parts."""
    tables = ctx.tables
    b, b_low, w, w_low = (
        tables.weights,
        tables.weights_low,
        tables.position_weights,
        tables.position_weights_low,
    )
    return sums_and_errors(
        weighted(ctx, d, b, b_low), weighted(ctx, d + 1, b, b_low),
        weighted(ctx, d + 2, b, b_low), weighted(ctx, d + 3, b, b_low),
        weighted(ctx, d, w, w_low), weighted(ctx, d + 1, w, w_low),
        weighted(ctx, d + 2, w, w_low), weighted(ctx, d + 3, w, w_low),
    )  # fmt: skip


@compiled
def means(ctx, d):
    """For the rows d .. d+7, the means of the field with the weights b, and their low parts."""
    b, low = ctx.tables.weights, ctx.tables.weights_low
    return sums_and_errors(
        weighted(ctx, d, b, low), weighted(ctx, d + 1, b, low),
        weighted(ctx, d + 2, b, low), weighted(ctx, d + 3, b, low),
        weighted(ctx, d + 4, b, low), weighted(ctx, d + 5, b, low),
        weighted(ctx, d + 6, b, low), weighted(ctx, d + 7, b, low),
    )  # fmt: skip


@compiled
def added(state, error, h, mean, low):
    """Return the state after an increment of h times a mean + low, and what it lacks.

    Parameters
    ----------
    state, error : float
        A component before the step, and what it lacks.
    """
    increment, low = multiplied(h, mean, low)
    moved, rounding = two_sum(state, increment)
    return two_sum(moved, error + (low + rounding))


@compiled
def moved_by(state, error, moved, moved_low, h, factor, mean, low):
    """As `added`, of what also drifts, by moved + moved_low, and whose increment has another factor.

    Positions are moved like that in the second-order form, with the factor h q' / p.
    """
    drifted, drift_rounding = two_sum(state, moved)
    increment, low = multiplied(h, mean, low)
    increment, low = multiplied(factor, increment, low)
    whole, rounding = two_sum(drifted, increment)
    return two_sum(whole, ((moved_low + error) + drift_rounding) + (low + rounding))


@compiled
def add(ctx, i, increment):
    """Add an increment to component i of the state; return 0 if it is finite then."""
    new, rounding = two_sum(ctx.state[i], increment + ctx.error[i])
    ctx.next_state[i] = new
    ctx.next_error[i] = rounding
    return new * 0.0


@compiled
def finish_by_increment(ctx):
    """As `finish`, from increments: those of q are not found from the forces without cancellation."""
    rows, increment = ctx.rows, ctx.implicit.increment
    damage = 0.0
    for d in range(rows):
        if ctx.second:
            i = momentum_place(d)
            damage += add(ctx, i + 4, increment[d])
            damage += add(ctx, i, increment[rows + d])
        else:
            damage += add(ctx, d, increment[d])
    return DONE if damage == 0.0 else NOT_FINITE


@compiled
def finish_unprojected(ctx):
    """Set the next state from the state and the solved step's values; return the outcome."""
    if ctx.line:
        return call_line(ctx.line, END, ctx)
    if ctx.solved == BY_INCREMENT:
        return finish_by_increment(ctx)
    if shared(ctx):
        share(ctx, FINISH, ctx.tables.matrix)
        damage = largest_result(ctx)
    else:
        damage = largest(finish_rows(ctx, 0, ctx.rows))
    return DONE if damage == 0.0 else NOT_FINITE


@compiled
def finish_rows(ctx, first, last):
    """Set the next state of the rows from first, a multiple of 8, to last; return eight zeros, or a NaN."""
    h = ctx.h
    state, error, next_state, next_error = ctx.state, ctx.error, ctx.next_state, ctx.next_error
    damage = splat8(0.0)
    if ctx.second:
        factor, kick = ctx.factors.drift, ctx.factors.kick
        for i in range(first // 4, (last + 3) // 4):
            z, z_low, kh = get(state, 8 * i), get(error, 8 * i), get(factor, 8 * i)
            moved, moved_low = multiplied(kh, z, z_low)
            force, low = impulses(ctx, 4 * i)
            new, rounding = moved_by(
                z, z_low, swap(moved), swap(moved_low), splat8(h), get(kick, 8 * i), force, low
            )
            put(next_state, 8 * i, new)
            put(next_error, 8 * i, rounding)
            damage += new * 0.0
    else:
        for i in range(first // 8, (last + 7) // 8):
            mean, low = means(ctx, 8 * i)
            new, rounding = added(get(state, 8 * i), get(error, 8 * i), splat8(h), mean, low)
            put(next_state, 8 * i, new)
            put(next_error, 8 * i, rounding)
            damage += new * 0.0
    return abs(damage)


@compiled
def finish(ctx):
    """Set the next state of the solved step, projected where that is asked for; return the outcome."""
    outcome = finish_unprojected(ctx)
    if outcome == DONE and ctx.energy.code:
        project_onto_energy(ctx)
    return outcome


@compiled
def commit(ctx):
    """Make the next state the state: the step is taken."""
    ctx.state, ctx.next_state = ctx.next_state, ctx.state
    ctx.error, ctx.next_error = ctx.next_error, ctx.error
    ctx.n += 1
    count_step(ctx)


@compiled
def count_step(ctx):
    """Keep the books of a step whose end is the state now."""
    ctx.counters.steps += 1
    ctx.length = ctx.h
    ctx.solved = UNSOLVED
    arrive(ctx)


@compiled
def arrive(ctx):
    """Let a line integral know of a new state, in which the step of ``Context.length`` has ended; 0: none."""
    if ctx.line:
        call_line(ctx.line, ARRIVE, ctx)
