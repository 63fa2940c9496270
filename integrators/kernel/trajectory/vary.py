"""Adaptive steps: each as long as the estimated errors and the iterations allow.

Where the fixed-point iteration allows much less than the errors do, the implicit solver takes over.
"""

from math import log

from integrators.kernel.context import (
    BY_VALUES,
    DIVERGED,
    DONE,
    NOISY,
    NOT_KEPT,
    RUNNING,
    SCATTERED,
    SLIDING,
    UNDERFLOW,
    UNSCALED,
    UNSOLVED,
)
from integrators.kernel.inside.attempt import CONFIRMATIONS, GOOD, TOO_LONG, enter, judge_attempt
from integrators.kernel.inside.discontinuities import keep_end, record, undo
from integrators.kernel.inside.surfaces import AGAIN, REACHED
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.discontinuities import START
from integrators.kernel.parts.estimate import TOO_NOISY
from integrators.kernel.parts.implicit import FIXED_POINT
from integrators.kernel.parts.surfaces import AT_STEP_END
from integrators.kernel.simd.operations import binary_log, least
from integrators.kernel.step.begin import INFINITY, begin, set_step, tabulated_ratio
from integrators.kernel.step.control import (
    APPROACH,
    LOG_STEADY,
    RETREAT,
    SAFETY,
    SHORTEST,
    SHRINK,
    STEADY,
    TIME_TOLERANCE,
    as_errors_allow,
    as_iterations_allow,
    bounded,
    error_power,
    is_distinct,
    log_of_order,
    log_ratio,
    room_for_longer,
)
from integrators.kernel.step.estimate import (
    estimate_again,
    log_decay,
)
from integrators.kernel.step.finish import count_step, finish
from integrators.kernel.step.fixed_point import iterate_measured
from integrators.kernel.step.iterate import end_iteration, extra_iterations, iterate_to_end, test
from integrators.kernel.step.reversible import keep_pace
from integrators.kernel.step.rounding import EVIDENT, change_by_noise, largest_added
from integrators.kernel.step.rule import (
    FARTHEST,
    FIRST_RATE,
    LOG_RESIDUAL_VARYING,
    ROUNDING,
    SCALE_LASTS,
    SHORTEST_PART,
    STAGNATION,
    TOLERANCE,
    TRUSTED,
    UNTESTED,
)
from integrators.kernel.step.solver_switch import request_solver, solve_implicitly
from integrators.kernel.step.stopping import rate_at_zero, rate_since, takes_too_long, untested
from integrators.kernel.step.sums import time_after

MOST_GROWTH = FARTHEST  # of the length from one step to the next, at most
# Iterations to aim at, at most. With contractions (h w)^2 a unit of time costs least at h w = 1/e, which
# takes 18 to 1e-16. With h w (the first-order form) it would be 36, but rounding is then multiplied like the
# terms of exp(h w) by the iterations after it: 24 take as long as 18 and end, far out in a rotating frame,
# with three times the error; 36 err by 1e-14 in one step of a diffusion.
TARGET_ITERATIONS = 18.0
# The implicit solver takes over after so many steps in a row that the iteration keeps from growing where the
# errors would allow so much longer ones. Its steps cost one or two of 18 iterations through memory, and ten
# of those of few rows or of the second-order form; the more rows, the more, up to MOST_ROWS: beyond, the
# factors are sparse.
LIMITED_STEPS = 8
LIMITED_GROWTH = 1.2
GAIN, GAIN_LIGHT, GAIN_PER_ROW, MOST_ROWS = 3.0, 6.0, 0.1, 64
LEAST_WORTH = log(GAIN)  # `log_worth` is larger; no logarithm is taken where this tells enough
MOST_LIMITED_STEPS = 4096  # twice as many each time that it has gained nothing
LEAST_IMPLICIT_STEPS = 16  # steps for which it then stays
# Attempts at a step after which its errors do not become small enough by cutting it; at a discontinuity they
# do.
MOST_ATTEMPTS = 24
# From rest, by its own size, a block may follow the steps of the field's rounding: no step fails, and
# there are many. So what the blocks will reach is asked for now and then where steps are cut to less
# than such a part of the interval.
STALL_PART = 1e-4
STALL_CHECK_EVERY, STALL_CHECKS = 256, 32
# What noise adds in a step may be this part of the tolerance; the iteration stagnates at so many times that.
NOISE_ALLOWED, NOISE_LEFT = 0.1, 20.0


