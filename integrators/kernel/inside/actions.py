"""Events that change the state: which comes first in a step, what it makes of the state, and where to go on.

Of the step, the part up to the first of them is taken, by which the event was found. Its function is 0 there,
and the sign that it has next, which rounding hides, is that of its slope along the trajectory from the new
state: so the same zero is not found again. Where the slope is nothing too, the next derivative tells; see
`inside.ahead`.
"""

from integrators.kernel.context import ACCUMULATE, ACTS, DONE, HALTED, RENEW
from integrators.kernel.inside.ahead import RESTS, way_ahead
from integrators.kernel.inside.memory import GOING, NOTED, RAISED, TERMINAL, TINY, UNDEFINED
from integrators.kernel.inside.sample import NAN, function, is_finite, noise_of, sign, spread_state
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import call_field, put, splat8
from integrators.kernel.step.control import SHORTEST, is_distinct
from integrators.kernel.step.sample import read, vectors_of_state

SIMULTANEOUS = 2.0**-49  # times whose relative difference is at most this are the same
RESIDUE = 4.0  # times the function's value at the zero that was found, its value after may be, and is still 0
MOST_AT_ONCE = 1024  # events that change the state at one time are not without end


@compiled
def earlier(search, i, j):
    """Whether occurrence i comes before occurrence j."""
    return (search.hit_times[i] - search.hit_times[j]) * search.sign < 0.0


@compiled
def ends_step(search, i):
    """Whether the step ends at occurrence i: by an action, or as the last one of a terminal event."""
    event = search.hit_events[i]
    if search.actions[event]:
        return True
    if search.limits[event] == 0:
        return False
    number = search.happened[event] + 1
    for j in range(search.first, search.hits):
        if search.hit_events[j] == event and earlier(search, j, i):
            number += 1
    return number == search.limits[event]


@compiled
def note_hit(search, t, event, direction, state, after):
    """Note that an event happens, which makes ``after`` of a state; the parameters then are the new ones."""
    i = search.hits
    search.hit_members[i], search.hit_times[i] = search.member, t
    search.hit_events[i], search.hit_directions[i] = event, direction
    for d in range(search.dim):
        search.hit_states[search.dim * i + d], search.hit_after[search.dim * i + d] = state[d], after[d]
    for j in range(search.parameters):
        search.hit_par[search.parameters * i + j] = search.new_par[j]
    search.hits = i + 1


@compiled
def keep(search, outof, into):
    """Keep an occurrence under another index."""
    search.hit_members[into] = search.hit_members[outof]
    search.hit_times[into] = search.hit_times[outof]
    search.hit_events[into] = search.hit_events[outof]
    search.hit_directions[into] = search.hit_directions[outof]
    for d in range(search.dim):
        search.hit_states[search.dim * into + d] = search.hit_states[search.dim * outof + d]
        search.hit_after[search.dim * into + d] = search.hit_after[search.dim * outof + d]
    for i in range(search.parameters):
        search.hit_par[search.parameters * into + i] = search.hit_par[search.parameters * outof + i]


@compiled
def end_step(ctx, search):
    """Drop what does not happen, as the step ends before it; return ACTS if the step ends, or DONE."""
    first, kept = -1, search.first
    for i in range(search.first, search.hits):
        if (search.hit_times[i] - search.last) * search.sign > 0.0:
            continue
        keep(search, i, kept)
        kept += 1
    search.hits = kept
    for i in range(search.first, search.hits):
        if ends_step(search, i) and (first < 0 or earlier(search, i, first)):
            first = i
    for event in range(search.count):
        search.due[event] = 0
    if first >= 0:
        end, kept = search.hit_times[first], search.first
        for d in range(search.dim):
            search.action_state[d] = search.hit_states[search.dim * first + d]
        ctx.events.time = end
        close = SIMULTANEOUS * abs(end)
        for i in range(search.first, search.hits):
            event, late = search.hit_events[i], (search.hit_times[i] - end) * search.sign
            if late > close:
                continue
            limit = search.limits[event]
            if search.actions[event] or (limit and i == first):
                search.due[event] = 1
                search.due_directions[event] = search.hit_directions[i]
            else:
                keep(search, i, kept)
                kept += 1
                if late >= -close:
                    search.due[event] = NOTED
        search.hits = kept
    for i in range(search.first, search.hits):
        search.happened[search.hit_events[i]] += 1
    return DONE if first < 0 else ACTS


