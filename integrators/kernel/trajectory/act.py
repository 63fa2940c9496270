"""Events that change the state: steps end where one happens, and the next begins from the new state.

An adaptive step is solved anew to the event. Of a fixed step, the part up to the event is taken, which the
search has solved to find it, and steps of the same size are counted from there.
"""

from integrators.kernel.context import ACTS, ANEW, BY_VALUES, DONE, RENEW, UNSOLVED
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.events import BEGIN_ANEW, CHANGE
from integrators.kernel.simd.memory import call_look
from integrators.kernel.step.advance import looked, solve
from integrators.kernel.step.begin import begin
from integrators.kernel.step.control import is_distinct
from integrators.kernel.step.finish import commit, finish
from integrators.kernel.step.iterate import iterate_to_end
from integrators.kernel.trajectory.anew import begin_anew
from integrators.kernel.trajectory.vary import attempt, take

GROWTH_AFTER_ACTION = 1.25  # times that are probably enough to see the next one


@compiled
def end_at_action(ctx):
    """Look for events in the solved step ahead, and solve it anew to the first that changes the state.

    One that is at its start happens there at once, and the step is to be solved again from the new state.
    """
    events = ctx.events
    outcome = call_look(events.code, ctx, events.memory)
    if outcome == DONE:
        events.seen = 1
    if outcome == ACTS:
        outcome = solve_to_action(ctx)
        if outcome == DONE and ctx.solved == UNSOLVED:
            outcome = act(ctx)
    return outcome


@compiled
def solve_to_action(ctx):
    """Solve the step ahead anew to the event in it that ends it, unless that is at its start; the outcome."""
    events, controller = ctx.events, ctx.controller
    events.length_before = ctx.h if abs(ctx.h) > abs(controller.length_after) else controller.length_after
    part = (events.time - ctx.t0) - ctx.time_low
    if not is_distinct(part, ctx.t0):
        if ctx.implicit.active:
            ctx.counters.implicit_steps -= 1  # it is not taken
        ctx.solved, events.acting = UNSOLVED, CHANGE
        return DONE
    if part != ctx.h:
        ctx.length, controller.rejected = ctx.h, 1
        ctx.solved = UNSOLVED
        if ctx.implicit.active:
            ctx.counters.implicit_steps -= 1  # it is one step
        outcome = attempt(ctx, part)
        controller.rejected = 0
        if outcome != DONE and ctx.implicit.active == 0:
            outcome = insist(ctx)
        if outcome != DONE:
            return outcome
        ctx.solved = BY_VALUES
        ctx.surfaces.reached = 0
    events.seen, events.acting = 1, CHANGE
    return DONE


@compiled
def insist(ctx):
    """Iterate as long as it takes on a step that `attempt` has given up where a shorter one is cheaper."""
    ctx.length = 0.0
    begin(ctx)
    outcome = iterate_to_end(ctx)
    return finish(ctx) if outcome == DONE else outcome


@compiled
def end_and_change(ctx):
    """Take the solved step up to the event in it that ends it, and let that change the state; the outcome."""
    outcome = solve_to_action(ctx)
    if outcome != DONE:
        return outcome
    if ctx.solved != UNSOLVED:  # the event is not at the start of the step
        take(ctx)
    return change(ctx)


@compiled
def act(ctx):
    """Go on from the state that an event at the end of the previous step makes; the outcome."""
    outcome = change(ctx)
    return go_on(ctx) if outcome == DONE else outcome


@compiled
def change(ctx):
    """Let the event that has ended the previous step change the state; the outcome."""
    events = ctx.events
    ctx.t0, ctx.time_low = events.time, 0.0
    outcome = call_look(events.code, ctx, events.memory)
    if outcome in (DONE, RENEW):
        events.acting = BEGIN_ANEW
    return outcome


@compiled
def go_on(ctx):
    """Begin at the state that an event has made, and let the search for events begin there; the outcome."""
    controller, events = ctx.controller, ctx.events
    if ctx.varying:
        controller.next_length, controller.previous_length = length_after_action(ctx), 0.0
    events.acted = ctx.t0
    begin_anew(ctx)
    outcome = call_look(events.code, ctx, events.memory)
    events.acting = 0
    return outcome


@compiled
def length_after_action(ctx):
    """Return the length of a step after such an event: not much more than the time since the last one.

    Beyond the next one a field may be another one, and what happens before is a small part of a long step.
    """
    events = ctx.events
    length, since = events.length_before, GROWTH_AFTER_ACTION * (ctx.t0 - events.acted)
    return since if abs(since) < abs(length) else length


@compiled
def look_ahead(ctx):
    """Solve the fixed step ahead and look for events in it, unless that is done; the outcome."""
    events = ctx.events
    if ctx.solved == UNSOLVED:
        events.seen = events.acting = 0
    outcome = solve(ctx)
    if outcome != DONE or events.seen:
        return outcome
    outcome = finish(ctx)
    if outcome == DONE:
        outcome = call_look(events.code, ctx, events.memory)
    if outcome == ACTS:
        events.acting, outcome = CHANGE, DONE
    if outcome == DONE:
        events.seen = 1
    return outcome


@compiled
def step_or_act(ctx, t, within):
    """Take one fixed step, or where an event in it changes the state, only that up to there; the outcome.

    With ``within`` none is taken, and the event happens only if it comes no later than the time ``t``.
    """
    events = ctx.events
    outcome = look_ahead(ctx)
    if outcome != DONE:
        return outcome
    if events.acting and not (within and (t - events.time) * ctx.h < 0.0):
        return act_within(ctx)
    if within:
        return DONE
    outcome = looked(ctx)
    if outcome == DONE:
        commit(ctx)
    return outcome


@compiled
def act_within(ctx):
    """Let the event within the fixed step ahead change the state, and go on from there; the outcome."""
    events = ctx.events
    ctx.n, ctx.solved, events.seen = 0, UNSOLVED, 0
    ctx.counters.steps += 1
    outcome = act(ctx)
    return ANEW if outcome == DONE else outcome
