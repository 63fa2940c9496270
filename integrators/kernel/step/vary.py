"""Steps of varying length: each as long as the estimated errors and the iterations allow.

Where the fixed-point iteration allows much less than the errors do, the implicit solver takes over.
"""

from math import log

from integrators.kernel import layout as at
from integrators.kernel.line.views import two_sum
from integrators.kernel.simd.memory import get_float, get_int, put_float, put_int
from integrators.kernel.step.advance import sample
from integrators.kernel.step.begin import (
    FARTHEST,
    prepare,
    set_step,
    start_elsewhere,
    start_plain,
    take_sizes,
)
from integrators.kernel.step.control import (
    APPROACH,
    CLOSE,
    INFINITY,
    RETREAT,
    SAFETY,
    SHORTEST,
    SHRINK,
    TINY,
    bounded,
    log_factor,
)
from integrators.kernel.step.estimate import estimate, estimate_implicit, log_decay
from integrators.kernel.step.finish import commit, update, write
from integrators.kernel.step.iterate import (
    ROUNDING,
    close,
    rewind,
    settle,
    solve_implicitly,
    sweep,
    sweep_tested,
)
from integrators.kernel.step.kinks import kink
from integrators.kernel.step.sweep import compiled, evaluate

GROW = FARTHEST  # of the length from one step to the next, at most
# Iterations to aim at, at most, in second-order form and in first-order form: with contractions (h w)^2
# and h w, a unit of time costs least at h w = 1/e, which takes 18 and 36 to 1e-16.
BUSY, BUSY_FIRST = 18.0, 36.0
GOAL = log(1e-17)  # a change that is going to be no larger is not waited for
FIRST_RATE, LEAST_RATE, MOST_RATE = log(0.01), log(1e-4), log(0.9)
HOPE = log(0.7)  # where the last change was nothing, the contraction may be this part of what was thought
# The implicit solver takes over after so many steps in a row that the iteration keeps from growing where the
# errors would allow so much longer ones: its matrices cost the more the more rows they have. Beyond
# MOST_ROWS they are too dear to be tried where only low coefficients tell how much longer.
HELD_BACK_STEPS = 8
HELD_BACK = 1.2
GAIN, GAIN_PER_ROW, MOST_ROWS = 8.0, 1.5, 64
MOST_HELD_BACK_STEPS = 4096  # twice as many each time that it has gained nothing
# A step that is too long may fail, or look like one with a kink; so many in a row have one, and are cut to
# find it.
SURE = 3
STAY = 16  # steps for which it then stays
STEADY = 1.2  # an implicit step that could be longer by less keeps its length, and so the factors


@compiled
def attempt(ctx, h):
    """Solve the step of length h from STATE; return the outcome."""
    set_step(ctx, h)
    if get_int(ctx, at.IMPLICIT):
        put_float(ctx, at.LOG_RATE, FIRST_RATE)  # nobody knows what it will be afterwards
        outcome = solve_implicitly(ctx, ctx, 0)
        return update(ctx) if outcome == at.DONE else outcome
    rewind(ctx)
    prepare(ctx)
    length = get_float(ctx, at.LENGTH)
    if length != 0.0 and abs(h / length) <= FARTHEST:
        start_elsewhere(ctx, ctx, 0.0 if get_int(ctx, at.REJECTED) else 1.0, h / length)
    else:
        start_plain(ctx)
    age = get_int(ctx, at.AGE) - 1
    put_int(ctx, at.AGE, age)
    predicted = get_int(ctx, at.PREDICTED)
    if age < 0 or predicted == 0:
        take_sizes(ctx)
    outcome = iterate(ctx)
    return update(ctx) if outcome == at.DONE else outcome


