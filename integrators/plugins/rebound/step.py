"""A step of HBVM(k, s) as REBOUND calls it, compiled; imported only where it has to be compiled.

The forces are REBOUND's own, ``reb_simulation_update_acceleration``: gravity of any
kind but a tree's, softening, test particles, variational particles, additional forces.
The equations are those of the second-order form,

    Q_l = q + h c_l v + h^2 sum_m A2_lm a(t + c_l h, Q_m),    A2 = (I X_s) P' Omega,

and velocities ``V_l = v + h sum_m A_lm a_m`` where forces depend on them. Nodes and
weights come as hi + lo pairs, displacements are formed before the position is
added, and positions and velocities carry along what their last addition rounded off.

The steps of the kernel cannot be used: REBOUND evaluates the forces of one stage at a time, at positions,
velocities and a time that lie in its particles, and may add or remove bodies between two steps. The order of
the error, the error that is estimated and what ends the iteration are the kernel's
(`integrators.kernel.tolerance`, `integrators.plugins.rule`). A step's length follows from its own error
alone: what was before may have been another simulation's.
"""

import numpy as np
from numba import types

from integrators.kernel import tolerance
from integrators.kernel.native import binary as native
from integrators.plugins.rebound import layout as at
from integrators.plugins.rebound.memory import (
    added,
    compiled,
    fma,
    free,
    gather,
    matrix,
    ready,
    reals,
    removed,
    scatter,
    small,
    words,
)  # fmt: skip
from integrators.plugins.rule import (
    CONVERGED,
    FARTHEST,
    FLOOR,
    MAX_ITERATIONS,
    MODES,
    STAGNATION,
    STAGNATION_LIMIT,
    is_rounding,
)

SECOND_ORDER = 30.0  # times the error allowed: of 20 steps a circle, each has one of 3e-3 of the velocity
SAFETY = 0.8  # of the length that would just meet the tolerance
SHORTER, HALF, LONGER = 0.1, 0.5, 2.0  # factors from one step to the next; where a step cannot be solved
TINY = 1e-300
HALF_UNIT = 2.3e-16  # what an addition rounds off is no more than half of this, relative

# Rows of the table of a method, shape (6 + 2 k + modes, k): six vectors, and after them the matrices of
# `for_positions`, `for_velocities` and `to_legendre`.
NODES, NODES_LOW, WEIGHTS, WEIGHTS_LOW, POSITION_WEIGHTS, POSITION_WEIGHTS_LOW = range(6)
VECTORS = 6

# Blocks of k rows of the working memory: displacements without forces, the positions at the stages, those of
# the iteration before, velocities at the stages. After them single rows: a sum, the positions and velocities.
BASE, NEW, OLD, FAST = range(4)
SUM, Q, V = range(3)

error_order, left_out = compiled(tolerance.error_order), compiled(tolerance.left_out)
ends_in_rounding = compiled(is_rounding)

# Functions of REBOUND, and one of ours, that compiled code calls.
_update = types.ExternalFunction("hbvm_rebound_update_acceleration", types.void(types.int64))
_growth = types.ExternalFunction("hbvm_rebound_megno_rate", types.float64(types.int64))
_add_growth = types.ExternalFunction(
    "hbvm_rebound_megno_update", types.void(types.int64, types.float64, types.float64)
)
_fail = types.ExternalFunction("hbvm_rebound_fail", types.void(types.int64, types.int64))


@compiled
def table_at(address, k):
    """Return the table of a method with k nodes."""
    return matrix(address, VECTORS + 2 * k + min(k, MODES), k)


@compiled
def for_positions(table):
    """Return A2, shape (k, k)."""
    k = table.shape[1]
    return table[VECTORS : VECTORS + k]


@compiled
def for_velocities(table):
    """Return A, shape (k, k)."""
    k = table.shape[1]
    return table[VECTORS + k : VECTORS + 2 * k]


@compiled
def to_legendre(table):
    """Return what gives Legendre coefficients from values at the nodes, shape (modes, k)."""
    return table[VECTORS + 2 * table.shape[1] :]


@compiled
def block(work, which, k):
    """Return k rows of the working memory, shape (k, n)."""
    return work[which * k : (which + 1) * k]


