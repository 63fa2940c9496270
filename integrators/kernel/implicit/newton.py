"""A step by an implicit solver: which start, which Jacobian, when to stop, when to give up."""

from integrators.kernel import layout as at
from integrators.kernel.implicit import layout as of
from integrators.kernel.implicit.corrections import EACH, KEPT, correct
from integrators.kernel.implicit.jacobian import contraction, linearize
from integrators.kernel.implicit.stages import (
    FLOORED,
    STRICT,
    changes,
    project,
    set_factor,
    set_stages,
    set_values,
    set_velocities,
    take_sizes,
)  # fmt: skip
from integrators.kernel.line.views import compiled
from integrators.kernel.simd.memory import get_float, get_int, put_float, put_int
from integrators.kernel.step.begin import FARTHEST, prepare, start_elsewhere

MOST_CORRECTIONS = 40
MOST_BLENDED = 250
STAGNATION = 1e-13  # above it, a change that stops decreasing is a failure
ROUNDING = 1e-15  # below it, the first change that does not decrease ends the iteration
PATIENCE = 2  # changes that do not decrease, to end it between ROUNDING and STAGNATION ...
FALLING = 0.5  # ... unless the changes of all but the smallest components still decrease so fast
FORESEEN = 0.1  # a change that is going to be this part of the tolerance need not be seen
FORGET = 0.7  # of the rate of contraction, from one step to the next
SLOW = 0.2  # a Jacobian whose corrections contract no better is replaced at the next step
HOPELESS = 4  # corrections that do not decrease, or grow, to give up
OLDEST = 64  # steps for which a Jacobian is used, so that the contraction is known anew
# Contraction of the fixed-point iteration at which that is to be tried again: with steps of one length, and
# with varying ones, which it may shorten a little.
GENTLE, GENTLE_VARYING = 0.25, 0.5
CALM = 1e-3  # sizes are measured until changes are this small
SCATTERED = 0.5  # last coefficient of a step's polynomial relative to the first, after a rescue
INFINITY = float("inf")


@compiled
def iterate(ctx, m, method, source, factors, which):
    """Correct gamma, by the Jacobian that ``which`` tells, until the stages do not change.

    What ends the iteration is the change of the stages, relative to their blocks, as
    in `integrators.kernel.step.iterate`. Return DONE, DIVERGED, or NOT_FINITE if the start is
    one at which the field or its Jacobian is not finite.
    """
    most = MOST_BLENDED if method == of.BLENDED else MOST_CORRECTIONS
    tolerance = get_float(ctx, at.TOLERANCE)
    best, rough, worst = INFINITY, INFINITY, 0.0
    rate = m.real[of.RATE] if method == of.NEWTON and which == KEPT else 1.0
    stalled, hopeless = 0, 0
    for tried in range(most + 1):
        if tried:
            outcome = correct(ctx, m, method, source, factors, which)
            if outcome != at.DONE:
                return outcome if tried == 1 else at.DIVERGED
        set_stages(ctx, m)
        if rough > CALM:
            take_sizes(ctx, m)
        if tried == 0:
            continue
        strict, before = changes(ctx, m, STRICT), rough
        rough = changes(ctx, m, FLOORED)
        m.real[of.CHANGE] = rough
        if not rough < INFINITY:
            return at.DIVERGED
        if before < CALM and rough > STAGNATION:
            worst = max(worst, rough / before)
        if strict <= tolerance or strict * max(worst, rate) < FORESEEN * tolerance:
            break
        stalled = 0 if strict < best else stalled + 1
        best = min(best, strict)
        if stalled and rough < (ROUNDING if stalled < PATIENCE or rough < FALLING * before else STAGNATION):
            break
        hopeless = 0 if rough < before else hopeless + 1
        if hopeless == PATIENCE and rough < STAGNATION:
            break
        if hopeless == HOPELESS:
            return at.DIVERGED
    else:
        return at.DIVERGED
    if worst > 0.0:
        m.real[of.RATE] = worst if rate == 1.0 else max(worst, FORGET * rate)
    if worst > SLOW and method == of.NEWTON:
        m.count[of.STALE] = 1
    return at.DONE


@compiled
def nearer(ctx, m):
    """Whether the extrapolated coefficients were nearer to the solution than constant stages."""
    far, still = 0.0, 0.0
    scale = get_int(ctx, at.FLOORED)
    for d in range(m.factor.size):
        a, b = 0.0, 0.0
        for j in range(m.gamma.shape[0]):
            a = max(a, abs(m.gamma[j, d] - m.predicted[j, d]))
            b = max(b, abs(m.gamma[j, d]))
        far, still = max(far, a * get_float(scale, d)), max(still, b * get_float(scale, d))
    return far < still


@compiled
def renew(ctx, m, source):
    """Take the Jacobian at the state, and the contraction of the fixed-point iteration with it."""
    for d in range(m.point.size):
        m.point[d] = get_float(get_int(ctx, at.ROW_STATE), d)
    linearize(ctx, m, source, get_float(ctx, at.T0) + get_int(ctx, at.N) * get_float(ctx, at.H))
    m.real[of.CONTRACTION] = m.real[of.RADIUS] * contraction(m)
    m.real[of.CONTRACTION_H] = get_float(ctx, at.H)
    m.count[of.STALE] = 0
    m.real[of.RATE] = 1.0