@compiled
def attempt(ctx, h):
    """Solve the step of length h from the state; return the outcome."""
    set_step(ctx, h)
    if ctx.estimate.noisy:
        iterate_to(ctx.solver, NOISE_LEFT * change_by_noise(ctx))
    if ctx.implicit.active:
        ctx.solver.rate = FIRST_RATE  # it is unknown afterwards
        outcome = solve_implicitly(ctx, ctx, 0)
    else:
        begin(ctx)
        outcome = iterate(ctx)
    return finish(ctx) if outcome == DONE else outcome


@compiled
def iterate(ctx):
    """Iterate until the step is solved or has failed; return the outcome.

    The first change and the rate of contraction, as it was at the last step, tell how many
    iterations need no test; how many remain then, the rate of this step.
    """
    solver = ctx.solver
    test(ctx, iterate_measured(ctx, 0))
    tried = solver.tried
    if solver.outcome != RUNNING or tried != 1:
        return iterate_to_end(ctx)
    first, known = binary_log(solver.last), solver.rate
    rate = known
    change = first
    trusted, log_trusted = solver.trusted, solver.log_trusted
    while solver.outcome == RUNNING:
        moved = iterate_measured(ctx, int(untested(change, rate, log_trusted)))
        tries = solver.tried - tried
        if moved > ROUNDING:
            change = binary_log(moved)
            rate = rate_since(first, change, tries)
        elif moved == 0.0 and tries > 1:
            rate = rate_at_zero(rate)
        solver.rate = rate
        test(ctx, moved)
        if solver.tried <= tried:  # started anew
            return iterate_to_end(ctx)
        if solver.outcome == RUNNING:
            if moved <= trusted:
                extra_iterations(ctx, moved)
            elif takes_too_long(change, rate, tries, solver.log_residual, TARGET_ITERATIONS):
                solver.outcome = DIVERGED  # not yet, but a shorter step is cheaper
                solver.rate = known
    return end_iteration(ctx)


@compiled
def length_factor(ctx, error, quadrature_error, most_growth, implicit):
    """Return the next step's length relative to this one's, from what is estimated for this one.

    And whether that is less than it might be only for an estimate that may be rounding.
    """
    controller, estimated = ctx.controller, ctx.estimate
    if not error < INFINITY:
        return SHRINK, False
    h, previous = ctx.h, controller.previous_length
    known = previous != 0.0
    evident = estimated.evident_error >= error
    quadrature_evident = estimated.evident_quadrature_error >= quadrature_error
    error = log_of_order(error, error_power(controller.error_degree))
    quadrature_error = log_of_order(quadrature_error, error_power(ctx.k - 1))
    controller.error_ahead, controller.quadrature_error_ahead = error, quadrature_error
    factor, in_doubt = as_errors_allow(
        error,
        controller.previous_error if known else INFINITY,
        controller.error_aim,
        quadrature_error,
        controller.previous_quadrature_error if known else INFINITY,
        controller.quadrature_error_aim,
        controller.allowed_quadrature_error < INFINITY,
        log_ratio(h / previous) if known else 0.0,
        evident,
        quadrature_evident,
        LOG_STEADY if implicit else 0.0,
    )
    return bounded(factor, most_growth), in_doubt


@compiled
def log_worth(ctx):
    """Return the logarithm of how much longer steps must be for the implicit solver to be worth its while."""
    gain = GAIN_LIGHT if ctx.second or ctx.fused else GAIN
    return log(gain + GAIN_PER_ROW * min(ctx.rows, MOST_ROWS))


