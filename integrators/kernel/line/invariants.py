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

The order of every sum is fixed: the same coordinate of all bodies first. Where bodies mirror each other, the
sums that vanish by symmetry then vanish exactly, and a fixed-order factorization leaves them so. What is
identically 0 in the gradients, in the matrix and in its factors is left out: n rods of a chain cost O(n).
"""

from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import call_field, get, larger, largest, put, splat8, spread, total
from integrators.kernel.step.fixed_point import multiply
from integrators.kernel.step.rounding import rounding_of
from integrators.kernel.step.stages import group_offset, offset

DEPENDENT = 1e-10  # a pivot this small, relative to its row, is none
REGULAR = 1e-6  # rounding is taken back along these directions only
OF_A_STEP = 16.0  # times the rounding of one value is that of a step, a sum over its stages
GAIN = 0.125  # of a gap is taken back in a step: the noise of its evaluation averages out


@compiled
def row(ctx, chunk):
    """Return where in `LineContext.gradients` the first row of a group of eight stages is."""
    return group_offset(chunk, ctx.every * ctx.lanes, ctx.lanes)


@compiled
def keep_invariants(ctx):
    """Set ``values`` to f - W sum_i g_i alpha_i, from ``found``."""
    lanes, every, dim, n = ctx.lanes, ctx.every, ctx.rows, ctx.invariants
    width, groups, chunks = dim + ctx.entries, ctx.coefficient_groups, ctx.chunks
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
    first, rows, owners = ctx.column_first, ctx.column_row, ctx.column_owner
    for chunk in range(chunks):
        sums, values = ctx.gradients + row(ctx, chunk), ctx.values + offset(ctx, chunk)
        for d in range(dim):
            moved = splat8(0.0)
            for i in range(first[d], first[d + 1]):
                moved += spread(alpha, owners[i]) * get(sums, lanes * rows[i])
            put(values, lanes * d, get(sums, lanes * d) - spread(ctx.metric, d) * moved)


@compiled
def set_gram(ctx):
    """Set the matrix of the equations for alpha, its lower half."""
    legendre, metric, column = ctx.legendre, ctx.metric, ctx.column
    dim, every = ctx.rows, ctx.every
    for pair in range(ctx.pairs):
        whole, part = 0.0, 0.0
        for i in range(ctx.pair_first[pair], ctx.pair_first[pair + 1]):
            first, second = ctx.row_a[i], ctx.row_b[i]
            products = splat8(0.0)
            for group in range(ctx.coefficient_groups):
                j = 8 * every * group
                products += get(legendre, j + 8 * first) * get(legendre, j + 8 * second)
            part += total(products) * metric[column[first - dim]]
            if ctx.ends[i]:
                whole += part
                part = 0.0
        ctx.gram[pair] = whole


@compiled
def set_right(ctx):
    """Set r."""
    lanes, dim, weights, column = ctx.lanes, ctx.rows, ctx.tables.weights, ctx.column
    legendre, every = ctx.legendre, ctx.every
    for chunk in range(ctx.chunks):
        sums, remainders = ctx.gradients + row(ctx, chunk), ctx.remainders + row(ctx, chunk)
        for d in range(dim + ctx.entries):
            put(remainders, lanes * d, get(sums, lanes * d) - get(remainders, lanes * d))
    for a in range(ctx.invariants):
        pair = ctx.diagonal[a]
        whole, part = 0.0, 0.0
        for i in range(ctx.pair_first[pair], ctx.pair_first[pair + 1]):
            entry = ctx.row_a[i]
            d = column[entry - dim]
            products = splat8(0.0)
            if ctx.on_manifold[a]:
                for group in range(ctx.coefficient_groups):
                    j = 8 * every * group
                    products += get(legendre, j + 8 * d) * get(legendre, j + 8 * entry)
                part += total(products)
            else:
                for chunk in range(ctx.chunks):
                    remainders = ctx.remainders + row(ctx, chunk)
                    product = get(remainders, lanes * d) * get(remainders, lanes * entry)
                    products += get(weights, 8 * chunk) * product
                part -= total(products)
            if ctx.ends[i]:
                whole += part
                part = 0.0
        ctx.right[a] = whole


@compiled
def solve_gram(ctx, right, threshold):
    """Replace ``right`` by the solution, by LDL' in the order of ``turn``, without small pivots."""
    gram, lower, entries, pivots, active = ctx.gram, ctx.lower, ctx.lower_row, ctx.pivots, ctx.active
    turn, first, columns, pairs = ctx.turn, ctx.lower_first, ctx.lower_column, ctx.lower_pair
    n = ctx.invariants
    for i in range(n):
        a = turn[i]
        whole = gram[ctx.diagonal[a]]
        pivot = whole
        for at in range(first[i], first[i + 1]):
            j = columns[at]
            value = gram[pairs[at]] if pairs[at] >= 0 else 0.0
            for before in range(first[j], first[j + 1]):
                k = columns[before]
                value -= entries[k] * lower[before] * pivots[k]
            entries[j] = value / pivots[j] if pivots[j] > 0.0 else 0.0
            pivot -= entries[j] * entries[j] * pivots[j]
        pivots[i] = pivot if active[a] and pivot > threshold * whole else 0.0
        for at in range(first[i], first[i + 1]):
            j = columns[at]
            lower[at] = entries[j]
            entries[j] = 0.0
            right[a] -= lower[at] * right[turn[j]]
        if pivots[i] == 0.0:
            right[a] = 0.0
    for i in range(n):
        right[turn[i]] = right[turn[i]] / pivots[i] if pivots[i] > 0.0 else 0.0
    for i in range(n - 1, -1, -1):
        for at in range(first[i], first[i + 1]):
            j = columns[at]
            if pivots[j] > 0.0:
                right[turn[j]] -= lower[at] * right[turn[i]]


