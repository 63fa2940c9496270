"""The stage equations by simplified Newton or blended iteration.

F(gamma) = gamma - P'Omega f(state + h I gamma) = 0, with I the table of integrals.
A simplified Newton correction solves (I - X_s (x) h J) delta = -F. With X_s =
V diag(z) V^{-1} this is one complex system with I - h z J for each pair of
conjugate eigenvalues. The blended iteration needs one real matrix whatever s
is: with rho = min |z|, eta = F, eta_1 = rho X_s^{-1} eta, theta = (I - h rho J)^{-1},

    delta = -theta [eta_1 + theta (eta - eta_1)].

In the second-order form gamma holds the coefficients of q' and of p', and F the
linear relation between them as well: it is only through corrections of both that
the rounding errors of large h J are taken out again.

References
----------
E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, Springer
1996, section IV.8. L. Brugnano, C. Magherini, *Blended implementation of block
implicit methods for ODEs*, Applied Numerical Mathematics 42 (2002) 29-45.
"""

from integrators.kernel import layout as at
from integrators.kernel.implicit import layout as of
from integrators.kernel.implicit.jacobian import factorize, linearize, resolve
from integrators.kernel.implicit.linear import factor, solve
from integrators.kernel.implicit.stages import project, set_velocities, swap_stages
from integrators.kernel.line.views import compiled
from integrators.kernel.simd.memory import get_float, get_int
from integrators.kernel.step.sweep import evaluate, offset

# Which Jacobian a correction takes: the one at hand, one at the mean of the stages, one at each stage.
KEPT, MEAN, EACH = range(3)


@compiled
def newton(ctx, m, factors):
    """Set the correction from the residual: one complex system per pair of eigenvalues."""
    s, components = m.residual.shape
    for j in range(s):
        for d in range(components):
            m.correction[j, d] = 0.0
    for i in range(m.eigen_re.size):
        for d in range(components):
            a, b = 0.0, 0.0
            for j in range(s):
                a += m.left_re[i, j] * m.residual[j, d]
                b += m.left_im[i, j] * m.residual[j, d]
            m.v_re[d], m.v_im[d] = a, b
        resolve(ctx, m, factors, i)
        for j in range(s):
            a, b = m.right_re[j, i], m.right_im[j, i]
            for d in range(components):
                m.correction[j, d] += a * m.v_re[d] - b * m.v_im[d]


@compiled
def blended(ctx, m, factors):
    """Set the correction from the residual: theta twice, on two rows at a time as real and imaginary part."""
    s, components = m.residual.shape
    rho = m.eigen_re[0]
    for d in range(components):
        for i in range(s):
            total = 0.0
            for j in range(s):
                total += m.inverse[i, j] * m.residual[j, d]
            m.correction[i, d] = rho * total
    for i in range(0, s, 2):
        j = min(i + 1, s - 1)
        for d in range(components):
            m.v_re[d] = m.residual[i, d] - m.correction[i, d]
            m.v_im[d] = m.residual[j, d] - m.correction[j, d]
        for twice in range(2):
            resolve(ctx, m, factors, 0)
            if twice == 0:
                for d in range(components):
                    m.v_re[d] += m.correction[i, d]
                    m.v_im[d] += m.correction[j, d]
        for d in range(components):
            m.correction[j, d] = m.v_im[d]
        for d in range(components):
            m.correction[i, d] = m.v_re[d]


