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

from integrators.kernel.context import DIVERGED, DONE, NOT_FINITE
from integrators.kernel.implicit.constants import BLENDED
from integrators.kernel.implicit.jacobian import factorize, linearize, resolve
from integrators.kernel.implicit.linear import factor, solve
from integrators.kernel.implicit.stages import project, set_velocities
from integrators.kernel.native.jit import compiled
from integrators.kernel.step.stages import offset
from integrators.kernel.step.sweep import evaluate

# Which Jacobian a correction takes: the one at hand, one at the mean of the stages, one at each stage.
KEPT, MEAN, EACH = range(3)


@compiled
def newton(ctx, m):
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
        resolve(ctx, m, i)
        for j in range(s):
            a, b = m.right_re[j, i], m.right_im[j, i]
            for d in range(components):
                m.correction[j, d] += a * m.v_re[d] - b * m.v_im[d]


@compiled
def blended(ctx, m):
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
            resolve(ctx, m, 0)
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
    """Set `Workspace.state` to one of the stages."""
    lanes = ctx.lanes
    start = ctx.stages + (stage // lanes) * ctx.padded * lanes
    for d in range(m.state.size):
        m.state[d] = start[lanes * d + stage % lanes]


@compiled
def take_mean(ctx, m):
    """Set `Workspace.state` to the mean of the stages."""
    lanes = ctx.lanes
    for d in range(m.state.size):
        m.state[d] = 0.0
    for chunk in range(ctx.chunks):
        start = ctx.stages + offset(ctx, chunk)
        for d in range(m.state.size):
            for l in range(8):
                m.state[d] += m.weights[8 * chunk + l] * start[lanes * d + l]


@compiled
def full(ctx, m):
    """Set the correction with the Jacobian of every stage; return whether that is possible.

    One real matrix of s R rows; in the second-order form q' is eliminated.
    """
    s, rows = m.gamma.shape[0], m.factor.size
    second = ctx.second
    first = rows if second else 0
    h = ctx.h
    n = s * rows
    for r in range(n):
        for c in range(n):
            m.whole_re[r, c], m.whole_im[r, c] = 0.0, 0.0
        m.whole_re[r, r] = 1.0
        m.whole_x[r], m.whole_y[r] = m.residual[r // rows, first + r % rows], 0.0
    for stage in range(ctx.k):
        take_stage(ctx, m, stage)
        linearize(ctx, m, ctx.times[stage])
        for e in range(m.entries.size):
            r, c = m.entry_rows[e], m.entry_columns[e]
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
    m.factorizations += 1
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
                m.correction[i, d] = m.residual[i, d] + ctx.row_factor[d] * total
    return True


@compiled
def set_residual(ctx, m):
    """Evaluate the field; set the residual -F."""
    s, components = m.gamma.shape
    evaluate(ctx)
    project(ctx, m, m.residual, components - m.factor.size)
    if ctx.second:
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
def correct(ctx, m, which):
    """Correct gamma once; return DONE, DIVERGED or NOT_FINITE."""
    s, components = m.gamma.shape
    m.tried += 1
    set_residual(ctx, m)
    if not is_finite(m.residual):
        return NOT_FINITE
    possible = True
    if which == EACH and m.whole > 0:
        possible = full(ctx, m)
    else:
        if which != KEPT:
            take_mean(ctx, m)
            half = ctx.n + 0.5
            linearize(ctx, m, ctx.t0 + half * ctx.h)
        if m.factored == 0:
            possible = factorize(ctx, m)
        if possible:
            if m.method == BLENDED:
                blended(ctx, m)
            else:
                newton(ctx, m)
    if not possible:
        return DIVERGED if is_finite(m.entries) else NOT_FINITE
    for j in range(s):
        for d in range(components):
            m.gamma[j, d] += m.correction[j, d]
    ctx.stages, ctx.old_stages = ctx.old_stages, ctx.stages
    return DONE
