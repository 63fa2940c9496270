"""Values along which several invariants are kept.

With f and the gradients g_i of the invariants at the k stages, their Legendre
coefficients gamma_j, phi_ij for j < s, and a fixed metric W = diag > 0,

    sigma' = sum_j P_j (gamma_j - W sum_i phi_ij alpha_i),
    sum_m (sum_j phi_ij' W phi_mj) alpha_m = sum_j phi_ij' gamma_j  =: r_i,

which are the coefficients of the values f - W sum_i g_i alpha_i at the stages: those take the
place of the field's. For an invariant g_i'f = 0 at every stage, so r_i is minus what f and g_i leave
out of their first s Legendre coefficients,

    r_i = -sum_l b_l (g_i - sum_j P_j phi_ij)' (f - sum_j P_j gamma_j)  at c_l,

of size h^{2s} without cancellation; it is this sum that is computed. An invariant of the solutions on a
manifold, such as the energy of a system with constraints, has g_i'f = 0 there only, which stages
leave by the stage order: for such invariants it is the former sum.

The order of every sum is that of the array ``order``: the same coordinate of all
bodies first. Where bodies mirror each other, the sums that vanish by symmetry
then vanish exactly, and a fixed-order factorization leaves them so.
"""

from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import call_field, get, put, splat8, spread, total
from integrators.kernel.step.fixed_point import multiply
from integrators.kernel.step.stages import group_offset, offset

DEPENDENT = 1e-10  # a pivot this small, relative to its row, is none
REGULAR = 1e-6  # rounding is taken back along these directions only
ROUNDING = 2.0**-46  # a larger gap in an invariant, relative to the largest terms so far, is not rounding
GAIN = 0.125  # of a gap is taken back in a step: the noise of its evaluation averages out


@compiled
def row(ctx, chunk):
    """Return where in `LineContext.gradients` the first row of a group of eight stages is."""
    return group_offset(chunk, ctx.every * ctx.lanes, ctx.lanes)


@compiled
def ordered(ctx):
    """Sum up ``terms`` in order, partial sums first."""
    terms, order, ends = ctx.terms, ctx.order, ctx.ends
    whole, part = 0.0, 0.0
    for i in range(ctx.rows):
        part += terms[order[i]]
        if ends[i]:
            whole += part
            part = 0.0
    return whole


@compiled
def keep_invariants(ctx):
    """Set ``values`` to f - W sum_i g_i alpha_i, from ``found``."""
    lanes, every, dim, n = ctx.lanes, ctx.every, ctx.rows, ctx.invariants
    width, groups, chunks = dim * (1 + n), ctx.coefficient_groups, ctx.chunks
    multiply(ctx.onto, groups, chunks, ctx.gradients, lanes, ctx.legendre, 8, width, every)
    multiply(ctx.back, chunks, groups, ctx.legendre, 8, ctx.remainders, lanes, width, every)
    set_gram(ctx)
    set_right(ctx)
    alpha, right, owed, h = ctx.alpha, ctx.right, ctx.owed, ctx.h
    for a in range(n):
        alpha[a] = owed[a] / h if h != 0.0 else 0.0
    solve_gram(ctx, alpha, REGULAR)
    solve_gram(ctx, right, DEPENDENT)
    for a in range(n):
        alpha[a] += right[a]
    for chunk in range(chunks):
        sums, values = ctx.gradients + row(ctx, chunk), ctx.values + offset(ctx, chunk)
        for d in range(dim):
            moved = splat8(0.0)
            for a in range(n):
                moved += spread(alpha, a) * get(sums, lanes * (dim * (1 + a) + d))
            put(values, lanes * d, get(sums, lanes * d) - spread(ctx.metric, d) * moved)


@compiled
def set_gram(ctx):
    """Set the matrix of the equations for alpha, its lower half."""
    terms, legendre, metric, gram = ctx.terms, ctx.legendre, ctx.metric, ctx.gram
    dim, every, n = ctx.rows, ctx.every, ctx.invariants
    for a in range(n):
        for b in range(a + 1):
            first, second = dim * (1 + a), dim * (1 + b)
            for d in range(dim):
                products = splat8(0.0)
                for group in range(ctx.coefficient_groups):
                    i = 8 * every * group
                    products += get(legendre, i + 8 * (first + d)) * get(legendre, i + 8 * (second + d))
                terms[d] = total(products) * metric[d]
            gram[n * a + b] = ordered(ctx)


@compiled
def set_right(ctx):
    """Set r."""
    lanes, dim, terms, weights = ctx.lanes, ctx.rows, ctx.terms, ctx.tables.weights
    width = dim * (1 + ctx.invariants)
    for chunk in range(ctx.chunks):
        sums, remainders = ctx.gradients + row(ctx, chunk), ctx.remainders + row(ctx, chunk)
        for d in range(width):
            put(remainders, lanes * d, get(sums, lanes * d) - get(remainders, lanes * d))
    legendre, every, groups = ctx.legendre, ctx.every, ctx.coefficient_groups
    for a in range(ctx.invariants):
        for d in range(dim):
            products = splat8(0.0)
            if ctx.on_manifold[a]:
                for group in range(groups):
                    i = 8 * every * group
                    products += get(legendre, i + 8 * d) * get(legendre, i + 8 * (dim * (1 + a) + d))
                terms[d] = total(products)
                continue
            for chunk in range(ctx.chunks):
                remainders = ctx.remainders + row(ctx, chunk)
                product = get(remainders, lanes * d) * get(remainders, lanes * (dim * (1 + a) + d))
                products += get(weights, 8 * chunk) * product
            terms[d] = -total(products)
        ctx.right[a] = ordered(ctx)


