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
from integrators.kernel.implicit.jacobian import factorize, linearize, resolve
from integrators.kernel.implicit.linear import eliminate
from integrators.kernel.implicit.memory import BLENDED
from integrators.kernel.implicit.stages import at, project, set_velocities
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import get, put, splat8
from integrators.kernel.step.fixed_point import evaluate, multiply
from integrators.kernel.step.stages import offset

# Which Jacobian a correction takes: the one at hand, one at the mean of the stages, one at each stage.
KEPT, MEAN, EACH = range(3)


@compiled
def newton(ctx, m):
    """Set the correction from the residual: one complex system per pair of eigenvalues, eight at a time."""
    rows, padded, groups, pairs = ctx.rows, ctx.padded, m.groups, 2 * m.pair_groups
    for part in range(m.parts):
        source, target = m.residual + m.block * part, m.v + m.wide * part
        multiply(m.left, pairs, groups, source, 8, target, 8, rows, padded)
    for group in range(m.pair_groups):
        resolve(ctx, m, group)
    for part in range(m.parts):
        source, target = m.v + m.wide * part, m.correction + m.block * part
        multiply(m.right, groups, pairs, source, 8, target, 8, rows, padded)


@compiled
def blended(ctx, m):
    """Set the correction from the residual: theta twice, on two groups as real and imaginary part."""
    padded, groups, parts = ctx.padded, m.groups, m.parts
    step = 8 * padded
    for part in range(parts):
        source, target = m.residual + m.block * part, m.correction + m.block * part
        multiply(m.inverse, groups, groups, source, 8, target, 8, ctx.rows, padded)
    for group in range(0, groups, 2):
        two = min(2, groups - group)
        for part in range(parts):
            shift, v = m.block * part + step * group, m.v + m.wide * part
            for i in range(0, 2 * step, 8):
                put(v, i, splat8(0.0))
            for i in range(0, two * step, 8):
                put(v, i, get(m.residual, shift + i) - get(m.correction, shift + i))
        resolve(ctx, m, 0)
        for part in range(parts):
            shift, v = m.block * part + step * group, m.v + m.wide * part
            for i in range(0, two * step, 8):
                put(v, i, get(v, i) + get(m.correction, shift + i))
        resolve(ctx, m, 0)
        for part in range(parts):
            shift, v = m.block * part + step * group, m.v + m.wide * part
            for i in range(0, two * step, 8):
                put(m.correction, shift + i, get(v, i))


@compiled
def take_stage(ctx, m, stage):
    """Set `Workspace.state` to one of the stages."""
    lanes = ctx.lanes
    start = ctx.stages + ((stage // lanes) * ctx.padded + m.first) * lanes
    for d in range(m.unknowns):
        m.state[d] = start[lanes * d + stage % lanes]


@compiled
def take_mean(ctx, m):
    """Set `Workspace.state` to the mean of the stages."""
    lanes = ctx.lanes
    for d in range(m.unknowns):
        m.state[d] = 0.0
    for chunk in range(ctx.chunks):
        start = ctx.stages + offset(ctx, chunk) + lanes * m.first
        for d in range(m.unknowns):
            for l in range(8):
                m.state[d] += m.weights[8 * chunk + l] * start[lanes * d + l]


@compiled
def full(ctx, m, above):
    """Set the correction of a copy with the Jacobian of every stage; return whether that is possible.

    One real matrix of s R rows; in the second-order form q' is eliminated. Its rows begin at ``above``.
    """
    s, rows = m.s, m.unknowns
    second = ctx.second
    n = s * rows
    width = 8 * ((n + 7) // 8)
    whole, x = m.whole_matrix, m.whole_x
    last = (m.parts - 1) * m.block
    for i in range(0, n * width, 8):
        put(whole, i, splat8(0.0))
    for j in range(s):
        for d in range(rows):
            r = j * rows + d
            whole[(width + 1) * r] = 1.0
            x[r] = m.residual[last + at(m, j, above + d)]
    for stage in range(ctx.k):
        take_stage(ctx, m, stage)
        linearize(ctx, m, ctx.times[stage])
        for e in range(m.entry_count):
            r, c = m.entry_rows[e], m.entry_columns[e]
            slope = m.entries[e] * m.factor[c]
            known = 0.0
            if second:
                for i in range(s):
                    known += m.integrals[s * stage + i] * m.residual[at(m, i, above + c)]
            for j in range(s):
                part, row = m.moments[m.k * j + stage] * slope, width * (j * rows + r) + c
                for i in range(s):
                    whole[row + i * rows] -= part * m.force_integrals[s * stage + i]
                x[j * rows + r] += m.moments[m.k * j + stage] * (ctx.h * m.entries[e] * known)
    m.factorizations += 1
    if not eliminate(whole, n, width, x):
        return False
    for j in range(s):
        for d in range(rows):
            m.correction[last + at(m, j, above + d)] = x[j * rows + d]
    if second:
        for i in range(s):
            for d in range(rows):
                total = 0.0
                for j in range(s):
                    total += m.x[s * i + j] * x[j * rows + d]
                index = at(m, i, above + d)
                m.correction[index] = m.residual[index] + ctx.factors.row[above + d] * total
    return True


@compiled
def set_residual(ctx, m):
    """Evaluate the field; set the residual -F."""
    evaluate(ctx)
    project(ctx, m, m.residual)
    if ctx.second:
        set_velocities(ctx, m, m.gamma, m.residual)
    for i in range(0, m.parts * m.block, 8):
        put(m.residual, i, get(m.residual, i) - get(m.gamma, i))


@compiled
def is_finite(values, count):
    """Whether all of ``count`` values are finite numbers."""
    total = 0.0
    for i in range(count):
        total += values[i] * 0.0
    return total == 0.0


@compiled
def correct(ctx, m, which):
    """Correct gamma once; return DONE, DIVERGED or NOT_FINITE."""
    m.tried += 1
    set_residual(ctx, m)
    if not is_finite(m.residual, m.parts * m.block):
        return NOT_FINITE
    possible = True
    if which == EACH and m.whole > 0:
        for above in range(0, ctx.rows, m.unknowns):
            possible = possible and full(ctx, m, above)
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
        return DIVERGED if is_finite(m.entries, m.entry_count) else NOT_FINITE
    for i in range(0, m.parts * m.block, 8):
        put(m.gamma, i, get(m.gamma, i) + get(m.correction, i))
    ctx.stages, ctx.scratch.old_stages = ctx.scratch.old_stages, ctx.stages
    return DONE