@compiled
def is_scattered(m):
    """Whether the coefficients of the step's polynomial do not fall off, as those of a solution do.

    The stage equations have other roots than the one that tends to the solution with h, some
    of them beyond a pole; a correction that follows the Jacobian of every stage may find them.
    """
    s, components = m.gamma.shape
    first, last = 0.0, 0.0
    for d in range(components):
        first += abs(m.gamma[0, d])
        last += abs(m.gamma[s - 1, d])
    return last > SCATTERED * first


@compiled
def solve_step(ctx, m, method, source, factors, started):
    """Solve the step of a context; return the outcome, DONE with F the field's polynomial part.

    Parameters
    ----------
    ctx : address
        The context, with SOLVED = 0.
    m : Memory
        This solver's.
    method : {NEWTON, BLENDED}
        How corrections are computed.
    source : address
        Of the Jacobian; 0 for differences.
    factors : address
        Of the function that keeps the factors; 0: they are in `Memory`.
    started : int
        1: the context is prepared and, if PREDICTED, F holds the extrapolated field, as for
        partial steps, which leave nothing to later ones. 0: a step of the trajectory.
    """
    m.count[of.TRIED] = 0
    jacobians = m.count[of.JACOBIANS]
    h = get_float(ctx, at.H)
    if started:
        m.count[of.LINEARIZED] = 0
    else:
        prepare(ctx)
        length = get_float(ctx, at.LENGTH)
        put_int(ctx, at.PREDICTED, 0)
        if length != 0.0 and abs(h / length) <= FARTHEST:
            start_elsewhere(ctx, ctx, 0.0 if get_int(ctx, at.REJECTED) else 1.0, h / length)
    set_factor(ctx, m)
    extrapolated = get_int(ctx, at.PREDICTED)
    if extrapolated:
        project(ctx, m, m.predicted, m.gamma.shape[1] - m.factor.size)
        if get_int(ctx, at.SECOND):
            set_velocities(ctx, m, m.predicted)
    fresh = m.count[of.LINEARIZED] == 0 or m.count[of.STALE] == 1 or m.count[of.SINCE] >= OLDEST
    use = extrapolated and (started or m.count[of.PREDICT])
    which, trying = KEPT, 1
    outcome = at.RUNNING
    while trying:
        if fresh:
            renew(ctx, m, source)
        if m.real[of.FACTORED_H] != h:
            m.count[of.FACTORED] = 0
        for j in range(m.gamma.shape[0]):
            for d in range(m.gamma.shape[1]):
                m.gamma[j, d] = m.predicted[j, d] if use else 0.0
        outcome = iterate(ctx, m, method, source, factors, which)
        trying = 0
        if outcome != at.DONE:
            # First without what may have been bad: the extrapolation, an old Jacobian; then
            # with the Jacobian of each stage, or where that is too large, of their mean.
            if use:
                put_int(ctx, at.RESTARTS, get_int(ctx, at.RESTARTS) + 1)
            if use or m.count[of.SINCE]:
                trying, use, fresh = 1, 0, True
            elif outcome == at.DIVERGED and which == KEPT:
                m.count[of.RESCUES] += 1
                trying, which, fresh = 1, EACH, False
    m.count[of.SINCE] += 1
    if which != KEPT:
        m.count[of.STALE] = 1
        if outcome == at.DONE and is_scattered(m):
            outcome = at.SCATTERED
    if outcome == at.DONE:
        if not started:
            m.count[of.PREDICT] = 1 if extrapolated == 0 or nearer(ctx, m) else 0
        set_values(ctx, m)
        put_int(ctx, at.SOLVED, at.BY_INCREMENT)
    if not started and get_int(ctx, at.STRATEGY) == at.AUTO:
        left = get_int(ctx, at.LEFT) - 1
        put_int(ctx, at.LEFT, left)
        longer = abs(h / m.real[of.CONTRACTION_H])
        if get_int(ctx, at.SECOND):
            longer *= longer
        gentle = GENTLE_VARYING if get_int(ctx, at.ERROR_DEGREE) else GENTLE
        if left < 0 and longer * m.real[of.CONTRACTION] < gentle:
            put_int(ctx, at.IMPLICIT, 0)
    tried = m.count[of.TRIED]
    put_float(ctx, at.LAST, m.real[of.CHANGE])
    m.count[of.CORRECTIONS] += tried
    put_int(ctx, at.ITERATIONS, get_int(ctx, at.ITERATIONS) + tried)
    evaluations = tried * get_int(ctx, at.STAGES)
    if source == 0:
        evaluations += (m.count[of.JACOBIANS] - jacobians) * (1 + get_int(ctx, at.ROWS))
    put_int(ctx, at.EVALUATIONS, get_int(ctx, at.EVALUATIONS) + evaluations)
    return outcome
