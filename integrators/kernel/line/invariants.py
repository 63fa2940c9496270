"""Coefficients of a polynomial along which several invariants are kept.

With f and the gradients g_i of the invariants at the k stages, their Legendre
coefficients gamma_j, phi_ij for j < s, and a fixed metric W = diag > 0,

    sigma' = sum_j P_j (gamma_j - W sum_i phi_ij alpha_i),
    sum_m (sum_j phi_ij' W phi_mj) alpha_m = sum_j phi_ij' gamma_j  =: r_i.

For an invariant g_i'f = 0 at every stage, so r_i is minus what f and g_i leave
out of their first s Legendre coefficients,

    r_i = -sum_l b_l (g_i - sum_j P_j phi_ij)' (f - sum_j P_j gamma_j)  at c_l,

of size h^{2s} without cancellation; it is this sum that is computed.

The order of every sum is that of the array ``order``: the same coordinate of all
bodies first. Where bodies mirror each other, the sums that vanish by symmetry
then vanish exactly, and a fixed-order factorization leaves them so.
"""

from integrators.kernel.native.jit import compiled

DEPENDENT = 1e-10  # a pivot this small, relative to its row, is none
REGULAR = 1e-6  # rounding is taken back along these directions only
ROUNDING = 2.0**-46  # a larger gap in an invariant, relative to its terms, is not rounding
GAIN = 0.125  # of a gap is taken back in a step: the noise of its evaluation averages out


@compiled
def total(m, row):
    """Sum up a row of ``sums`` in order, partial sums first."""
    sums, order, ends = m.sums, m.order, m.ends
    whole, part = 0.0, 0.0
    for i in range(m.dim):
        part += sums[row, order[i]]
        if ends[i]:
            whole += part
            part = 0.0
    return whole


@compiled
def project(m, width):
    """Set the Legendre coefficients of the first ``width`` columns of ``stages``."""
    legendre, projection, stages = m.legendre, m.projection, m.stages
    for j in range(m.s):
        for d in range(width):
            legendre[j, d] = 0.0
        for i in range(m.k):
            weight = projection[j, i]
            for d in range(width):
                legendre[j, d] += weight * stages[i, d]


@compiled
def leave_rest(m, i):
    """Set ``rest`` to what the Legendre coefficients leave of stage i."""
    rest, basis, legendre, stages = m.rest, m.basis, m.legendre, m.stages
    width = m.width
    for d in range(width):
        rest[d] = 0.0
    for j in range(m.s):
        weight = basis[i, j]
        for d in range(width):
            rest[d] += weight * legendre[j, d]
    for d in range(width):
        rest[d] = stages[i, d] - rest[d]


@compiled
def set_right(m):
    """Set r."""
    sums, rest, weights, right = m.sums, m.rest, m.weights, m.right
    n, dim = m.invariants, m.dim
    for a in range(n):
        for d in range(dim):
            sums[a, d] = 0.0
    for i in range(m.k):
        leave_rest(m, i)
        for a in range(n):
            first = dim * (1 + a)
            for d in range(dim):
                sums[a, d] -= weights[i] * (rest[d] * rest[first + d])
    for a in range(n):
        right[a] = total(m, a)


@compiled
def set_gram(m):
    """Set the matrix of the equations for alpha, its lower half."""
    sums, legendre, metric, gram = m.sums, m.legendre, m.metric, m.gram
    dim = m.dim
    for a in range(m.invariants):
        for b in range(a + 1):
            first, second = dim * (1 + a), dim * (1 + b)
            for d in range(dim):
                sums[0, d] = 0.0
            for j in range(m.s):
                for d in range(dim):
                    sums[0, d] += legendre[j, first + d] * legendre[j, second + d]
            for d in range(dim):
                sums[0, d] *= metric[d]
            gram[a, b] = total(m, 0)


