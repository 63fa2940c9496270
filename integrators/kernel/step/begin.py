"""The start of a step: what its stages have in common, and their first values.

Round-off is handled where it arises. Nodes come as hi + lo pairs whose low
part enters before anything is rounded at the size of the state; h^2 is never
formed; the state is a compensated pair whose error enters the stages.
"""

from integrators.kernel.context import RUNNING
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.team import PREPARE
from integrators.kernel.routes import PER_OCTAVE, THROUGH
from integrators.kernel.simd.lanes import fma
from integrators.kernel.simd.memory import get, put, put_lower, put_upper, splat8, spread
from integrators.kernel.simd.operations import binary_log
from integrators.kernel.step.fixed_point import (
    multiply,
    product,
    product_for_one,
    product_of_two,
    project,
    through,
)
from integrators.kernel.step.rule import FARTHEST
from integrators.kernel.step.share import share, shared
from integrators.kernel.step.size import take_sizes
from integrators.kernel.step.stages import momentum_place, offset
from integrators.kernel.step.sums import multiplied, part_of_drift, time_of_step

INFINITY = float("inf")


@compiled
def set_factors(ctx, h):
    """Set h and what is h times the velocities."""
    factors = ctx.factors
    ctx.h = h
    if ctx.second:
        velocity, factor, drift, kick = factors.velocity, factors.row, factors.drift, factors.kick
        for d in range(ctx.rows):
            kh = h * velocity[d]
            factor[d] = kh
            drift[momentum_place(d)] = kh
            kick[momentum_place(d) + 4] = kh


@compiled
def set_step(ctx, h):
    """Scale the matrix and the velocities by a step h that is taken once (`tables.scaled` is for many)."""
    tables = ctx.tables
    set_factors(ctx, h)
    if tables.scaled_by == h:
        return
    tables.scaled_by = h
    twice = ctx.second and ctx.unit
    raw, matrix = tables.raw_matrix, tables.matrix
    for i in range(tables.matrix_size):
        value = h * get(raw, 8 * i)
        put(matrix, 8 * i, h * value if twice else value)


@compiled
def set_times(ctx):
    """Set the stages' times to t0 + n h + c h, with t0 and n h as sums of two doubles."""
    t, low = time_of_step(ctx.t0, ctx.time_low, float(ctx.n), ctx.h)
    times, nodes = ctx.times, ctx.tables.nodes
    for chunk in range(ctx.chunks):
        put(times, 8 * chunk, t + fma(get(nodes, 8 * chunk), splat8(ctx.h), splat8(low)))


@compiled
def prepare(ctx):
    """Set the stages' times, and what they have without the field's values, from the state."""
    set_times(ctx)
    if shared(ctx):
        share(ctx, PREPARE, ctx.tables.matrix)
    else:
        prepare_rows(ctx, 0, ctx.rows)


