"""The Jacobian at a state, entry by entry, and the factors of the corrections' matrices."""

from integrators.kernel.implicit.factors import FACTORIZE, SOLVE
from integrators.kernel.implicit.linear import factor, solve
from integrators.kernel.native.attributes import address
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import call_factors, call_field

STEP = 1.4901161193847656e-08  # sqrt(eps): where the errors of a difference balance
SMALL = 1e-5  # of the largest component: no difference is taken over less
POWERS = 6  # multiplications by the Jacobian that find its spectral radius to 20 % or so


@compiled
def differences(ctx, m, t):
    """Set all entries, row by row, from differences: as many columns per call of the field."""
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
        m.b_re[d] = values[lanes * d]
    for first in range(0, rows, lanes):
        count = min(lanes, rows - first)
        for l in range(count):
            d = first + l
            size = max(abs(m.state[d]), SMALL * largest)
            if ctx.second == 0:
                size = max(size, min(h * abs(m.b_re[d]), largest))
            moved = m.state[d] + STEP * (size if size > 0.0 else 1.0)
            stages[lanes * d + l] = moved
        call_field(ctx.field, times, stages, par, values)
        for l in range(count):
            d = first + l
            width = stages[lanes * d + l] - m.state[d]
            for r in range(rows):
                m.entries[rows * r + d] = (values[lanes * r + l] - m.b_re[r]) / width
            stages[lanes * d + l] = m.state[d]


@compiled
def linearize(ctx, m, t):
    """Take the Jacobian at `Workspace.state` and time t, by its function or by differences."""
    if m.source == 0:
        differences(ctx, m, t)
    else:
        m.trial[0] = t
        call_field(m.source, m.trial, address(m.state), ctx.par, address(m.entries))
    m.jacobians += 1
    m.factored = 0
    m.linearized = 1
    m.since = 0


@compiled
def contraction(m):
    """Estimate the factor of one fixed-point iteration, but for X_s, from powers of the Jacobian."""
    rows = m.factor.size
    for d in range(rows):
        m.b_re[d] = 1.0 + 0.0625 * ((7 * d) % 13)
    growth = 1.0
    for power in range(2 * POWERS):
        norm = 0.0
        for d in range(rows):
            m.b_im[d] = 0.0
        for i in range(m.entries.size):
            c = m.entry_columns[i]
            m.b_im[m.entry_rows[i]] += m.entries[i] * (m.factor[c] * m.b_re[c])
        for d in range(rows):
            norm = max(norm, abs(m.b_im[d]))
        if not 0.0 < norm < float("inf"):
            return norm
        for r in range(rows):
            m.b_re[r] = m.b_im[r] / norm
        if power >= POWERS:
            growth *= norm
    return growth ** (1.0 / POWERS)


@compiled
def factorize(ctx, m):
    """Factor I - z_i h J for each pair of eigenvalues; return whether that is possible.

    In the second-order form, I - z_i^2 h^2 J diag(q'/p). Where a function keeps
    the factors, it is done there.
    """
    rows = m.factor.size
    m.factored = 0
    m.factorizations += 1
    if m.factors:
        if not call_factors(m.factors, FACTORIZE, 0):
            return False
    else:
        for i in range(m.eigen_re.size):
            start = i * rows
            z, w = m.eigen_re[i], m.eigen_im[i]
            if ctx.second:
                z, w = z * z - w * w, 2.0 * z * w
            for r in range(start, start + rows):
                for c in range(rows):
                    m.lu_re[r, c], m.lu_im[r, c] = 0.0, 0.0
                m.lu_re[r, r - start] = 1.0
            for j in range(m.entries.size):
                c = m.entry_columns[j]
                slope = m.entries[j] * m.factor[c]
                m.lu_re[start + m.entry_rows[j], c] -= z * slope
                m.lu_im[start + m.entry_rows[j], c] -= w * slope
            if not factor(m.lu_re, m.lu_im, m.pivots, start, rows):
                return False
    m.factored = 1
    m.factored_h = ctx.h
    return True


@compiled
def resolve(ctx, m, i):
    """Replace v by (I - h z_i J)^{-1} v, J the Jacobian of the first-order form, z_i an eigenvalue.

    In the second-order form, where J couples q' to p and p' to q only, elimination of
    the first leaves one system of R rows.
    """
    rows = m.factor.size
    second = ctx.second
    h = ctx.h
    z, w = m.eigen_re[i], m.eigen_im[i]
    first = rows if second else 0
    for d in range(rows):
        m.b_re[d], m.b_im[d] = m.v_re[first + d], m.v_im[first + d]
    if second:
        for j in range(m.entries.size):
            r, c, slope = m.entry_rows[j], m.entry_columns[j], h * m.entries[j]
            m.b_re[r] += slope * (z * m.v_re[c] - w * m.v_im[c])
            m.b_im[r] += slope * (z * m.v_im[c] + w * m.v_re[c])
    if m.factors:
        call_factors(m.factors, SOLVE, i)
    else:
        solve(m.lu_re, m.lu_im, m.pivots, i * rows, m.b_re, m.b_im)
    for d in range(rows):
        m.v_re[first + d], m.v_im[first + d] = m.b_re[d], m.b_im[d]
    if second:
        slopes = ctx.row_factor
        for d in range(rows):
            kh = slopes[d]
            m.v_re[d] += kh * (z * m.b_re[d] - w * m.b_im[d])
            m.v_im[d] += kh * (z * m.b_im[d] + w * m.b_re[d])