@compiled
def row(work, which, k):
    """Return a single row of the working memory, shape (n,)."""
    return work[4 * k + which]


@compiled
def copy(values, out):
    """Set out = values; numba's own copy of arrays, which asks whether they overlap, takes memory."""
    for i in range(values.shape[0]):
        for d in range(values.shape[1]):
            out[i, d] = values[i, d]


@compiled
def combine(table, row, forces, out):
    """Set out = sum_m table[row, m] forces[m]."""
    k, n = forces.shape
    for i in range(n):
        out[i] = table[row, 0] * forces[0, i]
    for m in range(1, k):
        weight = table[row, m]
        for i in range(n):
            out[i] = fma(weight, forces[m, i], out[i])


@compiled
def stages(table, h, q, base, forces, out, moved):
    """Set out[l] = q + (base[l] + h (h sum_m table[l, m] forces[m]))."""
    for i in range(forces.shape[0]):
        combine(table, i, forces, moved)
        for d in range(q.size):
            out[i, d] = q[d] + (base[i, d] + h * (h * moved[d]))


@compiled
def velocities(table, h, v, rest, forces, out):
    """Set out[l] = v + (rest + h sum_m table[l, m] forces[m])."""
    for i in range(forces.shape[0]):
        combine(table, i, forces, out[i])
        for d in range(v.size):
            out[i, d] = v[d] + (rest[d] + h * out[i, d])


@compiled
def extrapolate(ratio, nodes, to_legendre, forces, out, weights):
    """Set out[l] = the previous step's polynomial through ``forces`` at 1 + ratio c_l."""
    k = forces.shape[0]
    modes = to_legendre.shape[0]
    for i in range(k):
        x = 1.0 + 2.0 * ratio * nodes[i]  # 2c - 1 at c = 1 + ratio * c_i
        weights[:] = 0.0
        before, legendre = 0.0, 1.0
        for j in range(modes):
            for m in range(k):
                weights[0, m] += np.sqrt(2.0 * j + 1.0) * legendre * to_legendre[j, m]
            before, legendre = legendre, ((2 * j + 1) * x * legendre - j * before) / (j + 1)
        combine(weights, 0, forces, out[i])