@compiled
def prepare_rows(ctx, first, last):
    """Set what the stages have without the field's values, from row first, a multiple of 8, to last."""
    scratch = ctx.scratch
    state, error, row_state, row_error = ctx.state, ctx.error, scratch.row_state, scratch.row_error
    lanes = ctx.lanes
    if ctx.second == 0:
        for i in range(first // 8, (last + 7) // 8):
            put(row_state, 8 * i, get(state, 8 * i))
            put(row_error, 8 * i, get(error, 8 * i))
        for chunk in range(ctx.chunks):
            base = scratch.base + offset(ctx, chunk)
            for d in range(first, last):
                put(base, lanes * d, spread(row_error, d))
        return
    row_drift, row_drift_low, factor = scratch.row_drift, scratch.row_drift_low, ctx.factors.drift
    for i in range(first // 4, (last + 3) // 4):
        z, z_low, kh = get(state, 8 * i), get(error, 8 * i), get(factor, 8 * i)
        moved, moved_low = multiplied(kh, z, z_low)
        put_upper(row_state, 4 * i, z)
        put_upper(row_error, 4 * i, z_low)
        put_lower(row_drift, 4 * i, moved)
        put_lower(row_drift_low, 4 * i, moved_low)
    nodes, nodes_low = ctx.tables.nodes, ctx.tables.nodes_low
    for chunk in range(ctx.chunks):
        c, c_low = get(nodes, 8 * chunk), get(nodes_low, 8 * chunk)
        base = scratch.base + offset(ctx, chunk)
        for d in range(first, last):
            moved, moved_low = spread(row_drift, d), spread(row_drift_low, d)
            put(base, lanes * d, part_of_drift(c, c_low, moved, moved_low, spread(row_error, d)))


# --- first stages ---------------------------------------------------------------------------------


@compiled
def start_plain(ctx):
    """First stages without a force (second-order form), or constant."""
    rows, lanes, state = ctx.rows, ctx.lanes, ctx.scratch.row_state
    for chunk in range(ctx.chunks):
        start = offset(ctx, chunk)
        stages, base = ctx.stages + start, ctx.scratch.base + start
        for d in range(rows):
            put(stages, lanes * d, spread(state, d) + get(base, lanes * d))
    ctx.solver.predicted = 0


@compiled
def start_extrapolated(ctx):
    """First stages from the values of the previous step, or of two, of the same length."""
    tables = ctx.tables
    if tables.two_steps != 0 and ctx.older_length == ctx.h:
        product_of_two(ctx, tables.extrapolation_two)
    elif ctx.route == THROUGH:
        through(ctx, tables.mode_projection, tables.mode_groups, tables.extrapolation, 0, ctx.rows)
    else:
        product(ctx, tables.extrapolation)
    ctx.solver.predicted = 1


@compiled
def on_previous_step(c, first, ratio):
    """Return where ``first + ratio * c`` of another step is in [-1, 1], on which Legendre polynomials are."""
    return 2.0 * (first + ratio * c) - 1.0


@compiled
def next_polynomial(a, b, x, here, before):
    """Return P_{j+1} of P_j and P_{j-1} at x; see `Tables.recurrence`."""
    return fma(a * x, here, -b * before)


@compiled
def start_from_polynomial(ctx, source, first, ratio):
    """First stages from the values of the context ``source``; there the nodes are ``first + ratio * c``."""
    tables = ctx.tables
    rows, chunks, groups = ctx.rows, ctx.chunks, tables.mode_groups
    nodes, basis, recurrence = tables.nodes, ctx.scratch.basis, tables.recurrence
    for chunk in range(chunks):
        x = on_previous_step(get(nodes, 8 * chunk), first, ratio)
        before = splat8(0.0)
        here = splat8(1.0)
        for j in range(tables.modes):
            put(basis, 8 * (chunk * 8 * groups + j), here)
            after = next_polynomial(recurrence[2 * j], recurrence[2 * j + 1], x, here, before)
            before = here
            here = after
    project(source, tables.mode_projection, groups)
    multiply(basis, chunks, groups, source.scratch.coefficients, 8, ctx.values, ctx.lanes, rows, ctx.padded)
    product(ctx, tables.matrix)
    ctx.solver.predicted = 1


@compiled
def octaves(ratio):
    """Return how far above 1/2 a ratio is; the `tables.RATIOS` are those that this makes equidistant."""
    return PER_OCTAVE * (binary_log(ratio) + 1.0)


@compiled
def ratio_at(index):
    """Return one of the `tables.RATIOS`."""
    part = index / PER_OCTAVE
    return part if part > 1.0 else 0.5 + 0.5 * part


@compiled
def tabulated_ratio(ctx, ratio):
    """Return the next smaller ratio of lengths that there is a table for; the ratio itself without tables.

    A larger one would make a third more of an error of order 29, and steps be rejected.
    """
    return ratio_at(int(octaves(ratio))) if ctx.route > THROUGH and 0.5 <= ratio <= 2.0 else ratio


@compiled
def start_from_table(ctx):
    """First stages from the values of the step before by a table, if there is one; return whether."""
    if ctx.length == 0.0 or ctx.controller.rejected or ctx.route <= THROUGH:
        return False
    ratio = ctx.h / ctx.length
    if not 0.5 <= ratio <= 2.0:
        return False
    index = int(octaves(ratio) + 0.5)
    if ctx.length * ratio_at(index) != ctx.h:
        return False
    product_for_one(ctx, ctx.tables.extrapolation + 8 * ctx.tables.matrix_size * index)
    ctx.solver.predicted = 1
    return True


@compiled
def can_extrapolate(h, length):
    """Whether first stages of a step of length h may come from a step of ``length``; 0: there is none."""
    return length != 0.0 and abs(h / length) <= FARTHEST


@compiled
def predict(ctx, source, length, first):
    """First stages from the values of ``source``, of a step of ``length``, if that is not too far away.

    Parameters
    ----------
    ctx, source : Context
        Of the step ahead, and of the step that its polynomial is taken from; may be the same.
    length : float
        Of that step; 0: nothing is known of any.
    first : float
        Where this step begins on it: at its end, 1, or at its start, 0.
    """
    if can_extrapolate(ctx.h, length):
        start_from_polynomial(ctx, source, first, ctx.h / length)
    else:
        start_plain(ctx)


@compiled
def rewind(ctx):
    """Begin to count the iterations of a start."""
    solver = ctx.solver
    solver.outcome = RUNNING
    solver.tests = solver.tried = solver.stalled = 0
    solver.best = solver.last = INFINITY


@compiled
def begin(ctx):
    """Prepare the step from the state and choose its first stages."""
    rewind(ctx)
    prepare(ctx)
    choose(ctx)


@compiled
def choose(ctx):
    """Choose the first stages of a step that is prepared."""
    if ctx.length == ctx.h and not ctx.varying:
        start_extrapolated(ctx)
        ctx.older_length = ctx.h
        ctx.values, ctx.older_values = ctx.older_values, ctx.values
    elif not (ctx.varying and start_from_table(ctx)):
        ctx.older_length = 0.0
        predict(ctx, ctx, ctx.length, 0.0 if ctx.controller.rejected else 1.0)
    ctx.blocks.age -= 1
    if ctx.blocks.age < 0 or ctx.solver.predicted == 0:
        take_sizes(ctx)
