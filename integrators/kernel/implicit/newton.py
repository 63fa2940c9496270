"""A step by an implicit solver: which start, which Jacobian, when to stop, when to give up."""

from integrators.kernel.context import BY_INCREMENT, DIVERGED, DONE, RUNNING, SCATTERED
from integrators.kernel.implicit.corrections import EACH, KEPT, correct, take_stage
from integrators.kernel.implicit.jacobian import contraction, linearize
from integrators.kernel.implicit.memory import BLENDED, NEWTON
from integrators.kernel.implicit.stages import (
    FLOORED_WEIGHTS,
    WEIGHTS,
    at,
    changes,
    measure,
    project,
    set_factor,
    set_stages,
    set_values,
    set_velocities,
)  # fmt: skip
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.implicit import AUTO
from integrators.kernel.simd.memory import get, largest, put, splat8, spread
from integrators.kernel.step.begin import INFINITY, prepare, start_from_polynomial
from integrators.kernel.step.rule import FARTHEST, STAGNATION
from integrators.kernel.step.stopping import is_rounding

MOST_CORRECTIONS = 40
MOST_BLENDED = 250
STAGNATION_LIMIT = 2  # changes that do not decrease, to end it between ROUNDING and STAGNATION ...
STILL_CONVERGING = 0.5  # ... unless the changes of all but the smallest components still decrease so fast
FORESEEN = 0.1  # a change that is going to be this part of the tolerance need not be seen
RATE_DECAY = 0.7  # of the rate of contraction, from one step to the next
SLOW = 0.2  # a Jacobian whose corrections contract no better is replaced at the next step
HOPELESS = 4  # corrections that do not decrease, or grow, to give up
OLDEST = 64  # steps for which a Jacobian is used, so that the contraction is known anew
CONTRACTS_AGAIN = 0.25  # contraction of the fixed-point iteration at which that is to be tried again
SIZES_SETTLED = 1e-3  # sizes are measured until changes are this small
# Down to this, a step's coefficients must halve from each to the next after a full Newton iteration
LEAST_DECAY = 0.02
LEFT, MOST_DAMPED = 1e-6, 1e8  # part of a size, and of a correction, that a stiff problem may leave


@compiled
def iterate(ctx, m, which):
    """Correct gamma, by the Jacobian that ``which`` tells, until the stages do not change.

    What ends the iteration is the change of the stages, relative to their blocks, as
    in `integrators.kernel.step.iterate`. Return DONE, DIVERGED, or NOT_FINITE if the start is
    one at which the field or its Jacobian is not finite.
    """
    most = MOST_BLENDED if m.method == BLENDED else MOST_CORRECTIONS
    tolerance = ctx.solver.tolerance
    best, floored_change, worst = INFINITY, INFINITY, 0.0
    rate = m.rate if m.method == NEWTON and which == KEPT else 1.0
    stalled, hopeless = 0, 0
    for tried in range(most + 1):
        if tried:
            outcome = correct(ctx, m, which)
            if outcome != DONE:
                return outcome if tried == 1 else DIVERGED
        set_stages(ctx, m)
        if floored_change > SIZES_SETTLED:
            measure(ctx, m)
        if tried == 0:
            continue
        change, before = changes(ctx, m, WEIGHTS), floored_change
        floored_change = changes(ctx, m, FLOORED_WEIGHTS)
        m.change = floored_change
        if not floored_change < INFINITY:
            return DIVERGED
        if before < SIZES_SETTLED and floored_change > STAGNATION:
            worst = max(worst, floored_change / before)
        if change <= tolerance or change * max(worst, rate) < FORESEEN * tolerance:
            break
        stalled = 0 if change < best else stalled + 1
        best = min(best, change)
        if stalled and is_rounding(
            floored_change,
            stalled >= STAGNATION_LIMIT and not floored_change < STILL_CONVERGING * before,
            ctx.solver.stagnation,
        ):
            break
        hopeless = 0 if floored_change < before else hopeless + 1
        if hopeless == STAGNATION_LIMIT and floored_change < ctx.solver.stagnation:
            break
        if hopeless == HOPELESS:
            return DIVERGED
    else:
        return DIVERGED
    if worst > 0.0:
        m.rate = worst if rate == 1.0 else max(worst, RATE_DECAY * rate)
    if worst > SLOW and m.method == NEWTON:
        m.stale = 1
    return DONE


@compiled
def nearer(ctx, m):
    """Whether the extrapolated coefficients were nearer to the solution than constant stages."""
    far, still = splat8(0.0), splat8(0.0)
    scale = ctx.blocks.floored_weights
    for d in range(ctx.rows):
        for group in range(m.groups):
            i = 8 * (m.padded * group + d)
            gamma = get(m.gamma, i)
            far = max(far, abs(gamma - get(m.predicted, i)) * spread(scale, d))
            still = max(still, abs(gamma) * spread(scale, d))
    return largest(far) < largest(still)