@compiled
def solve_gram(m, right, threshold):
    """Replace ``right`` by the solution, by LDL' in the order of the invariants, without small pivots."""
    gram, lower, pivots, active = m.gram, m.lower, m.pivots, m.active
    n = m.invariants
    for a in range(n):
        pivot = gram[a, a]
        for b in range(a):
            value = gram[a, b]
            for c in range(b):
                value -= lower[a, c] * lower[b, c] * pivots[c]
            lower[a, b] = value / pivots[b] if pivots[b] > 0.0 else 0.0
            pivot -= lower[a, b] * lower[a, b] * pivots[b]
        pivots[a] = pivot if active[a] and pivot > threshold * gram[a, a] else 0.0
        for b in range(a):
            right[a] -= lower[a, b] * right[b]
        if pivots[a] == 0.0:
            right[a] = 0.0
    for a in range(n):
        right[a] = right[a] / pivots[a] if pivots[a] > 0.0 else 0.0
    for a in range(n - 1, -1, -1):
        for b in range(a + 1, n):
            if pivots[a] > 0.0:
                right[a] -= lower[b, a] * right[b]


@compiled
def keep_invariants(m, h):
    """Set ``new`` to the coefficients of sigma', from ``stages``."""
    new, legendre, alpha, right, missing = m.new, m.legendre, m.alpha, m.right, m.missing
    project(m, m.width)
    set_gram(m)
    set_right(m)
    for a in range(m.invariants):
        alpha[a] = missing[a] / h
    solve_gram(m, alpha, REGULAR)
    solve_gram(m, right, DEPENDENT)
    for a in range(m.invariants):
        alpha[a] += right[a]
    for j in range(m.s):
        for d in range(m.dim):
            new[j, d] = legendre[j, d] - correction(m, j, d)


@compiled
def correction(m, j, d):
    """Return component d of W sum_i phi_ij alpha_i."""
    legendre, alpha, dim = m.legendre, m.alpha, m.dim
    value = 0.0
    for a in range(m.invariants):
        value += legendre[j, dim * (1 + a) + d] * alpha[a]
    return m.metric[d] * value


@compiled
def measure_gap(m):
    """Set ``missing`` to what the step is to take back: a part of what rounding cost the invariants so far.

    What is more than rounding was lost by the quadrature (k too small); it is
    counted and stays lost: the invariants are then kept at what they are now.
    Uses the first of ``stages``, here at the state, and the invariants' values in ``right``.
    """
    stages, sums, right, reference, missing, active = (
        m.stages,
        m.sums,
        m.right,
        m.reference,
        m.missing,
        m.active,
    )
    y, e, previous, length, dim = m.y, m.e, m.previous, m.length, m.dim
    for a in range(m.invariants):
        gap = right[a] - reference[a]
        scale = abs(right[a]) + abs(reference[a])
        for d in range(dim):
            moved = 0.0
            for j in range(m.s):
                moved = max(moved, abs(length * previous[j, d]))
            scale += abs(stages[0, dim * (1 + a) + d]) * (abs(y[d]) + moved)
            sums[0, d] = stages[0, dim * (1 + a) + d] * e[d]
        gap += total(m, 0)
        if not active[a]:
            gap = 0.0
        elif not abs(gap) <= ROUNDING * scale:
            reference[a] = right[a]
            gap = 0.0
            m.lost += 1
        missing[a] = GAIN * gap


@compiled
def find_change(m, threshold):
    """Return the first invariant that is none, or -1.

    Its gradient along the field, summed over the stages, is compared with the sum
    of the absolute values of the terms; their ratio is left in DEFECT.
    """
    sums, weights, stages = m.sums, m.weights, m.stages
    dim = m.dim
    for a in range(m.invariants):
        first = dim * (1 + a)
        for d in range(dim):
            sums[0, d] = 0.0
            sums[1, d] = 0.0
        for i in range(m.k):
            for d in range(dim):
                term = weights[i] * (stages[i, d] * stages[i, first + d])
                sums[0, d] += term
                sums[1, d] += abs(term)
        slope = abs(total(m, 0))
        terms = total(m, 1)
        if not slope <= threshold * terms:  # a gradient that is not finite is no good either
            m.defect = slope / terms
            return a
    return -1
