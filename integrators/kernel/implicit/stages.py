"""Between coefficients and stages, in the memory of a trajectory's context.

A solver's unknowns are the coefficients gamma of the field, not the field's values: where h J is
large, values carry rounding errors of size h |J| eps, which the corrections take out of gamma.

Coefficients lie as stages do: in groups of eight, a row for each component (`Workspace.groups`,
`Workspace.block`). The second-order form has two blocks, the coefficients of q' and then those of
p'; what is said of the field's coefficients is about the last block, what moves stages is the first.
"""

from integrators.kernel.implicit.memory import Corrections
from integrators.kernel.native.attributes import view
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.lanes import fma
from integrators.kernel.simd.memory import get, larger, largest, put, splat8, spread
from integrators.kernel.simd.views import doubles
from integrators.kernel.step.fixed_point import multiply
from integrators.kernel.step.size import change, enter_size, forget_sizes, invert_sizes, stage_size
from integrators.kernel.step.stages import offset

workspace = view(Corrections)
# Relative to a block, and relative to a block that is raised if it is small
WEIGHTS, FLOORED_WEIGHTS = range(2)


@compiled
def at(m, j, d):
    """Return where the coefficient of degree j of component d is in a block."""
    return 8 * (m.padded * (j // 8) + d) + j % 8


@compiled
def set_stages(ctx, m):
    """Stages = state + (error + h table gamma).

    The second-order form takes the coefficients of q' here, not those of p': sums
    such as q + c h q' + h^2 (...) cancel where a step spans many oscillations.
    """
    scratch = ctx.scratch
    rows, padded = ctx.rows, ctx.padded
    lanes, chunks = ctx.lanes, ctx.chunks
    for i in range(0, m.block, 8):
        put(m.moving, 8 * padded + i, get(m.gamma, i))
    for i in range(0, 8 * padded, 8):  # for the low parts of the table's first columns
        put(m.moving, i, get(m.gamma, i))
    moves = scratch.sums
    multiply(m.stage_table, chunks, m.groups + 1, m.moving, 8, moves, lanes, rows, padded)
    state, error = scratch.row_state, scratch.row_error
    h = splat8(ctx.h)
    for chunk in range(chunks):
        start = offset(ctx, chunk)
        stages = ctx.stages + start
        for d in range(rows):
            i = lanes * d
            put(stages, i, spread(state, d) + fma(h, get(moves + start, i), spread(error, d)))


@compiled
def project(ctx, m, target):
    """Set the field's coefficients from its values."""
    last = target + (m.parts - 1) * m.block
    multiply(m.projection, m.groups, ctx.chunks, ctx.values, ctx.lanes, last, 8, ctx.rows, ctx.padded)


@compiled
def set_velocities(ctx, m, source, target):
    """Set the coefficients of q' in ``target``, in the second-order form, from those of p' in ``source``."""
    rows, padded = ctx.rows, ctx.padded
    h = ctx.h
    drift, low, slope = ctx.scratch.row_drift, ctx.scratch.row_drift_low, ctx.factors.row
    multiply(m.derivatives, m.groups, m.groups, source + m.block, 8, target, 8, rows, padded)
    for d in range(rows):
        for group in range(m.groups):
            i = 8 * (padded * group + d)
            put(target, i, spread(slope, d) * get(target, i))
        target[8 * d] += (drift[d] + low[d]) / h
    if m.pulls != 0:
        pull_velocities(ctx, m, target)


@compiled
def pull_velocities(ctx, m, target):
    """Add to the coefficients of q' what follows from the derivative of the velocities."""
    trajectory, pulls = workspace(m.trajectory), doubles(m.pulls)
    for d in range(ctx.rows):
        for group in range(m.groups):
            i = 8 * (m.padded * group + d)
            velocity = get(trajectory.gamma, 8 * (trajectory.padded * group + d % trajectory.rows))
            put(target, i, get(target, i) + pulls[d] * velocity)


@compiled
def set_values(ctx, m):
    """Values = the polynomial with the coefficients gamma at the nodes; and the step's increments."""
    rows, padded = ctx.rows, ctx.padded
    for part in range(m.parts):
        for d in range(rows):
            m.increment[rows * part + d] = ctx.h * m.gamma[m.block * part + 8 * d]
    last = m.gamma + (m.parts - 1) * m.block
    multiply(m.basis, ctx.chunks, m.groups, last, 8, ctx.values, ctx.lanes, rows, padded)


@compiled
def set_factor(ctx, m):
    """Set what the Jacobian's columns are multiplied by."""
    h = ctx.h
    second = ctx.second
    row_factor = ctx.factors.row
    for d in range(ctx.rows):
        m.factor[d] = h * row_factor[d] if second else h


@compiled
def measure(ctx, m):
    """Measure the blocks on the stages and on the state, near which stiff components have no stage.

    In the second-order form the velocities too, which may be far from converged where
    the positions of a short step are not.
    """
    blocks = ctx.blocks
    forget_sizes(ctx)
    for d in range(ctx.rows):
        enter_size(ctx, d, stage_size(ctx, d, splat8(abs(ctx.scratch.row_state[d]))))
    invert_sizes(ctx, blocks.weights, blocks.floored_weights)
    blocks.age = 0  # the fixed point is to measure anew
    if ctx.second:
        forget_sizes(ctx)
        for d in range(ctx.rows):
            drift = abs(ctx.scratch.row_drift[d])
            enter_size(ctx, d, max(drift, abs(m.factor[d] * m.gamma[m.block + 8 * d])))
        invert_sizes(ctx, m.slope_weights, m.floored_slope_weights)


@compiled
def changes(ctx, m, kind):
    """Return the largest change by the last correction, relative to blocks, small ones raised or not."""
    result = change(ctx, ctx.blocks.weights if kind == WEIGHTS else ctx.blocks.floored_weights)
    if ctx.second:
        top = splat8(result)
        for d in range(ctx.rows):
            scale = abs(m.factor[d]) * (m.slope_weights[d] if kind == WEIGHTS else m.floored_slope_weights[d])
            for group in range(m.groups):
                i = m.block + 8 * (m.padded * group + d)
                top = larger(top, abs(get(m.correction, i)) * scale)
        result = largest(top)
    return result