@compiled
def take_stage(ctx, m, stage):
    """Set `Memory.point` to one of the stages."""
    lanes = get_int(ctx, at.LANES)
    start = get_int(ctx, at.Q) + 8 * (stage // lanes) * get_int(ctx, at.PADDED) * lanes
    for d in range(m.point.size):
        m.point[d] = get_float(start, lanes * d + stage % lanes)


@compiled
def take_mean(ctx, m):
    """Set `Memory.point` to the mean of the stages."""
    lanes = get_int(ctx, at.LANES)
    for d in range(m.point.size):
        m.point[d] = 0.0
    for chunk in range(get_int(ctx, at.CHUNKS)):
        start = get_int(ctx, at.Q) + 8 * offset(ctx, chunk)
        for d in range(m.point.size):
            for l in range(8):
                m.point[d] += m.weights[8 * chunk + l] * get_float(start, lanes * d + l)


@compiled
def full(ctx, m, source):
    """Set the correction with the Jacobian of every stage; return whether that is possible.

    One real matrix of s R rows; in the second-order form q' is eliminated.
    """
    s, rows = m.gamma.shape[0], m.factor.size
    second = get_int(ctx, at.SECOND)
    first = rows if second else 0
    h = get_float(ctx, at.H)
    n = s * rows
    for r in range(n):
        for c in range(n):
            m.whole_re[r, c], m.whole_im[r, c] = 0.0, 0.0
        m.whole_re[r, r] = 1.0
        m.whole_x[r], m.whole_y[r] = m.residual[r // rows, first + r % rows], 0.0
    for stage in range(get_int(ctx, at.STAGES)):
        take_stage(ctx, m, stage)
        linearize(ctx, m, source, get_float(get_int(ctx, at.TIMES), stage))
        for e in range(m.entries.size):
            r, c = m.rows[e], m.columns[e]
            slope = m.entries[e] * m.factor[c]
            known = 0.0
            if second:
                for i in range(s):
                    known += m.integrals[stage, i] * m.residual[i, c]
            for j in range(s):
                part = m.moments[j, stage] * slope
                for i in range(s):
                    m.whole_re[j * rows + r, i * rows + c] -= part * m.reach[stage, i]
                m.whole_x[j * rows + r] += m.moments[j, stage] * (h * m.entries[e] * known)
    m.count[of.FACTORIZATIONS] += 1
    if not factor(m.whole_re, m.whole_im, m.whole_pivots, 0, n):
        return False
    solve(m.whole_re, m.whole_im, m.whole_pivots, 0, m.whole_x, m.whole_y)
    for j in range(s):
        for d in range(rows):
            m.correction[j, first + d] = m.whole_x[j * rows + d]
    if second:
        for i in range(s):
            for d in range(rows):
                total = 0.0
                for j in range(s):
                    total += m.x[i, j] * m.correction[j, rows + d]
                m.correction[i, d] = m.residual[i, d] + get_float(get_int(ctx, at.ROW_FACTOR), d) * total
    return True


@compiled
def set_residual(ctx, m):
    """Evaluate the field; set the residual -F."""
    s, components = m.gamma.shape
    evaluate(ctx)
    project(ctx, m, m.residual, components - m.factor.size)
    if get_int(ctx, at.SECOND):
        for j in range(s):
            for d in range(m.factor.size, components):
                m.correction[j, d] = m.gamma[j, d]
        set_velocities(ctx, m, m.correction)
        for j in range(s):
            for d in range(m.factor.size):
                m.residual[j, d] = m.correction[j, d]
    for j in range(s):
        for d in range(components):
            m.residual[j, d] -= m.gamma[j, d]


@compiled
def is_finite(values):
    """Whether all values are finite numbers."""
    total = 0.0
    for value in values.flat:
        total += value * 0.0
    return total == 0.0


@compiled
def correct(ctx, m, method, source, factors, which):
    """Correct gamma once; return DONE, DIVERGED or NOT_FINITE."""
    s, components = m.gamma.shape
    m.count[of.TRIED] += 1
    set_residual(ctx, m)
    if not is_finite(m.residual):
        return at.NOT_FINITE
    possible = True
    if which == EACH and m.whole_x.size > 0:
        possible = full(ctx, m, source)
    else:
        if which != KEPT:
            take_mean(ctx, m)
            half = get_int(ctx, at.N) + 0.5
            linearize(ctx, m, source, get_float(ctx, at.T0) + half * get_float(ctx, at.H))
        if m.count[of.FACTORED] == 0:
            possible = factorize(ctx, m, factors)
        if possible:
            if method == of.BLENDED:
                blended(ctx, m, factors)
            else:
                newton(ctx, m, factors)
    if not possible:
        return at.DIVERGED if is_finite(m.entries) else at.NOT_FINITE
    for j in range(s):
        for d in range(components):
            m.gamma[j, d] += m.correction[j, d]
    swap_stages(ctx)
    return at.DONE
