"""The Jacobian at a state, entry by entry, and the factors of the corrections' matrices."""

from integrators.kernel.implicit.groups import SMALL, STEP
from integrators.kernel.implicit.linear import factor, solve
from integrators.kernel.implicit.memory import FACTORIZE, SOLVE, Corrections
from integrators.kernel.native.attributes import view
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.lanes import fma
from integrators.kernel.simd.memory import call_factors, call_field, get, put, splat8, spread

workspace = view(Corrections)
POWERS = 6  # multiplications by the Jacobian that find its spectral radius to 20 % or so


@compiled
def differences(ctx, m, t):
    """Set all entries from differences: in each lane of a call of the field those of a group of columns.

    The columns of a group have no row in common; see `integrators.kernel.implicit.groups`.
    """
    rows = ctx.rows
    lanes, padded = ctx.lanes, ctx.padded
    times = m.trial
    stages = times + lanes
    values = stages + lanes * padded
    h = abs(ctx.h)
    par = ctx.par
    largest = 0.0
    for l in range(lanes):
        times[l] = t
    for d in range(rows):
        largest = max(largest, abs(m.state[d]))
        for l in range(lanes):
            stages[lanes * d + l] = m.state[d]
    call_field(ctx.field, times, stages, par, values)
    for d in range(rows):
        m.slopes[d] = values[lanes * d]
    for first in range(0, m.group_count, lanes):
        count = min(lanes, m.group_count - first)
        for i in range(m.column_starts[first], m.column_starts[first + count]):
            d = m.columns[i]
            l = m.column_groups[d] - first
            size = max(abs(m.state[d]), SMALL * largest)
            if ctx.second == 0:
                size = max(size, min(h * abs(m.slopes[d]), largest))
            moved = m.state[d] + max(STEP, ctx.estimate.spacing) * (size if size > 0.0 else 1.0)
            stages[lanes * d + l] = moved
        call_field(ctx.field, times, stages, par, values)
        for i in range(m.column_starts[first], m.column_starts[first + count]):
            d = m.columns[i]
            l = m.column_groups[d] - first
            width = stages[lanes * d + l] - m.state[d]
            for j in range(m.entry_starts[i], m.entry_starts[i + 1]):
                e = m.column_entries[j]
                r = m.entry_rows[e]
                m.entries[e] = (values[lanes * r + l] - m.slopes[r]) / width
            stages[lanes * d + l] = m.state[d]


@compiled
def linearize(ctx, m, t):
    """Take the Jacobian at `Workspace.state` and time t, by its function or by differences.

    Tangent vectors take the trajectory's last one where that is by differences.
    """
    if m.source == 0 and m.trajectory != 0:
        entries = workspace(m.trajectory).entries
        for i in range(m.entry_count):
            m.entries[i] = entries[i]
    elif m.source == 0:
        differences(ctx, m, t)
    else:
        m.trial[0] = t
        call_field(m.source, m.trial, m.state, ctx.par, m.entries)
    m.jacobians += 1
    m.factored = 0
    m.linearized = 1
    m.since = 0


@compiled
def contraction(m):
    """Estimate the factor of one fixed-point iteration, but for X_s, from powers of the Jacobian."""
    rows = m.unknowns
    for d in range(rows):
        m.slopes[d] = 1.0 + 0.0625 * ((7 * d) % 13)
    growth = 1.0
    for power in range(2 * POWERS):
        norm = 0.0
        for d in range(rows):
            m.next_slopes[d] = 0.0
        for i in range(m.entry_count):
            c = m.entry_columns[i]
            m.next_slopes[m.entry_rows[i]] += m.entries[i] * (m.factor[c] * m.slopes[c])
        for d in range(rows):
            norm = max(norm, abs(m.next_slopes[d]))
        if not 0.0 < norm < float("inf"):
            return norm
        for r in range(rows):
            m.slopes[r] = m.next_slopes[r] / norm
        if power >= POWERS:
            growth *= norm
    return growth ** (1.0 / POWERS)