@compiled
def correction(ctx, d):
    """Return component d of W sum_i phi_i0 alpha_i."""
    legendre, alpha = ctx.legendre, ctx.alpha
    value = 0.0
    for i in range(ctx.column_first[d], ctx.column_first[d + 1]):
        value += legendre[8 * ctx.column_row[i]] * alpha[ctx.column_owner[i]]
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
    remainders, reference, owed = ctx.remainders, ctx.reference, ctx.owed
    active, largest, lost = ctx.active, ctx.largest, ctx.lost
    state, error, lanes, dim, n = ctx.state, ctx.error, ctx.lanes, ctx.rows, ctx.invariants
    column, entries = ctx.column, ctx.entries
    for lane in range(lanes):
        ctx.times[lane] = ctx.t0
        for d in range(dim):
            ctx.stages[lanes * d + lane] = state[d]
    call_field(ctx.measure, ctx.times, ctx.stages, ctx.par, remainders)
    if ctx.sized:
        for d in range(dim):
            ctx.blocks.terms[d] = steepest(ctx, d) if ctx.length != 0.0 else 0.0
    for a in range(n):
        value = remainders[lanes * (entries + a)]
        gap = value - reference[a]
        scale = abs(value) + abs(reference[a])
        pair = ctx.diagonal[a]
        whole, part = 0.0, 0.0
        for i in range(ctx.pair_first[pair], ctx.pair_first[pair + 1]):
            entry = ctx.row_a[i] - dim
            d = column[entry]
            slope = remainders[lanes * entry]
            scale += abs(slope) * (abs(state[d]) + abs(ctx.length) * steepest(ctx, d))
            part += slope * error[d]
            if ctx.ends[i]:
                whole += part
                part = 0.0
        gap += whole
        largest[a] = max(largest[a], scale)
        if ctx.length == 0.0:
            reference[a], gap = value, 0.0
        elif not active[a]:
            gap = 0.0
        elif not abs(gap) <= OF_A_STEP * rounding_of(largest[a]):
            if lost[a] == 0.0:
                ctx.first_loss[a] = ctx.t0
            lost[a] += abs(gap)
            reference[a], gap = value, 0.0
        owed[a] = GAIN * gap


@compiled
def steepest(ctx, d):
    """Return the largest of row d's values, or of the sums of its absolute terms, in the previous step."""
    top = splat8(0.0)
    for chunk in range(ctx.chunks):
        if ctx.sized:
            size = get(ctx.gradients + row(ctx, chunk), ctx.lanes * (ctx.rows + ctx.entries + d))
        else:
            size = get(ctx.values, offset(ctx, chunk) + ctx.lanes * d)
        top = larger(top, abs(size))
    return largest(top)


@compiled
def find_change(ctx, threshold):
    """Return whether one of the invariants is none: `LineContext.culprit`.

    Its gradient along the field, summed over the stages, is compared with the sum
    of the absolute values of the terms; their ratio is left in `LineContext.change_rate`.
    """
    weights, lanes, dim = ctx.tables.weights, ctx.lanes, ctx.rows
    for a in range(ctx.invariants):
        size, whole, part = 0.0, 0.0, 0.0
        pair = ctx.diagonal[a]
        for i in range(ctx.pair_first[pair], ctx.pair_first[pair + 1]):
            entry = ctx.row_a[i]
            products, sizes = splat8(0.0), splat8(0.0)
            for chunk in range(ctx.chunks):
                sums = ctx.gradients + row(ctx, chunk)
                product = get(sums, lanes * ctx.column[entry - dim]) * get(sums, lanes * entry)
                term = get(weights, 8 * chunk) * product
                products += term
                sizes += abs(term)
            part += total(products)
            size += total(sizes)
            if ctx.ends[i]:
                whole += part
                part = 0.0
        slope = abs(whole)
        # a gradient that is not finite is no good either
        if not slope <= (2.0 if ctx.derived[a] else threshold) * size:
            ctx.culprit, ctx.change_rate = a, slope / size
            return True
    return False
