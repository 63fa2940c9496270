"""Steps whose length follows the estimated local error."""

from math import log

from integrators.kernel.line import layout as at
from integrators.kernel.line.sample import sample
from integrators.kernel.line.solve import commit, end, slope, solve
from integrators.kernel.line.views import compiled, two_sum
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
    size, change, largest, slope = m.size, m.change, m.largest, m.slope
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
    """Return a first step from the field at the first of `Memory.stages`: short, the following grow."""
    size, change, y, block = m.size, m.change, m.y, m.block
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
    length = m.real[at.TOLERANCE] ** (1.0 / (2.0 * m.s + 1.0))
    return length / rate if 0.0 < rate < float("inf") else length


@compiled
def ready(m):
    """Solve the step ahead with a length that the tolerance allows; H is its length."""
    real, count = m.real, m.count
    if count[at.SOLVED]:
        return at.DONE
    t = real[at.T0] + real[at.LOW]
    grow, failure = GROW, at.UNDERFLOW
    power = 1.0 / (2.0 * m.s + 1.0)
    while True:
        h = real[at.NEXT]
        if not abs(h) > SHORTEST * abs(t):
            return failure
        before = count[at.ITERATIONS]
        outcome = solve(m, t, h)
        if outcome == at.NOT_KEPT:
            return outcome
        if outcome == at.DONE and count[at.ACCEPTED]:
            break
        estimate = error(m, h) if outcome == at.DONE else INFINITY
        factor = bounded(
            log_factor(
                power * log(real[at.TOLERANCE]),
                power * log(max(estimate, TINY)),
                power * log(real[at.BEHIND]) if real[at.BEHIND] > 0.0 else INFINITY,
                log(abs(h / real[at.LENGTH])) if real[at.BEHIND] > 0.0 else 0.0,
            ),
            grow,
        )
        if estimate <= real[at.TOLERANCE]:
            factor = min(factor, max(BUSY / (count[at.ITERATIONS] - before), 0.5))
            real[at.LIMIT] *= APPROACH
            real[at.AFTER] = h * min(factor, real[at.LIMIT] / abs(h))
            real[at.AHEAD] = estimate
            count[at.ACCEPTED] = 1
            break
        if outcome != at.DONE:
            real[at.LIMIT] = RETREAT * abs(h)
        failure = at.NOT_FINITE if outcome == at.NOT_FINITE else at.UNDERFLOW
        real[at.NEXT] = h * min(factor, SAFETY)
        count[at.REJECTIONS] += 1
        grow = 1.0
    real[at.H] = h
    count[at.SOLVED] = 1
    return at.DONE


@compiled
def take(m):
    """Take the step ahead, which is solved."""
    h = m.real[at.H]
    end(m, h)
    commit(m, h)
    t, low = two_sum(m.real[at.T0], h)
    m.real[at.T0], m.real[at.LOW] = two_sum(t, low + m.real[at.LOW])
    m.real[at.NEXT] = m.real[at.AFTER]
    m.real[at.BEHIND] = m.real[at.AHEAD]
    m.count[at.ACCEPTED] = 0
    m.count[at.STEPS] += 1


@compiled
def vary(m, between, times, made, out, budget):
    """Take steps to the samples' times; parts as in `sample`. Returns how it ended."""
    real, count = m.real, m.count
    for i in range(made, times.size):
        count[at.MADE] = i
        while True:
            rest = (times[i] - real[at.T0]) - real[at.LOW]
            if abs(rest) <= CLOSE * abs(times[i]):
                rest = 0.0
                break
            outcome = at.DONE if count[at.ACCEPTED] else ready(m)
            if outcome != at.DONE:
                return outcome
            if abs(rest) < abs(real[at.H]) - CLOSE * abs(times[i]):
                break
            if budget == 0:
                return at.BUDGET
            budget -= 1
            outcome = ready(m)  # again, if a partial step has taken its place
            if outcome != at.DONE:
                return outcome
            take(m)
        t = real[at.T0] + real[at.LOW]
        outcome = sample(m, between, t, real[at.H], rest, out[i])
        if outcome != at.DONE:
            return outcome
        if between == at.LAND and rest != 0.0:
            real[at.T0], real[at.LOW] = times[i], 0.0
            count[at.ACCEPTED] = 0
    count[at.MADE] = times.size
    return at.DONE


@compiled
def walk(m, times, out, end_time, budget):
    """Take ``budget`` steps at most, none beyond ``end_time``, and note their times and states."""
    for i in range(budget):
        m.count[at.MADE] = i
        outcome = ready(m)
        if outcome != at.DONE:
            return outcome
        rest = (end_time - m.real[at.T0]) - m.real[at.LOW]
        if abs(rest) < abs(m.real[at.H]) - CLOSE * abs(end_time):
            return at.DONE
        take(m)
        times[i] = m.real[at.T0]
        for d in range(m.y.size):
            out[i, d] = m.y[d]
    m.count[at.MADE] = budget
    return at.BUDGET
