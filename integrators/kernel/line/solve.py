"""One step: its coefficients by fixed-point iteration, and the state at its end."""

from integrators.kernel.context import BUDGET, DIVERGED, DONE, NOT_FINITE
from integrators.kernel.line.invariants import correction, find_change, keep_invariants, measure_gap, project
from integrators.kernel.line.memory import INVARIANTS, NOT_KEPT, POISSON
from integrators.kernel.native.attributes import address
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.lanes import fma, two_sum
from integrators.kernel.simd.memory import call_field
from integrators.kernel.step.begin import FARTHEST, INFINITY
from integrators.kernel.step.iterate import MAX_ITERATIONS
from integrators.kernel.step.size import FLOOR, STAGNATION

CONVERGED = 1e-16
HOPELESS = 1e6  # a change this much larger than the smallest so far will not come back
PATIENCE, SLOWNESS = 2, 16  # stagnation is 2 + (iterations so far)/16 without a new smallest change
MODES = 12  # P_j(2) grows like 5.8^j: beyond, extrapolation amplifies rounding more than it helps
KEPT = 1e-8  # an invariant that changes faster, relative to the terms of its change, is none


@compiled
def evaluate_at(m, t, y, place):
    """Evaluate the field and what goes with it at one state, as stage number ``place``."""
    m.time[0] = t
    call_field(m.field, m.time, address(y), m.par, address(m.stages) + place * m.row)
    m.evaluations += 1


@compiled
def evaluate(m, t, h):
    """Evaluate at Y_l = y + (e + h sum_j rho_j int_0^{c_l} P_j), l = 0 .. k-1.

    The nodes' low part enters first, before anything is rounded at the size of the state.
    """
    stage, rho, integrals, nodes, nodes_low = m.stage, m.rho, m.integrals, m.nodes, m.nodes_low
    y, e, dim = m.y, m.e, m.dim
    for i in range(m.k):
        for d in range(dim):
            stage[d] = nodes_low[i] * rho[0, d]
        for j in range(m.s):
            weight = integrals[i, j]
            for d in range(dim):
                stage[d] += weight * rho[j, d]
        for d in range(dim):
            stage[d] = y[d] + (e[d] + h * stage[d])
        evaluate_at(m, t + nodes[i] * h, stage, i)


@compiled
def slope(m, d):
    """Return component d of the field at the first of ``stages``."""
    stages, dim = m.stages, m.dim
    if m.mode == INVARIANTS:
        return stages[0, d]
    value = 0.0
    for b in range(dim):
        value += stages[0, dim * (1 + d) + b] * stages[0, b]
    return value


@compiled
def keep_poisson_energy(m):
    """Set ``new`` to P'Omega [B(Y_l) sum_i P_i(c_l) G_i] with the Legendre coefficients G of grad H.

    The values B(Y_l) ... take the place of grad H in ``stages``.
    """
    stages, stage, basis, legendre, new = m.stages, m.stage, m.basis, m.legendre, m.new
    dim = m.dim
    project(m, dim)
    for i in range(m.k):
        for d in range(dim):
            stage[d] = 0.0
        for j in range(m.s):
            weight = basis[i, j]
            for d in range(dim):
                stage[d] += weight * legendre[j, d]
        for d in range(dim):
            value = 0.0
            for b in range(dim):
                value += stages[i, dim * (1 + d) + b] * stage[b]
            stages[i, d] = value
    project(m, dim)
    for j in range(m.s):
        for d in range(dim):
            new[j, d] = legendre[j, d]


@compiled
def predict(m, ratio):
    """Extrapolate the last step's polynomial to 1 + ratio c and project it."""
    stages, nodes, previous, legendre, rho = m.stages, m.nodes, m.previous, m.legendre, m.rho
    dim = m.dim
    for i in range(m.k):
        x = 1.0 + 2.0 * ratio * nodes[i]  # 2c - 1 at c = 1 + ratio * c_i
        before, polynomial = 0.0, 1.0
        for d in range(dim):
            stages[i, d] = 0.0
        for j in range(min(m.s, MODES)):
            weight = (2.0 * j + 1.0) ** 0.5 * polynomial
            for d in range(dim):
                stages[i, d] += weight * previous[j, d]
            before, polynomial = polynomial, ((2 * j + 1) * x * polynomial - j * before) / (j + 1)
    project(m, dim)
    for j in range(m.s):
        for d in range(dim):
            rho[j, d] = legendre[j, d]