@compiled
def factorize(ctx, m):
    """Factor I - z_i h J for each pair of eigenvalues; return whether that is possible.

    In the second-order form, I - z_i^2 h^2 J diag(q'/p). Where a function keeps
    the factors, it is done there.
    """
    rows = m.unknowns
    m.factored = 0
    m.factorizations += 1
    if m.factors:
        if not call_factors(m.factors, FACTORIZE, 0):
            return False
    else:
        size = 16 * rows * rows
        for group in range(m.pair_groups):
            lu = m.lu + size * group
            begins, ends = m.begins + rows * group, m.ends + rows * group
            z, w = get(m.powers, 16 * group), get(m.powers, 16 * group + 8)
            for r in range(rows):
                begins[r] = ends[r] = r
            for j in range(m.entry_count):
                r, c = m.entry_rows[j], m.entry_columns[j]
                begins[r], ends[r] = min(begins[r], c), max(ends[r], c)
            for r in range(rows):
                for i in range(16 * begins[r], 16 * (ends[r] + 1), 8):
                    put(lu, 16 * rows * r + i, splat8(0.0))
                put(lu, 16 * (rows + 1) * r, splat8(1.0))
            for j in range(m.entry_count):
                r, c = m.entry_rows[j], m.entry_columns[j]
                i, slope = 16 * (rows * r + c), splat8(m.entries[j] * m.factor[c])
                put(lu, i, fma(-z, slope, get(lu, i)))
                put(lu, i + 8, fma(-w, slope, get(lu, i + 8)))
            if not factor(lu, m.pivots + rows * group, begins, ends, rows):
                return False
    m.factored = 1
    m.factored_h = ctx.h
    return True


@compiled
def resolve(ctx, m, group):
    """Replace eight vectors v by (I - h z_i J)^{-1} v, J the Jacobian of the first-order form; all copies.

    z_i are the eigenvalues of a group. In the second-order form, where J couples q' to p and p' to
    q only, elimination of the first leaves systems of R rows.
    """
    rows, h, unknowns = ctx.rows, ctx.h, m.unknowns
    step = 8 * m.padded
    v = m.v + 2 * step * group
    last = v + (m.parts - 1) * m.wide
    x, y = m.b, m.b + step
    for i in range(0, 2 * step, 8):
        put(x, i, get(last, i))
    if ctx.second:
        z, w = get(m.eigen, 16 * group), get(m.eigen, 16 * group + 8)
        for above in range(0, 8 * rows, 8 * unknowns):
            for j in range(m.entry_count):
                r, c = above + 8 * m.entry_rows[j], above + 8 * m.entry_columns[j]
                slope, a, b = splat8(h * m.entries[j]), get(v, c), get(v, step + c)
                put(x, r, fma(slope, fma(z, a, -w * b), get(x, r)))
                put(y, r, fma(slope, fma(z, b, w * a), get(y, r)))
    if m.factors:
        call_factors(m.factors, SOLVE, group)
    else:
        first = unknowns * group
        lu, pivots, begins, ends = (
            m.lu + 16 * unknowns * first, m.pivots + first, m.begins + first, m.ends + first,
        )  # fmt: skip
        for above in range(0, 8 * rows, 8 * unknowns):
            solve(lu, pivots, begins, ends, unknowns, x + above, y + above)
    for i in range(0, 2 * step, 8):
        put(last, i, get(x, i))
    if ctx.second:
        z, w = get(m.eigen, 16 * group), get(m.eigen, 16 * group + 8)
        slopes = ctx.factors.row
        for d in range(rows):
            kh, a, b = spread(slopes, d), get(x, 8 * d), get(y, 8 * d)
            put(v, 8 * d, fma(kh, fma(z, a, -w * b), get(v, 8 * d)))
            put(v, step + 8 * d, fma(kh, fma(z, b, w * a), get(v, step + 8 * d)))