@compiled
def count_limited_steps(ctx, factor):
    """Count the steps in a row that only the fixed-point iteration keeps from being much longer."""
    controller = ctx.controller
    room = room_for_longer(
        controller.error_ahead,
        controller.error_aim,
        controller.quadrature_error_ahead,
        controller.quadrature_error_aim,
        controller.allowed_quadrature_error < INFINITY,
    )
    slow = 0
    if factor < LIMITED_GROWTH:
        much = room > LEAST_WORTH and room > log_worth(ctx)
        if not much:
            decay = log_decay(ctx)
            much = decay < 0.0 and log(ctx.estimate.error_decay) - decay > log_worth(ctx)
        slow = ctx.implicit.slow + 1 if much else 0
    ctx.implicit.slow = slow


@compiled
def switch_to_implicit(ctx):
    """Put the implicit solver to work."""
    implicit = ctx.implicit
    implicit.left = LEAST_IMPLICIT_STEPS
    implicit.slow = 0
    implicit.active = 1
    ctx.counters.switches += 1
    ctx.controller.length_limit = INFINITY


@compiled
def set_wait(ctx):
    """Set `Implicit.held`, the steps to wait for the implicit solver, when that has given way again.

    If it did so as soon as it might, steps have not become longer.
    """
    implicit = ctx.implicit
    waited = max(implicit.held, LIMITED_STEPS)
    gained = implicit.left < -1
    implicit.held = LIMITED_STEPS if gained else min(2 * waited, MOST_LIMITED_STEPS)


@compiled
def remaining(ctx, t):
    """Return how far the time t is ahead; 0 where it is the present but for rounding, or behind.

    Rounding is that of the times and of the previous step, which may be all there is at t = 0. A
    breakpoint counts as reached when it is so near that no step there could be told from none.
    """
    controller = ctx.controller
    t0 = ctx.t0
    time_left = (t - t0) - ctx.time_low
    size = max(max(abs(t), abs(t0)), abs(controller.previous_length))
    close = SHORTEST if t == controller.stop else TIME_TOLERANCE
    return 0.0 if abs(time_left) <= close * size or time_left * controller.next_length < 0.0 else time_left


@compiled
def within(ctx, h):
    """Return the length of a step, no longer than `Controller.longest` and not beyond `Controller.stop`."""
    longest, stop = ctx.controller.longest, ctx.controller.stop
    if abs(h) > longest:
        h = longest if h > 0.0 else -longest
    if abs(stop) < INFINITY:
        time_left = remaining(ctx, stop)
        if abs(h) > abs(time_left):
            h = time_left
    return h


@compiled
def solve_adaptive(ctx):
    """Solve the step ahead with a length that the tolerance allows; `Context.h` is its length."""
    if ctx.solved:
        return DONE
    ctx.events.seen = ctx.events.acting = 0
    if ctx.pace.code:
        return solve_at_pace(ctx)
    if ctx.implicit.slow >= max(ctx.implicit.held, LIMITED_STEPS):
        if ctx.implicit.code == 0:
            return request_solver(ctx)
        switch_to_implicit(ctx)
    begin_attempts(ctx)
    return attempt_on(ctx)


@compiled
def go_on_attempting(ctx):
    """As `solve_adaptive` where that has come back with NOISY and it is no noise: as if it had not."""
    if ctx.solved:
        return DONE
    if ctx.discontinuities.undone:
        undo(ctx)
        begin_attempts(ctx)
    return attempt_on(ctx)


@compiled
def attempt_on(ctx):
    """Attempt the step ahead until it is good enough; the outcome."""
    controller = ctx.controller
    failure = UNDERFLOW
    while True:
        if enter(ctx) != DONE:
            return SLIDING
        h = within(ctx, controller.next_length)
        too_short = not is_distinct(h, ctx.t0)
        if (
            (too_short or controller.attempts > 0)
            and failure == UNDERFLOW
            and ctx.estimate.asks == 1
            and ctx.estimate.rescaled == 0
        ):
            hopeless = (
                too_short
                or controller.attempts >= MOST_ATTEMPTS
                or abs(h) < SHORTEST_PART * controller.interval
            )
            if hopeless or (
                controller.attempts > 1 and controller.longest < INFINITY and may_have_stalled(ctx, h)
            ):
                ctx.length = 0.0
                return UNSCALED
        if too_short:
            return failure
        before = ctx.counters.iterations
        implicit = ctx.implicit.active
        outcome = attempt(ctx, h)
        if implicit and ctx.implicit.active == 0:
            set_wait(ctx)
        ctx.solved = UNSOLVED
        if outcome == NOT_KEPT:
            return outcome
        accepted = accepts(ctx, outcome, ctx.counters.iterations - before, implicit)
        if accepted:
            ctx.solved = BY_VALUES
        if may_be_noise(ctx, accepted):
            return NOISY
        if accepted:
            return DONE
        if ctx.discontinuities.undone:
            undo(ctx)
            begin_attempts(ctx)
        failure = UNDERFLOW if outcome == DONE else outcome