@compiled
def make(ctx, search, event):
    """Make the new state and parameters by the event's action; return GOING, or why there are none."""
    dim, count, outputs = search.dim, search.parameters, search.action_outputs
    spread_state(search, search.time, search.new_state)
    for i in range(count):  # an action that changes none writes none
        outputs[8 * (dim + i)] = search.new_par[i]
    outputs[8 * (dim + count)] = 0.0
    call_field(search.actions[event], search.times, search.block, search.new_par, outputs)
    if outputs[8 * (dim + count)] != 0.0:
        search.raised = -1 - event
        return RAISED
    for i in range(dim + count):
        if not is_finite(outputs[8 * i]):
            search.event = event
            return UNDEFINED
    for d in range(dim):
        search.new_state[d] = outputs[8 * d]
    for i in range(count):
        search.new_par[i] = outputs[8 * (dim + i)]
    return GOING


@compiled
def put_state(ctx, given):
    """Let a state be the present one."""
    for i in range(vectors_of_state(ctx)):
        put(ctx.state, 8 * i, splat8(0.0))
        put(ctx.error, 8 * i, splat8(0.0))
    read(ctx, ctx.state, given)


@compiled
def has_new_parameters(ctx, search):
    """Whether the parameters have changed."""
    changed = False
    for i in range(search.parameters):
        changed = changed or search.new_par[i] != ctx.par[i]
    return changed


@compiled
def change_state(ctx, search):
    """Note what happens at the end of the step, and change the state; DONE, RENEW, ACCUMULATE or HALTED."""
    put_state(ctx, search.action_state)
    for d in range(search.dim):
        search.new_state[d] = search.step_state[d] = search.action_state[d]
    for i in range(search.parameters):
        search.new_par[i] = ctx.par[i]
    for event in range(search.count):
        search.event = event
        search.values_before[event] = function(ctx, search, search.time, search.step_state)
    halted = False
    for event in range(search.count):
        if search.due[event] != 1:
            continue
        if search.actions[event] and note_time(ctx, search, event):
            return ACCUMULATE
        search.happened[event] += 1
        if search.happened[event] == search.limits[event]:
            halted = True
        else:
            search.halted = make(ctx, search, event)
            if search.halted != GOING:
                return HALTED
        note_hit(
            search, search.time, event, search.due_directions[event], search.step_state, search.new_state
        )
    if halted:
        search.halted = TERMINAL
        return HALTED
    put_state(ctx, search.new_state)
    return RENEW if has_new_parameters(ctx, search) else DONE


@compiled
def follows_itself(search, event):
    """Whether no other event has changed the state since an event did so last."""
    for other in range(search.count):
        if other != event and (search.recent[3 * other] - search.recent[3 * event]) * search.sign >= 0.0:
            return False
    return True


@compiled
def accumulates(search, event):
    """Whether the present occurrence of an event is one of endlessly many that tend to a time.

    It cannot be told from the one before. If no other event has happened since, the time between the two is
    shorter than rounding. Else the intervals must shrink geometrically, by the last two of them, to a limit
    here: in a corner an event may happen twice at a time, between others.
    """
    recent = search.recent + 3 * event
    shortest = SHORTEST * abs(search.time)
    if abs(search.time - recent[0]) > shortest or not is_finite(recent[0]):
        return False
    interval, before = abs(recent[0] - recent[1]), abs(recent[1] - recent[2])
    return follows_itself(search, event) or (interval < before and interval * (interval / before) <= shortest)


@compiled
def note_time(ctx, search, event):
    """Note that an event changes the state now; return whether it does so without end."""
    if is_distinct(search.time - ctx.events.acted, search.time):
        ctx.events.repeated = 0
    ctx.events.repeated += 1
    if accumulates(search, event) or ctx.events.repeated > MOST_AT_ONCE:
        return True
    recent = search.recent + 3 * event
    recent[2], recent[1], recent[0] = recent[1], recent[0], search.time
    return False


@compiled
def begin_anew(ctx, search):
    """Set what is known of the functions at the new state; ACCUMULATE if the trajectory stays there."""
    t, state = search.time, search.step_state
    search.known = t
    for event in range(search.count):
        search.event = event
        value = function(ctx, search, t, state)
        noise = noise_of(ctx, search, t, state)
        before = search.values_before[event]
        search.touched[event] = NAN
        if search.due[event]:
            arrived = search.due_directions[event] if search.due[event] == 1 else 0
            at_zero, way = way_ahead(ctx, search, value, noise + RESIDUE * abs(before), noise, arrived)
            if way == RESTS:
                return ACCUMULATE
            if at_zero:
                value = TINY * way
        elif abs(value) <= noise:
            value = TINY * sign(before if abs(before) > noise else search.ends[event])
        search.ends[event] = value
        search.due[event] = 0
    if search.raised:
        search.halted = RAISED
        return HALTED
    return DONE
