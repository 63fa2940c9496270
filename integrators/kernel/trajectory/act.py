"""Events that change the state: a step is taken up to the first, the next begins at the new state.

The part of the step up to the event has been solved to find it. Steps of fixed size are counted from there.
"""

from integrators.kernel.context import ACTS, ANEW, DONE, RENEW, UNSOLVED
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.events import BEGIN_ANEW, CHANGE
from integrators.kernel.simd.memory import call_look
from integrators.kernel.step.advance import looked, solve
from integrators.kernel.step.control import is_distinct
from integrators.kernel.step.finish import commit, finish
from integrators.kernel.step.sums import time_of_step
from integrators.kernel.trajectory.anew import begin_anew

GROWTH_AFTER_ACTION = 1.25  # times that are probably enough to see the next one


@compiled
def look_for_action(ctx):
    """Look for events in the solved step ahead, unless that is done; the outcome."""
    events = ctx.events
    if events.act == 0 or events.seen:
        return DONE
    outcome = call_look(events.code, ctx, events.memory)
    if outcome == ACTS:
        events.acting, outcome = CHANGE, DONE
    if outcome == DONE:
        events.seen = 1
    return outcome


@compiled
def length_to_take(ctx):
    """Return how long the step ahead is, up to the event that ends it."""
    events = ctx.events
    return abs((events.time - ctx.t0) - ctx.time_low if events.acting else ctx.h)


@compiled
def act(ctx):
    """Take the step ahead up to the event that ends it, and go on from where that leads; the outcome."""
    outcome = change(ctx)
    return go_on(ctx) if outcome == DONE else outcome


@compiled
def change(ctx):
    """Take the step ahead up to the event that ends it, and let that change the state; the outcome."""
    events = ctx.events
    start, low = time_of_step(ctx.t0, ctx.time_low, float(ctx.n), ctx.h)
    if is_distinct((events.time - start) - low, start):
        ctx.counters.steps += 1
    elif ctx.implicit.active:
        ctx.counters.implicit_steps -= 1  # it is not taken
    after = ctx.controller.length_after
    events.length_before = ctx.h if abs(ctx.h) > abs(after) else after
    ctx.t0, ctx.time_low, ctx.n, ctx.solved = events.time, 0.0, 0, UNSOLVED
    events.seen, events.acting = 0, CHANGE
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
def step_or_act(ctx, t, within):
    """Take one fixed step, or where an event in it changes the state, only that up to there; the outcome.

    With ``within`` none is taken, and the event happens only if it comes no later than the time ``t``.
    """
    events = ctx.events
    if ctx.solved == UNSOLVED:
        events.seen = events.acting = 0
    outcome = solve(ctx)
    if outcome == DONE and events.seen == 0:
        outcome = finish(ctx)
    if outcome == DONE:
        outcome = look_for_action(ctx)
    if outcome != DONE:
        return outcome
    if events.acting and not (within and (t - events.time) * ctx.h < 0.0):
        outcome = act(ctx)
        return ANEW if outcome == DONE else outcome
    if within:
        return DONE
    outcome = looked(ctx)
    if outcome == DONE:
        commit(ctx)
    return outcome