@compiled
def may_be_noise(ctx, accepted):
    """Whether to come back for the noise of a field that is called: it may be what keeps steps short.

    Or, where it is known, it adds more in the attempted step than the tolerance allows.
    """
    estimate, controller = ctx.estimate, ctx.controller
    if estimate.called == 0:
        return False
    if estimate.noisy and largest_added(ctx) > max(EVIDENT, NOISE_ALLOWED * controller.allowed_error):
        estimate.noisy = TOO_NOISY
        return True
    if accepted and abs(ctx.h) > SAFETY * abs(controller.previous_length):
        return False
    estimate.troubles += 1
    return estimate.troubles >= estimate.next_look


@compiled
def iterate_to(solver, change):
    """Let the iterations from now on leave such changes, which are noise."""
    solver.stagnation, solver.tolerance = max(STAGNATION, change), max(TOLERANCE, change)
    solver.trusted = max(TRUSTED * TOLERANCE, change)
    solver.log_trusted = binary_log(max(UNTESTED * TOLERANCE, change))
    solver.log_residual = max(LOG_RESIDUAL_VARYING, binary_log(solver.tolerance))


@compiled
def solve_at_pace(ctx):
    """Solve the step ahead, whose length nothing but the density of the steps determines."""
    if not is_distinct(ctx.controller.next_length, ctx.t0):
        return UNDERFLOW
    outcome = attempt(ctx, ctx.controller.next_length)
    ctx.solved = BY_VALUES if outcome == DONE else UNSOLVED
    return outcome


@compiled
def may_have_stalled(ctx, h):
    """Whether steps are so short after many that the field's rounding may be what cuts them."""
    return (
        abs(h) < STALL_PART * ctx.controller.interval
        and ctx.counters.steps >= STALL_CHECK_EVERY
        and ctx.counters.steps % STALL_CHECK_EVERY < STALL_CHECKS
    )


@compiled
def begin_attempts(ctx):
    """Begin to look for the length of the step ahead."""
    ctx.controller.rejected = ctx.controller.attempts = ctx.discontinuities.doubts = 0
    ctx.surfaces.locating = ctx.surfaces.reached = 0


@compiled
def accepts(ctx, outcome, iterations, implicit):
    """Whether the attempted step of length `Context.h` is good enough.

    If it is, `Controller.length_after` is the length of the step after it; else `Controller.next_length`
    is that of the next attempt.
    """
    controller = ctx.controller
    error, quadrature_error, verdict = judge_attempt(ctx, outcome, implicit)
    if verdict == TOO_LONG:
        reject(ctx, outcome, controller.longest_constant / abs(ctx.h), implicit)
        return False
    if verdict == AGAIN:
        retry(ctx, outcome, implicit)
        return False
    most_growth = MOST_GROWTH if controller.attempts == 0 else 1.0
    factor, in_doubt = length_factor(ctx, error, quadrature_error, most_growth, implicit)
    if verdict not in (GOOD, REACHED):
        reject(ctx, outcome, factor, implicit)
        return False
    if in_doubt:
        # A trend of noise would go on for ever: its coefficients do not fall with the length.
        error, quadrature_error = estimate_again(ctx, error, quadrature_error, implicit)
        factor, _ = length_factor(ctx, error, quadrature_error, most_growth, implicit)
    if verdict == REACHED:
        end_on_surface(ctx, factor, iterations, implicit)
    else:
        set_next_length(ctx, factor, iterations, implicit)
    return True