@compiled
def iterate(ctx):
    """Iterate until the step is solved or has failed; return the outcome.

    The first change and the rate of contraction, as it was at the last step, tell how
    many iterations need no test. Nor does the one that will not change anything.
    """
    sweep_tested(ctx)
    tried = get_int(ctx, at.TRIED)
    if get_int(ctx, at.OUTCOME) != at.RUNNING or tried != 1:
        return settle(ctx)
    first = log(get_float(ctx, at.LAST))
    rate = get_float(ctx, at.LOG_RATE)
    for _ in range(int((GOAL - first) / rate) - 1):
        sweep(ctx)
    while get_int(ctx, at.OUTCOME) == at.RUNNING:
        sweep_tested(ctx)
        tries = get_int(ctx, at.TRIED) - tried
        if tries <= 0:  # started anew
            return settle(ctx)
        last = get_float(ctx, at.LAST)
        if last > ROUNDING:
            rate = min(max((log(last) - first) / tries, LEAST_RATE), MOST_RATE)
        elif last == 0.0 and tries > 1:
            rate = max(rate + HOPE, LEAST_RATE)
        if get_int(ctx, at.OUTCOME) == at.RUNNING and log(last) + rate < GOAL:
            evaluate(ctx)
            put_int(ctx, at.TRIED, get_int(ctx, at.TRIED) + 1)
            put_int(ctx, at.OUTCOME, at.DONE)
    put_float(ctx, at.LOG_RATE, rate)
    close(ctx)
    return get_int(ctx, at.OUTCOME)


@compiled
def longer(ctx, error, defect, grow):
    """Return the next step's length relative to this one's, from what is estimated for this one."""
    if not error < INFINITY:
        return SHRINK
    h = get_float(ctx, at.H)
    behind = get_float(ctx, at.LENGTH_BEHIND)
    change = log(abs(h / behind)) if behind != 0.0 else 0.0
    power = 1.0 / (2.0 * get_int(ctx, at.ERROR_DEGREE) + 1.0)
    here = power * log(max(error, TINY))
    before = get_float(ctx, at.ERROR_BEHIND) if behind != 0.0 else INFINITY
    factor = log_factor(get_float(ctx, at.ERROR_AIM), here, before, change)
    put_float(ctx, at.ERROR_AHEAD, here)
    if get_float(ctx, at.ALLOWED_DEFECT) < INFINITY:
        power = 1.0 / (2.0 * get_int(ctx, at.STAGES) - 1.0)
        here = power * log(max(defect, TINY))
        before = get_float(ctx, at.DEFECT_BEHIND) if behind != 0.0 else INFINITY
        factor = min(factor, log_factor(get_float(ctx, at.DEFECT_AIM), here, before, change))
        put_float(ctx, at.DEFECT_AHEAD, here)
    return bounded(factor, grow)


@compiled
def watch(ctx, factor):
    """Count the steps in a row that only the fixed-point iteration keeps from being much longer."""
    room = get_float(ctx, at.ERROR_AIM) - get_float(ctx, at.ERROR_AHEAD)
    if get_float(ctx, at.ALLOWED_DEFECT) < INFINITY:
        room = min(room, get_float(ctx, at.DEFECT_AIM) - get_float(ctx, at.DEFECT_AHEAD))
    worth = log(GAIN + GAIN_PER_ROW * min(get_int(ctx, at.ROWS), MOST_ROWS))
    held_back = factor < HELD_BACK
    if held_back and room <= worth and get_int(ctx, at.ROWS) <= MOST_ROWS:
        room = log(get_float(ctx, at.ERROR_DECAY)) - log_decay(ctx)
    put_int(ctx, at.SLOW, get_int(ctx, at.SLOW) + 1 if held_back and room > worth else 0)


@compiled
def take_over(ctx):
    """Put the implicit solver to work."""
    put_int(ctx, at.LEFT, STAY)
    put_int(ctx, at.SLOW, 0)
    put_int(ctx, at.IMPLICIT, 1)
    put_int(ctx, at.SWITCHES, get_int(ctx, at.SWITCHES) + 1)
    put_float(ctx, at.LENGTH_LIMIT, INFINITY)