@compiled
def renew(m, h):
    """Make ``new`` the coefficients; return the largest change of h rho over the blocks.

    Relative to the size of the block, and to this size or a fraction of the largest in its group.
    """
    new, rho, y, block, group = m.new, m.rho, m.y, m.block, m.group
    size, change, largest = m.size, m.moved, m.largest
    for b in range(m.blocks):
        size[b], change[b], largest[b] = 0.0, 0.0, 0.0
    finite = True
    for d in range(m.dim):
        top, moved = 0.0, 0.0
        for j in range(m.s):
            difference = abs(h * (new[j, d] - rho[j, d]))
            finite = finite and difference < INFINITY
            moved = max(moved, difference)
            top = max(top, abs(h * new[j, d]))
            rho[j, d] = new[j, d]
        b = block[d]
        size[b] = max(size[b], abs(y[d]) + top)
        change[b] = max(change[b], moved)
    if not finite:
        return INFINITY, INFINITY
    for b in range(m.blocks):
        largest[group[b]] = max(largest[group[b]], size[b])
    strict, floored = 0.0, 0.0
    for b in range(m.blocks):
        if change[b] > 0.0:
            strict = max(strict, change[b] / size[b])
            floored = max(floored, change[b] / max(size[b], FLOOR * largest[group[b]]))
    return strict, floored


@compiled
def iterate(m, t, h):
    """Iterate from the given coefficients until they are a solution; return how it ended."""
    best, last, stalled = INFINITY, 0.0, 0
    for iteration in range(MAX_ITERATIONS):
        evaluate(m, t, h)
        if m.mode == POISSON:
            keep_poisson_energy(m)
        else:
            keep_invariants(m, h)
        m.iterations += 1
        strict, floored = renew(m, h)
        m.last = strict
        if not strict < INFINITY:
            # Growing changes overflow in the end; a NaN out of the blue is the field's own.
            return DIVERGED if last > 1.0 else NOT_FINITE
        if floored > HOPELESS * best:
            return DIVERGED
        last = strict
        if strict <= CONVERGED:
            return DONE
        if floored < best:
            best, stalled = floored, 0
        else:
            stalled += 1
        if stalled >= PATIENCE + iteration // SLOWNESS and best < STAGNATION:
            return DONE
    return DIVERGED


@compiled
def solve(m, t, h):
    """Find the coefficients of the step of length h from the state at t; return how it ended."""
    rho, dim = m.rho, m.dim
    evaluate_at(m, t, m.y, 0)
    for d in range(dim):
        if not abs(slope(m, d)) < INFINITY:
            return NOT_FINITE
    if m.mode == INVARIANTS:
        call_field(m.values, m.time, address(m.y), m.par, address(m.right))
        measure_gap(m)
    length = m.length
    extrapolated = length != 0.0 and abs(h / length) <= FARTHEST
    outcome = BUDGET
    while outcome != DONE:
        if extrapolated:
            predict(m, h / length)
        else:
            for j in range(m.s):
                for d in range(dim):
                    rho[j, d] = slope(m, d) if j == 0 else 0.0
        outcome = iterate(m, t, h)
        if outcome != DONE:
            if not extrapolated:
                return outcome
            extrapolated = False
            m.restarts += 1
            evaluate_at(m, t, m.y, 0)
    if m.mode == INVARIANTS:
        culprit = find_change(m, KEPT)
        if culprit >= 0:
            m.culprit = culprit
            return NOT_KEPT
    return DONE


@compiled
def end(m, h):
    """Set ``next_y``, ``next_e`` to the end of the solved step, y + h rho_0, rounded once.

    The mean of the field over the stages is summed up with the rounding errors of
    its terms, and its weights with their low parts.
    """
    stages, weights, weights_low = m.stages, m.weights, m.weights_low
    y, e, next_y, next_e = m.y, m.e, m.next_y, m.next_e
    for d in range(m.dim):
        mean, low = 0.0, 0.0
        for i in range(m.k):
            value = stages[i, d]
            term = weights[i] * value
            mean, lost = two_sum(mean, term)
            low += lost + fma(weights[i], value, -term) + weights_low[i] * value
        if m.mode == INVARIANTS:
            mean, lost = two_sum(mean, -correction(m, 0, d))
            low += lost
        term = h * mean
        whole, lost = two_sum(y[d], term)
        small = lost + (fma(h, mean, -term) + h * low + e[d])
        next_y[d], next_e[d] = two_sum(whole, small)


@compiled
def commit(m, h):
    """Make the end of the solved step the state."""
    y, e, next_y, next_e, previous, rho = m.y, m.e, m.next_y, m.next_e, m.previous, m.rho
    for d in range(m.dim):
        y[d] = next_y[d]
        e[d] = next_e[d]
        for j in range(m.s):
            previous[j, d] = rho[j, d]
    m.length = h
    m.solved = 0


@compiled
def interpolate(m, h, c, out):
    """Set out = y + h sum_j rho_j int_0^c P_j, the polynomial inside the solved step."""
    rho, y, e, dim = m.rho, m.y, m.e, m.dim
    for d in range(dim):
        out[d] = 0.0
    x = 2.0 * c - 1.0
    before, polynomial = 1.0, 1.0  # L_{-1} = 1 makes int_0^c L_0 = (L_1 - L_{-1}) / 2 + 1 come out
    for j in range(m.s):
        after = ((2 * j + 1) * x * polynomial - j * before) / (j + 1)
        weight = c if j == 0 else (after - before) / (2.0 * (2.0 * j + 1.0) ** 0.5)
        for d in range(dim):
            out[d] += weight * rho[j, d]
        before, polynomial = polynomial, after
    for d in range(dim):
        out[d] = y[d] + (e[d] + h * out[d])