@compiled
def set_next_length(ctx, factor, iterations, implicit):
    """Set the length of the step after the attempted one, which is good enough.

    Parameters
    ----------
    ctx : Context
    factor : float
        That length relative to this one's, as the errors allow.
    iterations : int
        Of this step.
    implicit : int
        Whether the implicit solver made it.
    """
    controller = ctx.controller
    h = ctx.h
    if ctx.estimate.rescaled:
        ctx.estimate.rescaled = SCALE_LASTS if ctx.estimate.borrowed else ctx.estimate.rescaled - 1
    if ctx.discontinuities.doubts >= CONFIRMATIONS and ctx.discontinuities.count:
        controller.length_limit = INFINITY  # what the iteration allowed was for the discontinuity
    controller.length_limit = controller.length_limit * APPROACH
    target = ctx.implicit.target_corrections if implicit else TARGET_ITERATIONS
    factor = as_iterations_allow(factor, target, iterations, abs(h), controller.length_limit)
    if implicit and 1.0 < factor < STEADY:
        factor = 1.0
    elif implicit == 0 and ctx.implicit.strategy != FIXED_POINT:
        count_limited_steps(ctx, factor)
    length = h * (factor if implicit else tabulated_ratio(ctx, factor))
    if ctx.estimate.constant_field and abs(length) > controller.longest_constant:
        length = controller.longest_constant if h > 0.0 else -controller.longest_constant
    controller.length_after = length


@compiled
def retry(ctx, outcome, implicit):
    """Forget the attempted step, whose next attempt is to end on a switching surface."""
    if implicit:
        ctx.counters.implicit_steps -= 1
    ctx.counters.rejections += 1
    ctx.length = 0.0
    if outcome == DONE and ctx.surfaces.across < 0:
        ctx.length, ctx.controller.rejected = ctx.h, 1


@compiled
def end_on_surface(ctx, factor, iterations, implicit):
    """Let the attempted step, which ends on a switching surface, be followed by one as long as was wanted."""
    record(ctx, ctx.t0 + ctx.h, 0.0)
    set_next_length(ctx, factor, iterations, implicit)
    ctx.surfaces.reached = 1
    wanted = ctx.surfaces.length_wanted
    if abs(wanted) > abs(ctx.controller.length_after):
        ctx.controller.length_after = wanted


@compiled
def reject(ctx, outcome, factor, implicit):
    """Set the length of the next attempt, this one's times a factor at most."""
    controller = ctx.controller
    h = ctx.h
    if implicit:
        ctx.counters.implicit_steps -= 1
    if outcome == DONE:
        ctx.length = h
        controller.rejected = 1
    else:
        ctx.length = 0.0
        controller.length_limit = RETREAT * abs(h)
        if outcome in (DIVERGED, SCATTERED):
            factor = RETREAT
    controller.next_length = h * least(factor, SAFETY)
    ctx.counters.rejections += 1
    controller.attempts += 1


@compiled
def take(ctx):
    """Take the step ahead, which is solved."""
    controller, previous = ctx.controller, ctx.previous
    t, low = time_after(ctx.t0, ctx.time_low, ctx.h)
    keep_end(ctx)
    previous.state, ctx.state, ctx.next_state = ctx.state, ctx.next_state, previous.state
    previous.error, ctx.error, ctx.next_error = ctx.error, ctx.next_error, previous.error
    count_step(ctx)
    ctx.n = controller.no_time_scale = 0
    if ctx.estimate.asks < 0:
        ctx.estimate.asks = ctx.estimate.asks + 1 if ctx.estimate.asks < -1 else 1
    ctx.t0 = t
    ctx.time_low = low
    controller.next_length = controller.length_after
    controller.previous_length = ctx.h
    controller.previous_error = controller.error_ahead
    controller.previous_quadrature_error = controller.quadrature_error_ahead
    if ctx.pace.code:
        keep_pace(ctx)
    if ctx.surfaces.code:
        arrive_on_surface(ctx)


@compiled
def arrive_on_surface(ctx):
    """Begin anew where the previous step has ended on a switching surface."""
    surfaces = ctx.surfaces
    surfaces.on_surface = AT_STEP_END if surfaces.reached else 0
    if surfaces.reached:
        surfaces.reached = 0
        ctx.length = ctx.controller.previous_length = 0.0
        ctx.discontinuities.boundary, ctx.discontinuities.resolution = START, 0.0
