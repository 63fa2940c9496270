"""Events that change the state: steps end where one happens, and the next begins from the new state."""

from integrators.kernel.context import ACCUMULATE, ACTS, BY_VALUES, DONE, UNSOLVED
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.events import BEGIN_ANEW, CHANGE
from integrators.kernel.simd.memory import call_look
from integrators.kernel.step.control import is_distinct
from integrators.kernel.step.vary import attempt

ONWARD = 1.25  # times that are probably enough to see the next one


@compiled
def end_at_action(ctx):
    """Look for events in the solved step ahead, and solve it anew to the first that changes the state."""
    events, controller = ctx.events, ctx.controller
    outcome = call_look(events.code, ctx, events.memory)
    if outcome == DONE:
        events.seen = 1
    if outcome != ACTS:
        return outcome
    part = (events.time - ctx.t0) - ctx.time_low
    if not is_distinct(part, ctx.t0):
        return ACCUMULATE
    events.length_before = ctx.h if abs(ctx.h) > abs(controller.length_after) else controller.length_after
    if part != ctx.h:
        ctx.length, controller.rejected = ctx.h, 1
        ctx.solved = UNSOLVED
        if ctx.implicit.active:
            ctx.counters.implicit_steps -= 1  # it is one step
        outcome = attempt(ctx, part)
        controller.rejected = 0
        if outcome != DONE:
            return outcome
        ctx.solved = BY_VALUES
        ctx.surfaces.reached = 0
    events.seen, events.acting = 1, CHANGE
    return DONE


@compiled
def change(ctx):
    """Let the event that has ended the step behind change the state; the outcome."""
    events = ctx.events
    ctx.t0, ctx.time_low = events.time, 0.0
    outcome = call_look(events.code, ctx, events.memory)
    if outcome == DONE:
        events.acting = BEGIN_ANEW
    return outcome


@compiled
def length_after_action(ctx):
    """Return the length of a step after such an event: not much more than the time since the last one.

    Beyond the next one a field may be another one, and what happens before is a small part of a long step.
    """
    events = ctx.events
    length, since = events.length_before, ONWARD * (ctx.t0 - events.acted)
    events.acted = ctx.t0
    return since if abs(since) < abs(length) else length


@compiled
def begin_events(ctx):
    """Let the search for events begin at the new state; the outcome."""
    events = ctx.events
    outcome = call_look(events.code, ctx, events.memory)
    events.acting = 0
    return outcome
