"""Between coefficients and stages, in the memory of a trajectory's context.

A solver's unknowns are the coefficients gamma (s x R) of the field, not the
field's values: where h J is large, values carry rounding errors of size
h |J| eps, which the corrections take out of gamma.
"""

from integrators.kernel.native.attributes import address
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.lanes import fma
from integrators.kernel.simd.memory import get, put, splat8, spread
from integrators.kernel.step.size import change, enter_size, forget_sizes, invert_sizes, stage_size
from integrators.kernel.step.stages import offset
from integrators.kernel.step.sweep import multiply

LOW = 3  # columns of a stage table that hold the low parts of the first ones
STRICT, FLOORED = range(2)  # relative to a block, and relative to a block that is raised if it is small


@compiled
def groups(count):
    """Vectors of 8 that hold ``count`` numbers."""
    return (count + 7) // 8


@compiled
def pack(ctx, m, low, first):
    """Write gamma's components from ``first`` on as stage memory has them, the first ``low`` rows twice."""
    padded = ctx.padded
    s, rows = m.gamma.shape[0], m.factor.size
    for j in range(8 * groups(low + s)):
        i = j if j < low else j - low
        start = padded * 8 * (j // 8) + j % 8
        for d in range(rows):
            # What stands in unused places is multiplied by zero, which a NaN survives.
            m.packed[start + 8 * d] = m.gamma[i, first + d] if i < s else 0.0


@compiled
def set_stages(ctx, m):
    """Stages = state + (error + h table gamma).

    The second-order form takes the coefficients of q' here, not those of p': sums
    such as q + c h q' + h^2 (...) cancel where a step spans many oscillations.
    """
    rows, padded = ctx.rows, ctx.padded
    lanes, chunks = ctx.lanes, ctx.chunks
    s = m.gamma.shape[0]
    low = min(LOW, s)
    pack(ctx, m, low, 0)
    moves = ctx.sums
    multiply(m.stage_table, chunks, groups(low + s), m.packed, 8, moves, lanes, rows, padded)
    state, error = ctx.row_state, ctx.row_error
    h = splat8(ctx.h)
    for chunk in range(chunks):
        start = offset(ctx, chunk)
        stages = ctx.stages + start
        for d in range(rows):
            i = lanes * d
            put(stages, i, spread(state, d) + fma(h, get(moves + start, i), spread(error, d)))


@compiled
def project(ctx, m, target, first):
    """Set the components of ``target`` from ``first`` on to the coefficients of the field's values."""
    rows, padded = ctx.rows, ctx.padded
    s = target.shape[0]
    multiply(m.projection, groups(s), ctx.chunks, ctx.values, ctx.lanes, m.packed, 8, rows, padded)
    for j in range(s):
        start = padded * 8 * (j // 8) + j % 8
        for d in range(rows):
            target[j, first + d] = m.packed[start + 8 * d]


@compiled
def set_velocities(ctx, m, target):
    """Set the first half of ``target``, in the second-order form, to what its second half makes of q'."""
    rows, s = m.factor.size, m.gamma.shape[0]
    h = ctx.h
    drift, low, slope = ctx.row_drift, ctx.row_drift_low, ctx.row_factor
    for d in range(rows):
        kh = slope[d]
        for i in range(s):
            total = 0.0
            for j in range(s):
                total += m.x[i, j] * target[j, rows + d]
            target[i, d] = kh * total
        target[0, d] += (drift[d] + low[d]) / h


@compiled
def set_values(ctx, m):
    """Values = the polynomial with the coefficients gamma at the nodes; and the step's increments."""
    s, components = m.gamma.shape
    h = ctx.h
    for d in range(components):
        m.increment[d] = h * m.gamma[0, d]
    pack(ctx, m, 0, components - m.factor.size)
    multiply(
        m.basis, ctx.chunks, groups(s), m.packed, 8,
        ctx.values, ctx.lanes, ctx.rows, ctx.padded,
    )  # fmt: skip


@compiled
def set_factor(ctx, m):
    """Set what the Jacobian's columns are multiplied by."""
    h = ctx.h
    second = ctx.second
    row_factor = ctx.row_factor
    for d in range(m.factor.size):
        m.factor[d] = h * row_factor[d] if second else h


@compiled
def measure(ctx, m):
    """Measure the blocks on the stages and on the state, near which stiff components have no stage.

    In the second-order form the velocities too, which may be far from converged where
    the positions of a short step are not.
    """
    forget_sizes(ctx)
    for d in range(ctx.rows):
        enter_size(ctx, d, stage_size(ctx, d, splat8(abs(ctx.row_state[d]))))
    invert_sizes(ctx, ctx.strict, ctx.floored)
    ctx.age = 0  # the fixed point is to measure anew
    if ctx.second:
        forget_sizes(ctx)
        for d in range(ctx.rows):
            drift = abs(ctx.row_drift[d])
            enter_size(ctx, d, max(drift, abs(m.factor[d] * m.gamma[0, ctx.rows + d])))
        invert_sizes(ctx, address(m.slope_strict), address(m.slope_floored))


@compiled
def changes(ctx, m, kind):
    """Return the largest change by the last correction, relative to blocks, small ones raised or not."""
    top = change(ctx, ctx.strict if kind == STRICT else ctx.floored)
    rows = m.factor.size
    if ctx.second:
        for d in range(rows):
            scale = abs(m.factor[d]) * (m.slope_strict[d] if kind == STRICT else m.slope_floored[d])
            for j in range(m.correction.shape[0]):
                moved = abs(m.correction[j, rows + d]) * scale
                if not moved <= top:
                    top = moved
    return top
