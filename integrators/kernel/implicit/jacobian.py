"""The Jacobian at a state, entry by entry, and the factors of the corrections' matrices."""

from integrators.kernel import layout as at
from integrators.kernel.implicit import layout as of
from integrators.kernel.implicit.external import ask
from integrators.kernel.implicit.linear import factor, solve
from integrators.kernel.line.views import address, compiled
from integrators.kernel.simd.memory import call_field, get_float, get_int, put_float

STEP = 1.4901161193847656e-08  # sqrt(eps): where the errors of a difference balance
SMALL = 1e-5  # of the largest component: no difference is taken over less
POWERS = 6  # multiplications by the Jacobian that find its spectral radius to 20 % or so


@compiled
def differences(ctx, m, field, t):
    """Set all entries, row by row, from differences: LANES columns per call of the field."""
    rows = get_int(ctx, at.ROWS)
    lanes, padded = get_int(ctx, at.LANES), get_int(ctx, at.PADDED)
    times = address(m.trial)
    stages = times + 8 * lanes
    values = stages + 8 * lanes * padded
    h = abs(get_float(ctx, at.H))
    par = get_int(ctx, at.PAR)
    largest = 0.0
    for l in range(lanes):
        put_float(times, l, t)
    for d in range(rows):
        largest = max(largest, abs(m.point[d]))
        for l in range(lanes):
            put_float(stages, lanes * d + l, m.point[d])
    call_field(field, times, stages, par, values)
    for d in range(rows):
        m.b_re[d] = get_float(values, lanes * d)
    for first in range(0, rows, lanes):
        count = min(lanes, rows - first)
        for l in range(count):
            d = first + l
            size = max(abs(m.point[d]), SMALL * largest)
            if get_int(ctx, at.SECOND) == 0:
                size = max(size, min(h * abs(m.b_re[d]), largest))
            moved = m.point[d] + STEP * (size if size > 0.0 else 1.0)
            put_float(stages, lanes * d + l, moved)
        call_field(field, times, stages, par, values)
        for l in range(count):
            d = first + l
            width = get_float(stages, lanes * d + l) - m.point[d]
            for r in range(rows):
                m.entries[rows * r + d] = (get_float(values, lanes * r + l) - m.b_re[r]) / width
            put_float(stages, lanes * d + l, m.point[d])


@compiled
def linearize(ctx, m, source, t):
    """Take the Jacobian at `Memory.point` and time t, with the function at ``source``, 0 for differences."""
    if source == 0:
        differences(ctx, m, get_int(ctx, at.FIELD), t)
    else:
        put_float(address(m.trial), 0, t)
        call_field(source, address(m.trial), address(m.point), get_int(ctx, at.PAR), address(m.entries))
    m.count[of.JACOBIANS] += 1
    m.count[of.FACTORED] = 0
    m.count[of.LINEARIZED] = 1
    m.count[of.SINCE] = 0


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
            c = m.columns[i]
            m.b_im[m.rows[i]] += m.entries[i] * (m.factor[c] * m.b_re[c])
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
def factorize(ctx, m, factors):
    """Factor I - z_i h J for each pair of eigenvalues; return whether that is possible.

    In the second-order form, I - z_i^2 h^2 J diag(q'/p). With ``factors``, the address
    of a function, it is done there.
    """
    rows = m.factor.size
    m.count[of.FACTORED] = 0
    m.count[of.FACTORIZATIONS] += 1
    if factors:
        if not ask(factors, of.FACTORIZE, 0):
            return False
    else:
        for i in range(m.eigen_re.size):
            start = i * rows
            z, w = m.eigen_re[i], m.eigen_im[i]
            if get_int(ctx, at.SECOND):
                z, w = z * z - w * w, 2.0 * z * w
            for r in range(start, start + rows):
                for c in range(rows):
                    m.lu_re[r, c], m.lu_im[r, c] = 0.0, 0.0
                m.lu_re[r, r - start] = 1.0
            for j in range(m.entries.size):
                c = m.columns[j]
                slope = m.entries[j] * m.factor[c]
                m.lu_re[start + m.rows[j], c] -= z * slope
                m.lu_im[start + m.rows[j], c] -= w * slope
            if not factor(m.lu_re, m.lu_im, m.pivots, start, rows):
                return False
    m.count[of.FACTORED] = 1
    m.real[of.FACTORED_H] = get_float(ctx, at.H)
    return True


@compiled
def resolve(ctx, m, factors, i):
    """Replace v by (I - h z_i J)^{-1} v, J the Jacobian of the first-order form, z_i an eigenvalue.

    In the second-order form, where J couples q' to p and p' to q only, elimination of
    the first leaves one system of R rows.
    """
    rows = m.factor.size
    second = get_int(ctx, at.SECOND)
    h = get_float(ctx, at.H)
    z, w = m.eigen_re[i], m.eigen_im[i]
    first = rows if second else 0
    for d in range(rows):
        m.b_re[d], m.b_im[d] = m.v_re[first + d], m.v_im[first + d]
    if second:
        for j in range(m.entries.size):
            r, c, slope = m.rows[j], m.columns[j], h * m.entries[j]
            m.b_re[r] += slope * (z * m.v_re[c] - w * m.v_im[c])
            m.b_im[r] += slope * (z * m.v_im[c] + w * m.v_re[c])
    if factors:
        ask(factors, of.SOLVE, i)
    else:
        solve(m.lu_re, m.lu_im, m.pivots, i * rows, m.b_re, m.b_im)
    for d in range(rows):
        m.v_re[first + d], m.v_im[first + d] = m.b_re[d], m.b_im[d]
    if second:
        slopes = get_int(ctx, at.ROW_FACTOR)
        for d in range(rows):
            kh = get_float(slopes, d)
            m.v_re[d] += kh * (z * m.b_re[d] - w * m.b_im[d])
            m.v_im[d] += kh * (z * m.b_im[d] + w * m.b_re[d])
