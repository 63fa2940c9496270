"""The nonlinear solver: fixed-point iteration with one stopping rule, and when to call another."""

from integrators.kernel import layout as at
from integrators.kernel.implicit.external import call_solver
from integrators.kernel.simd.memory import call_sweeps, get_float, get_int, put_float, put_int
from integrators.kernel.step.begin import prepare, start, start_plain, take_sizes
from integrators.kernel.step.sweep import change, compiled, evaluate, product, product_tested

MAX_ITERATIONS = 200
STAGNATION = 1e-13  # above it, a change that stops decreasing is a failure
ROUNDING = 1e-15  # below it, the first change that does not decrease ends the iteration
# Changes that do not decrease, to end it between ROUNDING and STAGNATION. Where the iteration's matrix is
# far from normal the changes fall in waves: two end it early (a drift of 2.4e-16 per step, period annulus,
# s = 2, h = 1; with five 3e-18).
PATIENCE = 5
# A change that is going to be no larger is not waited for, if the last two say so by falling this steeply.
# One steep fall may be a part of a wave (Penning trap, s = 2, h = .2: an error of 5e-15 in one step); so the
# average fall, from a first change as large as the state, must promise three times that too.
GOAL = 3e-17
STEEP = 0.15
INFINITY = float("inf")
MANY = 100  # iterations of a step at which the fixed-point iteration is slow
SLOW_STEPS = 4  # slow steps in a row after which the implicit solver takes over
SHORTEST, LONGEST = 16, 256  # steps for which it then stays, twice as many each time


@compiled
def rewind(ctx):
    """Begin to count the iterations of a start."""
    put_int(ctx, at.OUTCOME, at.RUNNING)
    put_int(ctx, at.TESTS, 0)
    put_int(ctx, at.TRIED, 0)
    put_int(ctx, at.STALLED, 0)
    put_float(ctx, at.BEST, INFINITY)
    put_float(ctx, at.LAST, INFINITY)


@compiled
def begin(ctx):
    """Start the step from STATE; return how many iterations to do before the first test."""
    rewind(ctx)
    prepare(ctx)
    start(ctx)
    age = get_int(ctx, at.AGE) - 1
    put_int(ctx, at.AGE, age)
    predicted = get_int(ctx, at.PREDICTED)
    if age < 0 or predicted == 0:
        take_sizes(ctx)
    return get_int(ctx, at.FREE) if predicted else 0


@compiled
def sweep(ctx):
    """Iterate once, without a test."""
    sweeps(ctx, 1)


@compiled
def sweeps(ctx, count):
    """Iterate ``count`` times, without a test."""
    if count > 0:
        fused = get_int(ctx, at.FUSED)
        if fused:
            call_sweeps(fused, ctx, count, 0)
        else:
            for _ in range(count):
                evaluate(ctx)
                product(ctx, get_int(ctx, at.MATRIX))
        put_int(ctx, at.TRIED, get_int(ctx, at.TRIED) + count)
        put_float(ctx, at.LAST, INFINITY)  # the next change does not follow the last one that was tested


@compiled
def moved(ctx):
    """Iterate once; return the largest change relative to the size of its block, NaN if any stage is."""
    fused = get_int(ctx, at.FUSED)
    if fused:
        call_sweeps(fused, ctx, 1, 1)
        return get_float(ctx, at.CHANGE)
    evaluate(ctx)
    return product_tested(ctx, get_int(ctx, at.MATRIX))


@compiled
def falls(strict, tried):
    """Whether falls as steep as ``tried`` equal ones from 1 to 1e-15 would bring ``strict`` to 3 GOAL."""
    # strict * 1e-15 ** (1 / tried) <= 3 GOAL
    part = strict / (3.0 * GOAL)
    power = 1.0
    for _ in range(tried):
        power *= part
        if power > 1e15:
            return False
    return True


@compiled
def sweep_tested(ctx):
    """Iterate once and apply the stopping rule; OUTCOME says what came of it.

    The iteration ends when the change, relative to its block, is at most
    TOLERANCE, or when it has stopped decreasing where rounding accounts for it. It also
    ends when the next change is going to be nothing: then the field is evaluated once
    more, since its values have the error of the stages before the last change.
    """
    strict = moved(ctx)
    tried = get_int(ctx, at.TRIED) + 1
    last = get_float(ctx, at.LAST)
    put_int(ctx, at.TRIED, tried)
    put_int(ctx, at.TESTS, get_int(ctx, at.TESTS) + 1)
    put_float(ctx, at.LAST, strict)
    if get_int(ctx, at.AGE) == 0:
        take_sizes(ctx)
    if not strict < INFINITY:
        # Growing changes overflow in the end; a NaN out of the blue is the field's own.
        restart(ctx, at.DIVERGED if 1.0 < last < INFINITY else at.NOT_FINITE)
    elif strict <= get_float(ctx, at.TOLERANCE):
        put_int(ctx, at.OUTCOME, at.DONE)
    elif strict < get_float(ctx, at.BEST):
        put_float(ctx, at.BEST, strict)
        put_int(ctx, at.STALLED, 0)
        # From 1 on, a change is no part of a size: a block was 0, or there was no change before.
        if last < 1.0 and strict <= STEEP * last and strict * strict <= GOAL * last and falls(strict, tried):
            evaluate(ctx)
            put_int(ctx, at.TRIED, tried + 1)
            put_int(ctx, at.OUTCOME, at.DONE)
        elif tried >= MAX_ITERATIONS:
            restart(ctx, at.DIVERGED)
    else:
        stalled = get_int(ctx, at.STALLED) + 1
        put_int(ctx, at.STALLED, stalled)
        if change(ctx, get_int(ctx, at.FLOORED)) < (ROUNDING if stalled < PATIENCE else STAGNATION):
            put_int(ctx, at.OUTCOME, at.DONE)
        elif tried >= MAX_ITERATIONS:
            restart(ctx, at.DIVERGED)