@compiled
def change(old, new, count):
    """Largest change of a body over the stages, relative to its size, and to its floored size.

    The first ``count`` bodies are real. Variational ones may overflow, as with
    REBOUND's own integrators, and do not hold the others up then.
    """
    k, n = new.shape
    strict, floored = 0.0, 0.0
    for first, last in ((0, count), (count, n // 3)):
        largest = 0.0
        for i in range(k):
            for d in range(3 * first, 3 * last):
                largest = max(largest, abs(new[i, d]))
        for b in range(first, last):
            size, moved = 0.0, 0.0
            for i in range(k):
                for d in range(3 * b, 3 * b + 3):
                    size = max(size, abs(new[i, d]))
                    difference = abs(new[i, d] - old[i, d])
                    if difference < np.inf:
                        moved = max(moved, difference)
                    elif b < count:
                        return np.inf, np.inf
            if moved > 0.0:
                strict = max(strict, moved / size)
                floored = max(floored, moved / max(size, FLOOR * largest))
    return strict, floored


@compiled
def iterate(simulation, state, table, t, h, q, v, rest, forces, work):
    """Iterate until the stages are solved, the block NEW being first values; return whether they are."""
    k = forces.shape[0]
    number, clock = words(state, at.WORDS), reals(simulation, at.SIMULATION)
    base = block(work, BASE, k)
    new = block(work, NEW, k)
    old = block(work, OLD, k)
    fast = block(work, FAST, k)
    flags = small(simulation, 2 * at.SIMULATION)
    megno = flags[at.CALCULATE_MEGNO] != 0
    depends = megno or flags[at.VELOCITY_DEPENDENT] != 0
    bodies = words(simulation, at.SIMULATION)[at.COUNT]
    best, stalled = np.inf, 0
    for _ in range(MAX_ITERATIONS):
        if depends:
            velocities(for_velocities(table), h, v, rest[1], forces, fast)
        growth = 0.0
        for i in range(k):
            clock[at.TIME] = t + table[NODES, i] * h
            scatter(simulation, 0, new[i])
            if depends:
                scatter(simulation, 3, fast[i])
            _update(simulation)
            gather(simulation, 6, forces[i])
            if megno:
                since = clock[at.TIME] - clock[at.MEGNO_START]
                growth += 2.0 * table[WEIGHTS, i] * since * _growth(simulation)
        reals(state, at.WORDS)[at.MEGNO] = h * growth
        number[at.ITERATIONS] += 1
        number[at.EVALUATIONS] += k
        copy(new, old)
        stages(for_positions(table), h, q, base, forces, new, row(work, SUM, k))
        strict, floored = change(old, new, bodies)
        if not strict < np.inf:
            return False
        if strict <= CONVERGED:
            return True
        if strict < best:
            best, stalled = strict, 0
        else:
            stalled += 1
            if ends_in_rounding(floored, stalled >= STAGNATION_LIMIT, STAGNATION):
                return True
    return False


@compiled
def solve(simulation, state, table, t, h, q, v, rest, forces, work, weights):
    """Solve the stage equations: from the previous step's polynomial, and if that fails without it."""
    k = forces.shape[0]
    base, new, old = block(work, BASE, k), block(work, NEW, k), block(work, OLD, k)
    for i in range(k):
        for d in range(q.size):
            drift = h * v[d]
            low = fma(h, v[d], -drift) + h * rest[1, d]
            least = fma(table[NODES_LOW, i], drift, rest[0, d])
            base[i, d] = fma(table[NODES, i], drift, fma(table[NODES, i], low, least))
    length = reals(state, at.WORDS)[at.LENGTH]
    if length != 0.0 and 0.0 < h / length <= FARTHEST:
        copy(forces, old)
        extrapolate(h / length, table[NODES], to_legendre(table), old, forces, weights)
        stages(for_positions(table), h, q, base, forces, new, row(work, SUM, k))
        if iterate(simulation, state, table, t, h, q, v, rest, forces, work):
            return True
    forces[:] = 0.0
    for i in range(k):
        for d in range(q.size):
            new[i, d] = q[d] + base[i, d]
    return iterate(simulation, state, table, t, h, q, v, rest, forces, work)


@compiled
def local_error(h, v, s, projection, forces, means, lasts, count):
    """Return the largest estimate of a real body's error in velocity by this step, relative to velocities.

    For a body, ``h |gamma_s|^2 / max(|gamma_0|, |gamma_s|)``, which is of the order of the local error.
    The k nodes do not show gamma_s where k = s (and the tables not beyond `MODES`): the
    last coefficient that they show, gamma_j, then goes on falling as it fell on average from the first
    one. One node shows nothing. It is measured by the largest velocity of a body relative to the first one.
    """
    known = min(s, projection.shape[0] - 1)
    if known == 0:
        return 0.0
    combine(projection, 0, forces, means)
    combine(projection, known, forces, lasts)
    worst, size, fall = 0.0, 0.0, 1.0
    for b in range(count):
        mean, square, before, after = 0.0, 0.0, 0.0, 0.0
        for d in range(3):
            i = 3 * b + d
            mean += means[i] * means[i]
            square += lasts[i] * lasts[i]
            apart, pulled = v[i] - v[d], means[i] - means[d]  # gamma_0 is the mean acceleration
            before += apart * apart
            after += (apart + h * pulled) * (apart + h * pulled)
        size = max(size, before, after, h * h * mean)
        largest = max(mean, square)
        if square > 0.0 and left_out(square, square, largest) > worst:  # of squares
            worst = left_out(square, square, largest)
            fall = np.sqrt(square / largest)
    if worst == 0.0:
        return 0.0
    beyond = 1.0 if known == s else fall ** (2.0 * (s - known) / known)
    return abs(h) * np.sqrt(worst / size) * beyond


@compiled
def update(table, h, q, v, rest, forces):
    """Add the step to positions, velocities and what they lack."""
    for d in range(q.size):
        kick, shift = 0.0, 0.0
        for m in range(forces.shape[0]):
            a = forces[m, d]
            kick += fma(table[WEIGHTS, m], a, table[WEIGHTS_LOW, m] * a)
            shift += fma(table[POSITION_WEIGHTS, m], a, table[POSITION_WEIGHTS_LOW, m] * a)
        drift = h * v[d]
        low = fma(h, v[d], -drift) + h * rest[1, d]
        # q + drift exactly, then all that is smaller.
        near = q[d] + drift
        part = near - q[d]
        lost = (q[d] - (near - part)) + (drift - part)
        rest_of_it = h * (h * shift) + (low + rest[0, d]) + lost
        q[d] = near + rest_of_it
        part = q[d] - near
        rest[0, d] = (near - (q[d] - part)) + (rest_of_it - part)
        gain = h * kick + rest[1, d]
        total = v[d] + gain
        part = total - v[d]
        rest[1, d] = (v[d] - (total - part)) + (gain - part)
        v[d] = total


@compiled
def step(simulation, state):
    """Take one step of length dt, or with a tolerance one as long as its estimated error allows."""
    number, clock = words(state, at.WORDS), reals(simulation, at.SIMULATION)
    k = number[at.K]
    n = 3 * (words(simulation, at.SIMULATION)[at.COUNT] + words(simulation, at.SIMULATION)[at.VARIATIONS])
    flags = small(simulation, 2 * at.SIMULATION)
    if flags[at.GRAVITY] == at.TREE:
        _fail(simulation, at.ROUGH)
        return
    if ready(state, n) == 0:
        _fail(simulation, at.UNKNOWN_METHOD)
        return
    flags[at.IGNORED_TERMS] = 0
    table = table_at(number[at.TABLES], k)
    rest, forces = matrix(number[at.REST], 2, n), matrix(number[at.FORCES], k, n)
    work = matrix(number[at.WORK], 4 * k + 4, n)
    weights = matrix(number[at.WORK] + 8 * (4 * k + 4) * n, 1, k)
    q, v = row(work, Q, k), row(work, V, k)
    gather(simulation, 0, q)
    gather(simulation, 3, v)
    for d in range(n):
        # Somebody may have moved or rescaled the particle since.
        if abs(rest[0, d]) > HALF_UNIT * abs(q[d]):
            rest[0, d] = 0.0
        if abs(rest[1, d]) > HALF_UNIT * abs(v[d]):
            rest[1, d] = 0.0
    t, h = clock[at.TIME], clock[at.DT]
    bodies, tol = words(simulation, at.SIMULATION)[at.COUNT], reals(state, at.WORDS)[at.TOL]
    varies = 0.0 < tol < np.inf
    most = tol if varies else reals(state, at.WORDS)[at.LARGEST_ERROR]
    if number[at.S] == 1 and not varies:
        most *= SECOND_ORDER
    while True:
        problem, factor = at.DIVERGED, HALF
        solved = solve(simulation, state, table, t, h, q, v, rest, forces, work, weights)
        if solved and most < np.inf:
            means, lasts = work[0], work[1]  # the displacements have been used
            error = local_error(h, v, number[at.S], to_legendre(table), forces, means, lasts, bodies)
            problem, solved = at.UNRESOLVED, error <= most
            wanted = SAFETY * (most / max(error, TINY)) ** (1.0 / error_order(number[at.S]))
            factor = min(LONGER, max(SHORTER, wanted))
        if solved or not varies or t + factor * h == t:
            break
        h *= factor
        reals(state, at.WORDS)[at.LENGTH] = 0.0  # the forces are those of this attempt
    if solved:
        update(table, h, q, v, rest, forces)
    scatter(simulation, 0, q)
    scatter(simulation, 3, v)
    if solved:
        clock[at.TIME], clock[at.DONE] = t + h, h
        if varies:
            clock[at.DT] = factor * h
        reals(state, at.WORDS)[at.LENGTH] = h
        if flags[at.CALCULATE_MEGNO] != 0:
            _add_growth(simulation, reals(state, at.WORDS)[at.MEGNO], h)
    else:
        clock[at.TIME] = t
        reals(state, at.WORDS)[at.LENGTH] = 0.0
        _fail(simulation, problem)


def build(callback: str) -> bytes:
    """Compile one of the functions that REBOUND calls: step, free, added, removed."""
    function, arguments = {
        "step": (step, 2),
        "free": (free, 1),
        "added": (added, 1),
        "removed": (removed, 2),
    }[callback]
    return native.build(function, [(types.int64, "i64")] * arguments)