@compiled
def renew(ctx, m):
    """Take the Jacobian at the state, and the contraction of the fixed-point iteration with it.

    Of tangent vectors it is taken at the trajectory's first stage.
    """
    if m.trajectory != 0:
        take_stage(ctx, m, 0)
        linearize(ctx, m, ctx.times[0])
    else:
        for d in range(m.unknowns):
            m.state[d] = ctx.scratch.row_state[d]
        linearize(ctx, m, ctx.t0 + ctx.n * ctx.h)
    m.contraction = m.radius * contraction(m)
    m.contraction_h = ctx.h
    m.stale = 0
    m.rate = 1.0


@compiled
def is_scattered(m):
    """Whether the coefficients of the step's polynomial do not fall off, as those of a solution do.

    The stage equations have other roots than the one that tends to the solution with h, some
    of them beyond a pole; a correction that follows the Jacobian of every stage may find them.
    """
    first, last, allowed = 0.0, 0.0, 0.5  # s = 1: what cannot fall off is not believed
    for _ in range(2, m.s):
        allowed *= 0.5
    for part in range(m.parts):
        gamma = m.gamma + m.block * part
        for d in range(m.rows):
            first += abs(gamma[8 * d])
            last += abs(gamma[at(m, m.s - 1, d)])
    return last > max(allowed, LEAST_DECAY) * first


@compiled
def is_left(ctx, m):
    """Whether the last residual would by itself move a stage by far more than its correction has.

    Corrections are small also where the Jacobian is nearly infinite, as that of ``sqrt(y)`` is at a y that
    has vanished: with it any extrapolated stages would pass for the solution.
    """
    last = m.residual + m.block * (m.parts - 1)
    left, scale = splat8(0.0), ctx.blocks.floored_weights
    for d in range(ctx.rows):
        for group in range(m.groups):
            left = max(left, abs(get(last, 8 * (m.padded * group + d))) * spread(scale, d))
    return abs(ctx.h) * largest(left) > max(LEFT, MOST_DAMPED * m.change)


@compiled
def solve_step(ctx, m, started):
    """Solve the step of a context; return the outcome, DONE with the values of the field's polynomial part.

    Parameters
    ----------
    ctx : Context
        Of a step that is not solved.
    m : Workspace
        This solver's.
    started : int
        1: the context is prepared and, if it is predicted, holds the extrapolated values, as for
        partial steps, which leave nothing to later ones. 0: a step of the trajectory.
    """
    solver, counters, implicit = ctx.solver, ctx.counters, ctx.implicit
    m.tried = 0
    jacobians = m.jacobians
    h = ctx.h
    if started:
        m.linearized = 0
    else:
        prepare(ctx)
        length = ctx.length
        solver.predicted = 0
        if length != 0.0 and abs(h / length) <= FARTHEST:
            start_from_polynomial(ctx, ctx, 0.0 if ctx.controller.rejected else 1.0, h / length)
    set_factor(ctx, m)
    extrapolated = solver.predicted
    if extrapolated:
        project(ctx, m, m.predicted)
        if ctx.second:
            set_velocities(ctx, m, m.predicted, m.predicted)
    fresh = m.linearized == 0 or m.stale == 1 or m.since >= OLDEST
    use = extrapolated and (started or m.predict)
    which, trying = KEPT, 1
    outcome = RUNNING
    while trying:
        if fresh:
            renew(ctx, m)
        if m.factored_h != h:
            m.factored = 0
        for i in range(0, m.parts * m.block, 8):
            put(m.gamma, i, get(m.predicted, i) if use else splat8(0.0))
        outcome = iterate(ctx, m, which)
        if outcome == DONE and (use or m.since) and m.trajectory == 0 and is_left(ctx, m):
            outcome = DIVERGED
        trying = 0
        if outcome != DONE:
            # First without what may have been bad: the extrapolation, an old Jacobian; then
            # with the Jacobian of each stage, or where that is too large, of their mean.
            if use:
                counters.restarts += 1
            if use or m.since:
                trying, use, fresh = 1, 0, True
            elif outcome == DIVERGED and which == KEPT and (m.trajectory == 0 or m.source != 0):
                m.full_newton += 1
                trying, which, fresh = 1, EACH, False
    m.since += 1
    if which != KEPT:
        m.stale = 1
        if outcome == DONE and m.trajectory == 0 and is_scattered(m):
            outcome = SCATTERED
    if outcome == DONE:
        if not started:
            m.predict = 1 if extrapolated == 0 or nearer(ctx, m) else 0
        set_values(ctx, m)
        ctx.solved = BY_INCREMENT
    if not started and implicit.strategy == AUTO:
        implicit.left -= 1
        longer = abs(h / m.contraction_h)
        if ctx.second:
            longer *= longer
        if implicit.left < 0 and longer * m.contraction < CONTRACTS_AGAIN:
            implicit.active = 0
    solver.last = m.change
    m.corrections += m.tried
    counters.iterations += m.tried
    counters.evaluations += m.tried * ctx.k
    if m.source == 0:
        counters.evaluations += (m.jacobians - jacobians) * (1 + m.group_count)
    return outcome