@compiled
def count(ctx):
    """Add the evaluations of a start to the counters."""
    tried = get_int(ctx, at.TRIED)
    put_int(ctx, at.ITERATIONS, get_int(ctx, at.ITERATIONS) + tried)
    put_int(ctx, at.EVALUATIONS, get_int(ctx, at.EVALUATIONS) + tried * get_int(ctx, at.STAGES))


@compiled
def restart(ctx, outcome):
    """Try again without extrapolation, if there was any; else the step has failed."""
    if get_int(ctx, at.PREDICTED) == 0:
        put_int(ctx, at.OUTCOME, outcome)
    else:
        count(ctx)
        put_int(ctx, at.RESTARTS, get_int(ctx, at.RESTARTS) + 1)
        rewind(ctx)
        start_plain(ctx)
        take_sizes(ctx)


@compiled
def close(ctx):
    """Keep the books of a start that has come to its end."""
    count(ctx)
    if get_int(ctx, at.OUTCOME) == at.DONE:
        put_int(ctx, at.SOLVED, 1)
        if get_int(ctx, at.PREDICTED):
            # Two tests tell how the changes fall, or that they do not any more; more mean that the
            # first came early. It came late where nothing was left to fall.
            tests = get_int(ctx, at.TESTS)
            late = get_int(ctx, at.STALLED) > 0 or get_float(ctx, at.LAST) <= get_float(ctx, at.TOLERANCE)
            free = get_int(ctx, at.FREE) + tests - (3 if late and tests <= 2 else 2)
            put_int(ctx, at.FREE, max(free, 0))
    else:
        put_float(ctx, at.LENGTH, 0.0)


@compiled
def settle(ctx):
    """Iterate with tests until the step is solved or has failed; return the outcome."""
    while get_int(ctx, at.OUTCOME) == at.RUNNING:
        sweep_tested(ctx)
    close(ctx)
    return get_int(ctx, at.OUTCOME)


@compiled
def solve(ctx):
    """Solve the step from STATE, unless that is done; return the outcome."""
    if get_int(ctx, at.SOLVED):
        return at.DONE
    if get_int(ctx, at.IMPLICIT):
        return solve_implicitly(ctx, ctx, 0)
    sweeps(ctx, begin(ctx))
    outcome = settle(ctx)
    if get_int(ctx, at.STRATEGY) != at.FIXED_POINT:
        outcome = reconsider(ctx, outcome)
    return outcome


@compiled
def solve_implicitly(ctx, side, started):
    """Solve the step in ``side``, ``ctx`` itself or a partial step of it, by the implicit solver."""
    outcome = call_solver(get_int(side, at.SOLVER), side, get_int(side, at.SOLVER_MEMORY), started)
    put_int(ctx, at.IMPLICIT_STEPS, get_int(ctx, at.IMPLICIT_STEPS) + 1 - started)
    return outcome


@compiled
def reconsider(ctx, outcome):
    """Let the implicit solver take over from a fixed-point iteration that failed or was slow."""
    slow = get_int(ctx, at.SLOW) + 1 if outcome != at.DONE or get_int(ctx, at.TRIED) >= MANY else 0
    put_int(ctx, at.SLOW, slow)
    if outcome == at.DONE and slow < SLOW_STEPS:
        return outcome
    if get_int(ctx, at.SOLVER) == 0:
        put_int(ctx, at.WANTED, 1)
        return at.BUDGET  # to be continued when it is there
    held = min(max(2 * get_int(ctx, at.HELD), SHORTEST), LONGEST)
    put_int(ctx, at.HELD, held)
    put_int(ctx, at.LEFT, held)
    put_int(ctx, at.SLOW, 0)
    put_int(ctx, at.IMPLICIT, 1)
    put_int(ctx, at.SWITCHES, get_int(ctx, at.SWITCHES) + 1)
    return outcome if outcome == at.DONE else solve_implicitly(ctx, ctx, 0)


@compiled
def settle_part(ctx, side):
    """Solve a partial step of ``ctx``, prepared in ``side``; return the outcome."""
    if get_int(ctx, at.IMPLICIT):
        return solve_implicitly(ctx, side, 1)
    outcome = settle(side)
    if outcome != at.DONE and get_int(ctx, at.STRATEGY) != at.FIXED_POINT:
        if get_int(side, at.SOLVER) == 0:
            put_int(ctx, at.WANTED, 1)
            return at.BUDGET
        put_int(side, at.PREDICTED, 0)
        outcome = solve_implicitly(ctx, side, 1)
    return outcome
