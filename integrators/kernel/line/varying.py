"""Steps whose length follows the estimated local error."""

from math import log

from integrators.kernel.context import BUDGET, DONE, LAND, NOT_FINITE, UNDERFLOW
from integrators.kernel.line.memory import NOT_KEPT
from integrators.kernel.line.sample import sample
from integrators.kernel.line.solve import commit, end, slope, solve
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.lanes import two_sum
from integrators.kernel.step.control import (
    APPROACH,
    CLOSE,
    INFINITY,
    NOTHING,
    RETREAT,
    SAFETY,
    SHORTEST,
    TINY,
    bounded,
    log_factor,
)

GROW = 4.0  # of the length from one step to the next, at most
# Iterations to aim at, at most: with a contraction h w, a unit of time costs least at h w = 1/e, which
# takes 36 to 1e-16.
BUSY = 36.0


@compiled
def error(m, h):
    """Return the estimated local error of the solved step, relative to the blocks' sizes.

    gamma_s, the first Legendre coefficient of the field that the polynomial leaves
    out, is of size h^s: h |gamma_s|^2 / max_j |rho_j| has the order 2s + 1 of the
    local error, and its units.
    """
    projection, stages, rho, y, block, group = m.projection, m.stages, m.rho, m.y, m.block, m.group
    size, change, largest, slope = m.size, m.moved, m.largest, m.slope
    for b in range(m.blocks):
        size[b], change[b], largest[b], slope[b] = 0.0, 0.0, 0.0, 0.0
    for d in range(m.dim):
        missing, top = 0.0, 0.0
        for i in range(m.k):
            missing += projection[m.s, i] * stages[i, d]
        for j in range(m.s):
            top = max(top, abs(rho[j, d]))
        b = block[d]
        change[b] = max(change[b], abs(missing))
        slope[b] = max(slope[b], top)
        size[b] = max(size[b], abs(y[d]) + abs(h) * top)
    for b in range(m.blocks):
        largest[group[b]] = max(largest[group[b]], size[b])
    worst = 0.0
    for b in range(m.blocks):
        if change[b] > 0.0:
            scale = max(size[b], NOTHING * largest[group[b]])
            worst = max(worst, abs(h) * change[b] * (change[b] / slope[b]) / scale)
    return worst


@compiled
def first_length(m):
    """Return a first step from the field at the first of `Trajectory.stages`: short, the following grow."""
    size, change, y, block = m.size, m.moved, m.y, m.block
    for b in range(m.blocks):
        size[b], change[b] = 0.0, 0.0
    for d in range(m.dim):
        b = block[d]
        size[b] = max(size[b], abs(y[d]))
        change[b] = max(change[b], abs(slope(m, d)))
    rate = 0.0
    for b in range(m.blocks):
        if size[b] > 0.0:
            rate = max(rate, change[b] / size[b])
    length = m.tolerance ** (1.0 / (2.0 * m.s + 1.0))
    return length / rate if 0.0 < rate < float("inf") else length


@compiled
def ready(m):
    """Solve the step ahead with a length that the tolerance allows; `Trajectory.h` is its length."""
    if m.solved:
        return DONE
    t = m.t0 + m.time_low
    grow, failure = GROW, UNDERFLOW
    power = 1.0 / (2.0 * m.s + 1.0)
    while True:
        h = m.next_length
        if not abs(h) > SHORTEST * abs(t):
            return failure
        before = m.iterations
        outcome = solve(m, t, h)
        if outcome == NOT_KEPT:
            return outcome
        if outcome == DONE and m.accepted:
            break
        estimate = error(m, h) if outcome == DONE else INFINITY
        factor = bounded(
            log_factor(
                power * log(m.tolerance),
                power * log(max(estimate, TINY)),
                power * log(m.error_behind) if m.error_behind > 0.0 else INFINITY,
                log(abs(h / m.length)) if m.error_behind > 0.0 else 0.0,
            ),
            grow,
        )
        if estimate <= m.tolerance:
            factor = min(factor, max(BUSY / (m.iterations - before), 0.5))
            m.length_limit *= APPROACH
            m.length_after = h * min(factor, m.length_limit / abs(h))
            m.error_ahead = estimate
            m.accepted = 1
            break
        if outcome != DONE:
            m.length_limit = RETREAT * abs(h)
        failure = NOT_FINITE if outcome == NOT_FINITE else UNDERFLOW
        m.next_length = h * min(factor, SAFETY)
        m.rejections += 1
        grow = 1.0
    m.h = h
    m.solved = 1
    return DONE


@compiled
def take(m):
    """Take the step ahead, which is solved."""
    h = m.h
    end(m, h)
    commit(m, h)
    t, low = two_sum(m.t0, h)
    m.t0, m.time_low = two_sum(t, low + m.time_low)
    m.next_length = m.length_after
    m.error_behind = m.error_ahead
    m.accepted = 0
    m.steps += 1


@compiled
def vary(m, between, count, times, made, out, budget):
    """Take steps to the samples' times; parts as in `sample`. Returns how it ended."""
    for i in range(made, count):
        m.made = i
        while True:
            rest = (times[i] - m.t0) - m.time_low
            if abs(rest) <= CLOSE * abs(times[i]):
                rest = 0.0
                break
            outcome = DONE if m.accepted else ready(m)
            if outcome != DONE:
                return outcome
            if abs(rest) < abs(m.h) - CLOSE * abs(times[i]):
                break
            if budget == 0:
                return BUDGET
            budget -= 1
            outcome = ready(m)  # again, if a partial step has taken its place
            if outcome != DONE:
                return outcome
            take(m)
        t = m.t0 + m.time_low
        outcome = sample(m, between, t, m.h, rest, out + m.dim * i)
        if outcome != DONE:
            return outcome
        if between == LAND and rest != 0.0:
            m.t0, m.time_low = times[i], 0.0
            m.accepted = 0
    m.made = count
    return DONE


@compiled
def walk(m, times, out, budget):
    """Take ``budget`` steps at most, none beyond times[0], and note their times and states."""
    end_time = times[0]
    for i in range(budget):
        m.made = i
        outcome = ready(m)
        if outcome != DONE:
            return outcome
        rest = (end_time - m.t0) - m.time_low
        if abs(rest) < abs(m.h) - CLOSE * abs(end_time):
            return DONE
        take(m)
        times[i] = m.t0
        for d in range(m.dim):
            out[m.dim * i + d] = m.y[d]
    m.made = budget
    return BUDGET