@compiled
def solve_gram(ctx, right, threshold):
    """Replace ``right`` by the solution, by LDL' in the order of the invariants, without small pivots."""
    gram, lower, pivots, active = ctx.gram, ctx.lower, ctx.pivots, ctx.active
    n = ctx.invariants
    for a in range(n):
        pivot = gram[n * a + a]
        for b in range(a):
            value = gram[n * a + b]
            for c in range(b):
                value -= lower[n * a + c] * lower[n * b + c] * pivots[c]
            lower[n * a + b] = value / pivots[b] if pivots[b] > 0.0 else 0.0
            pivot -= lower[n * a + b] * lower[n * a + b] * pivots[b]
        pivots[a] = pivot if active[a] and pivot > threshold * gram[n * a + a] else 0.0
        for b in range(a):
            right[a] -= lower[n * a + b] * right[b]
        if pivots[a] == 0.0:
            right[a] = 0.0
    for a in range(n):
        right[a] = right[a] / pivots[a] if pivots[a] > 0.0 else 0.0
    for a in range(n - 1, -1, -1):
        for b in range(a + 1, n):
            if pivots[a] > 0.0:
                right[a] -= lower[n * b + a] * right[b]


@compiled
def correction(ctx, d):
    """Return component d of W sum_i phi_i0 alpha_i."""
    legendre, alpha, dim = ctx.legendre, ctx.alpha, ctx.rows
    value = 0.0
    for a in range(ctx.invariants):
        value += legendre[8 * (dim * (1 + a) + d)] * alpha[a]
    return ctx.metric[d] * value


@compiled
def measure_gap(ctx):
    """Set ``owed`` to what the step is to take back: a part of what rounding cost the invariants so far.

    What is more than rounding was lost by the quadrature (k too small); it is
    added up and stays lost: the invariants are then kept at what they are now. At a start without a
    past they are what they are. Rounding is a part of the largest terms so far, those of the field among
    them: at a turning point those of the moment nearly vanish. Uses the first stages, which the previous
    step does not need any more.
    """
    remainders, reference, owed, terms = ctx.remainders, ctx.reference, ctx.owed, ctx.terms
    active, largest, lost = ctx.active, ctx.largest, ctx.lost
    state, error, lanes, dim, n = ctx.state, ctx.error, ctx.lanes, ctx.rows, ctx.invariants
    for lane in range(lanes):
        ctx.times[lane] = ctx.t0
        for d in range(dim):
            ctx.stages[lanes * d + lane] = state[d]
    call_field(ctx.measure, ctx.times, ctx.stages, ctx.par, remainders)
    for a in range(n):
        value = remainders[lanes * (dim * n + a)]
        gap = value - reference[a]
        scale = abs(value) + abs(reference[a])
        for d in range(dim):
            slope = remainders[lanes * (dim * a + d)]
            added = abs(ctx.length) * remainders[lanes * (dim * n + n + d)]
            scale += abs(slope) * (abs(state[d]) + added)
            terms[d] = slope * error[d]
        gap += ordered(ctx)
        largest[a] = max(largest[a], scale)
        if ctx.length == 0.0:
            reference[a], gap = value, 0.0
        elif not active[a]:
            gap = 0.0
        elif not abs(gap) <= ROUNDING * largest[a]:
            if lost[a] == 0.0:
                ctx.first_loss[a] = ctx.t0
            lost[a] += abs(gap)
            reference[a], gap = value, 0.0
        owed[a] = GAIN * gap


@compiled
def find_change(ctx, threshold):
    """Return whether one of the invariants is none: `LineContext.culprit`.

    Its gradient along the field, summed over the stages, is compared with the sum
    of the absolute values of the terms; their ratio is left in `LineContext.change_rate`.
    """
    terms, weights, lanes, dim = ctx.terms, ctx.tables.weights, ctx.lanes, ctx.rows
    for a in range(ctx.invariants):
        size = 0.0
        for d in range(dim):
            products, sizes = splat8(0.0), splat8(0.0)
            for chunk in range(ctx.chunks):
                sums = ctx.gradients + row(ctx, chunk)
                product = get(sums, lanes * d) * get(sums, lanes * (dim * (1 + a) + d))
                term = get(weights, 8 * chunk) * product
                products += term
                sizes += abs(term)
            terms[d] = total(products)
            size += total(sizes)
        slope = abs(ordered(ctx))
        # a gradient that is not finite is no good either
        if not slope <= (2.0 if ctx.derived[a] else threshold) * size:
            ctx.culprit, ctx.change_rate = a, slope / size
            return True
    return False