@compiled
def learn(ctx):
    """Set HELD, the steps to wait for the implicit solver, when that has given way to the fixed point again.

    If it did so as soon as it might, steps have not become longer.
    """
    waited = max(get_int(ctx, at.HELD), HELD_BACK_STEPS)
    gained = get_int(ctx, at.LEFT) < -1
    put_int(ctx, at.HELD, HELD_BACK_STEPS if gained else min(2 * waited, MOST_HELD_BACK_STEPS))


@compiled
def remaining(ctx, t):
    """Return how far the time t is ahead; 0 where it is the present but for rounding, or behind.

    Rounding is that of the times and of the step behind, which may be all there is at t = 0. A
    breakpoint counts as reached when it is so near that no step there could be told from none.
    """
    t0 = get_float(ctx, at.T0)
    rest = (t - t0) - get_float(ctx, at.TIME_LOW)
    size = max(max(abs(t), abs(t0)), abs(get_float(ctx, at.LENGTH_BEHIND)))
    close = SHORTEST if t == get_float(ctx, at.STOP) else CLOSE
    return 0.0 if abs(rest) <= close * size or rest * get_float(ctx, at.NEXT_LENGTH) < 0.0 else rest


@compiled
def within(ctx, h):
    """Return the length of a step, no longer than LONGEST and not beyond STOP."""
    longest, stop = get_float(ctx, at.LONGEST), get_float(ctx, at.STOP)
    if abs(h) > longest:
        h = longest if h > 0.0 else -longest
    if abs(stop) < INFINITY:
        rest = remaining(ctx, stop)
        if abs(h) > abs(rest):
            h = rest
    return h


@compiled
def ready(ctx):
    """Solve the step ahead with a length that the tolerance allows; H is its length."""
    if get_int(ctx, at.SOLVED):
        return at.DONE
    if get_int(ctx, at.SLOW) >= max(get_int(ctx, at.HELD), HELD_BACK_STEPS):
        if get_int(ctx, at.SOLVER) == 0:
            put_int(ctx, at.WANTED, 1)
            return at.BUDGET  # to be continued when it is there
        take_over(ctx)
    t = get_float(ctx, at.T0)
    allowed, allowed_defect = get_float(ctx, at.ALLOWED_ERROR), get_float(ctx, at.ALLOWED_DEFECT)
    busy = BUSY if get_int(ctx, at.SECOND) else BUSY_FIRST
    put_int(ctx, at.REJECTED, 0)
    grow, failure, doubts = GROW, at.UNDERFLOW, 0
    while True:
        h = within(ctx, get_float(ctx, at.NEXT_LENGTH))
        if not abs(h) > SHORTEST * abs(t):
            return failure
        before = get_int(ctx, at.ITERATIONS)
        implicit = get_int(ctx, at.IMPLICIT)
        outcome = attempt(ctx, h)
        if implicit and get_int(ctx, at.IMPLICIT) == 0:
            learn(ctx)
        put_int(ctx, at.SOLVED, 0)
        error, defect = INFINITY, INFINITY
        if outcome == at.DONE:
            error, defect = estimate_implicit(ctx) if implicit else estimate(ctx)
            if implicit == 0:
                fits = error <= allowed and defect <= allowed_defect
                if get_int(ctx, at.KINKED):
                    doubts += 1
                    put_float(ctx, at.DOUBT_END, t + h)
                if (fits or doubts >= SURE) and kink(ctx, fits):
                    error = INFINITY
        factor = longer(ctx, error, defect, grow)
        if error <= allowed and defect <= allowed_defect:
            if doubts >= SURE and get_int(ctx, at.KINKS):
                put_float(ctx, at.LENGTH_LIMIT, INFINITY)  # what the iteration allowed was for the kink
            limit = get_float(ctx, at.LENGTH_LIMIT) * APPROACH
            put_float(ctx, at.LENGTH_LIMIT, limit)
            if implicit:
                factor = min(1.0 if 1.0 < factor < STEADY else factor, limit / abs(h))
            else:
                factor = min(factor, max(busy / (get_int(ctx, at.ITERATIONS) - before), 0.5))
                factor = min(factor, limit / abs(h))
                if get_int(ctx, at.STRATEGY) != at.FIXED_POINT:
                    watch(ctx, factor)
            put_float(ctx, at.LENGTH_AFTER, h * factor)
            put_int(ctx, at.SOLVED, 1)
            return at.DONE
        failure = at.UNDERFLOW
        if implicit:
            put_int(ctx, at.IMPLICIT_STEPS, get_int(ctx, at.IMPLICIT_STEPS) - 1)
        if outcome == at.DONE:
            put_float(ctx, at.LENGTH, h)
            put_int(ctx, at.REJECTED, 1)
        else:
            failure = outcome
            put_float(ctx, at.LENGTH, 0.0)
            put_float(ctx, at.LENGTH_LIMIT, RETREAT * abs(h))
            if outcome in (at.DIVERGED, at.SCATTERED):
                factor = RETREAT
        put_float(ctx, at.NEXT_LENGTH, h * min(factor, SAFETY))
        put_int(ctx, at.REJECTIONS, get_int(ctx, at.REJECTIONS) + 1)
        grow = 1.0


