"""Between coefficients and stages, in the memory of a trajectory's context.

A solver's unknowns are the coefficients gamma (s x R) of the field, not the
field's values: where h J is large, values carry rounding errors of size
h |J| eps, which the corrections take out of gamma.
"""

from integrators.kernel import layout as at
from integrators.kernel.line.views import address, compiled
from integrators.kernel.simd.lanes import fma
from integrators.kernel.simd.memory import (
    get,
    get_float,
    get_int,
    largest,
    put,
    put_float,
    put_int,
    splat8,
    spread,
)
from integrators.kernel.step.sweep import change, multiply, offset

LOW = 3  # columns of a stage table that hold the low parts of the first ones
FLOOR = 1e-3  # of the largest size in its group: where rounding of the field may hide a small component
SMALLEST, LARGE = 1e-200, 1e200  # a block smaller than that has no size to divide by
STRICT, FLOORED = range(2)  # relative to a block, and relative to a block that is raised if it is small


@compiled
def groups(count):
    """Vectors of 8 that hold ``count`` numbers."""
    return (count + 7) // 8


@compiled
def pack(ctx, m, low, first):
    """Write gamma's components from ``first`` on as stage memory has them, the first ``low`` rows twice."""
    padded = get_int(ctx, at.PADDED)
    s, rows = m.gamma.shape[0], m.factor.size
    for j in range(8 * groups(low + s)):
        i = j if j < low else j - low
        start = padded * 8 * (j // 8) + j % 8
        for d in range(rows):
            # What stands in unused places is multiplied by zero, which a NaN survives.
            m.packed[start + 8 * d] = m.gamma[i, first + d] if i < s else 0.0


@compiled
def set_stages(ctx, m):
    """Q = state + (error + h table gamma).

    The second-order form takes the coefficients of q' here, not those of p': sums
    such as q + c h q' + h^2 (...) cancel where a step spans many oscillations.
    """
    rows, padded = get_int(ctx, at.ROWS), get_int(ctx, at.PADDED)
    lanes, chunks = get_int(ctx, at.LANES), get_int(ctx, at.CHUNKS)
    s = m.gamma.shape[0]
    low = min(LOW, s)
    pack(ctx, m, low, 0)
    moves = get_int(ctx, at.SUM)
    multiply(
        address(m.stage_table), chunks, groups(low + s), address(m.packed), 8, moves, lanes, rows, padded
    )
    state, error = get_int(ctx, at.ROW_STATE), get_int(ctx, at.ROW_ERROR)
    h = splat8(get_float(ctx, at.H))
    for chunk in range(chunks):
        start = 8 * offset(ctx, chunk)
        q = get_int(ctx, at.Q) + start
        for d in range(rows):
            i = lanes * d
            put(q, i, spread(state, d) + fma(h, get(moves + start, i), spread(error, d)))


@compiled
def project(ctx, m, target, first):
    """Set the components of ``target`` from ``first`` on to the coefficients of the field's values F."""
    rows, padded = get_int(ctx, at.ROWS), get_int(ctx, at.PADDED)
    s = target.shape[0]
    multiply(
        address(m.projection), groups(s), get_int(ctx, at.CHUNKS), get_int(ctx, at.F),
        get_int(ctx, at.LANES), address(m.packed), 8, rows, padded,
    )  # fmt: skip
    for j in range(s):
        start = padded * 8 * (j // 8) + j % 8
        for d in range(rows):
            target[j, first + d] = m.packed[start + 8 * d]


@compiled
def set_velocities(ctx, m, target):
    """Set the first half of ``target``, in the second-order form, to what its second half makes of q'."""
    rows, s = m.factor.size, m.gamma.shape[0]
    h = get_float(ctx, at.H)
    drift, low, slope = (
        get_int(ctx, at.ROW_DRIFT),
        get_int(ctx, at.ROW_DRIFT_LOW),
        get_int(ctx, at.ROW_FACTOR),
    )
    for d in range(rows):
        kh = get_float(slope, d)
        for i in range(s):
            total = 0.0
            for j in range(s):
                total += m.x[i, j] * target[j, rows + d]
            target[i, d] = kh * total
        target[0, d] += (get_float(drift, d) + get_float(low, d)) / h


@compiled
def set_values(ctx, m):
    """F = the polynomial with the coefficients gamma at the nodes; and the step's increments."""
    s, components = m.gamma.shape
    h = get_float(ctx, at.H)
    for d in range(components):
        m.increment[d] = h * m.gamma[0, d]
    pack(ctx, m, 0, components - m.factor.size)
    multiply(
        address(m.basis), get_int(ctx, at.CHUNKS), groups(s), address(m.packed), 8,
        get_int(ctx, at.F), get_int(ctx, at.LANES), get_int(ctx, at.ROWS), get_int(ctx, at.PADDED),
    )  # fmt: skip


@compiled
def set_factor(ctx, m):
    """Set what the Jacobian's columns are multiplied by."""
    h = get_float(ctx, at.H)
    second = get_int(ctx, at.SECOND)
    row_factor = get_int(ctx, at.ROW_FACTOR)
    for d in range(m.factor.size):
        m.factor[d] = h * get_float(row_factor, d) if second else h


@compiled
def swap_stages(ctx):
    """Keep the present stages as the old ones."""
    before = get_int(ctx, at.Q)
    put_int(ctx, at.Q, get_int(ctx, at.OTHER_Q))
    put_int(ctx, at.OTHER_Q, before)


@compiled
def begin_sizes(ctx):
    """Forget the sizes of all blocks."""
    for b in range(get_int(ctx, at.BLOCK_COUNT)):
        put_float(get_int(ctx, at.SIZE), b, 0.0)
    for g in range(get_int(ctx, at.GROUP_COUNT)):
        put_float(get_int(ctx, at.LARGEST), g, 0.0)


@compiled
def enter_size(ctx, d, value):
    """Let row d have at least the size ``value``."""
    b = get_int(get_int(ctx, at.BLOCK), d)
    g = get_int(get_int(ctx, at.GROUP), b)
    size, biggest = get_int(ctx, at.SIZE), get_int(ctx, at.LARGEST)
    put_float(size, b, max(get_float(size, b), value))
    put_float(biggest, g, max(get_float(biggest, g), value))


@compiled
def end_sizes(ctx, rows, strict, floored):
    """Write the inverse sizes of all rows, and those with small blocks raised."""
    for d in range(rows):
        b = get_int(get_int(ctx, at.BLOCK), d)
        own = get_float(get_int(ctx, at.SIZE), b)
        floor = max(own, FLOOR * get_float(get_int(ctx, at.LARGEST), get_int(get_int(ctx, at.GROUP), b)))
        put_float(strict, d, 1.0 / own if own > SMALLEST else LARGE)
        put_float(floored, d, 1.0 / floor if floor > SMALLEST else LARGE)


@compiled
def take_sizes(ctx, m):
    """Measure the blocks on the stages and on the state, near which stiff components have no stage.

    In the second-order form the velocities too, which may be far from converged where
    the positions of a short step are not.
    """
    rows, lanes = m.factor.size, get_int(ctx, at.LANES)
    begin_sizes(ctx)
    for d in range(rows):
        top = splat8(abs(get_float(get_int(ctx, at.ROW_STATE), d)))
        for chunk in range(get_int(ctx, at.CHUNKS)):
            top = max(top, abs(get(get_int(ctx, at.Q), offset(ctx, chunk) + lanes * d)))
        enter_size(ctx, d, largest(top))
    end_sizes(ctx, rows, get_int(ctx, at.STRICT), get_int(ctx, at.FLOORED))
    put_int(ctx, at.AGE, 0)  # the fixed point is to measure anew
    if get_int(ctx, at.SECOND):
        begin_sizes(ctx)
        for d in range(rows):
            drift = abs(get_float(get_int(ctx, at.ROW_DRIFT), d))
            enter_size(ctx, d, max(drift, abs(m.factor[d] * m.gamma[0, rows + d])))
        end_sizes(ctx, rows, address(m.slope_strict), address(m.slope_floored))


@compiled
def changes(ctx, m, kind):
    """Return the largest change by the last correction, relative to blocks, small ones raised or not."""
    top = change(ctx, get_int(ctx, at.STRICT if kind == STRICT else at.FLOORED))
    rows = m.factor.size
    if get_int(ctx, at.SECOND):
        for d in range(rows):
            scale = abs(m.factor[d]) * (m.slope_strict[d] if kind == STRICT else m.slope_floored[d])
            for j in range(m.correction.shape[0]):
                moved = abs(m.correction[j, rows + d]) * scale
                if not moved <= top:
                    top = moved
    return top