@compiled
def take(ctx):
    """Take the step ahead, which is solved."""
    t, low = two_sum(get_float(ctx, at.T0), get_float(ctx, at.H))
    commit(ctx)
    put_int(ctx, at.N, 0)
    t, low = two_sum(t, low + get_float(ctx, at.TIME_LOW))
    put_float(ctx, at.T0, t)
    put_float(ctx, at.TIME_LOW, low)
    put_float(ctx, at.NEXT_LENGTH, get_float(ctx, at.LENGTH_AFTER))
    put_float(ctx, at.LENGTH_BEHIND, get_float(ctx, at.H))
    put_float(ctx, at.ERROR_BEHIND, get_float(ctx, at.ERROR_AHEAD))
    put_float(ctx, at.DEFECT_BEHIND, get_float(ctx, at.DEFECT_AHEAD))


@compiled
def dimension(ctx):
    """Return the length of the state."""
    return get_int(ctx, at.ROWS) * (2 if get_int(ctx, at.SECOND) else 1)


@compiled
def vary(ctx, side, between, count, times, first, out, budget):
    """Take steps to the samples' times and make the samples; see `step.advance.advance`."""
    dim = dimension(ctx)
    for i in range(first, count):
        put_int(ctx, at.MADE, i)
        t = get_float(times, i)
        while True:
            rest = remaining(ctx, t)
            if rest == 0.0:
                break
            outcome = ready(ctx)
            if outcome != at.DONE:
                return outcome
            if abs(rest) < abs(get_float(ctx, at.H)) - CLOSE * abs(t):
                break
            if budget == 0:
                return at.BUDGET
            budget -= 1
            take(ctx)
        put_float(side, at.TIME_LOW, get_float(ctx, at.TIME_LOW))
        outcome = sample(ctx, side, between, t, rest, out + 8 * dim * i)
        if outcome != at.DONE:
            return outcome
        if between == at.LAND:
            put_float(ctx, at.TIME_LOW, 0.0)
    put_int(ctx, at.MADE, count)
    return at.DONE


@compiled
def walk(ctx, times, out, end, budget):
    """Take ``budget`` steps at most, none beyond the time ``end``, and note their times and states.

    With a budget of 0, only look whether a step remains to be taken.
    """
    dim = dimension(ctx)
    made = 0
    while True:
        put_int(ctx, at.MADE, made)
        rest = remaining(ctx, end)
        if rest == 0.0:
            return at.DONE
        outcome = ready(ctx)
        if outcome != at.DONE:
            return outcome
        if abs(rest) < abs(get_float(ctx, at.H)) - CLOSE * abs(end):
            return at.DONE
        if budget == 0:
            return at.BUDGET
        take(ctx)
        put_float(times, made, get_float(ctx, at.T0))
        write(ctx, get_int(ctx, at.STATE), out + 8 * dim * made)
        made += 1
        if made == budget:
            put_int(ctx, at.MADE, made)
            return at.BUDGET
