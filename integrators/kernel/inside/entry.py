"""What the steps call when a step is solved: the one C function of the search for events."""

from integrators.kernel.context import DONE, HALTED
from integrators.kernel.inside.actions import (
    begin_anew,
    change_state,
    end_step,
    note_hit,
)
from integrators.kernel.inside.ahead import way_ahead
from integrators.kernel.inside.chebyshev import keep_samples, keeps_away, refine, suspect, transform
from integrators.kernel.inside.memory import (
    FINEST,
    FULL,
    GOING,
    PART,
    RAISED,
    START,
    TERMINAL,
    TINY,
    UNRESOLVED,
    UNSOLVABLE,
    WHOLE,
    Search,
)
from integrators.kernel.inside.sample import (
    NAN,
    function,
    is_finite,
    noise_of,
    sample,
    sample_first,
    sign,
    time_at,
    weigh_first,
)
from integrators.kernel.inside.series import take_series
from integrators.kernel.inside.value import context, forget_states, noise_at, state_at, value_at
from integrators.kernel.inside.zeros import find_zeros
from integrators.kernel.native.attributes import view
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.events import CHANGE
from integrators.kernel.simd.lanes import two_sum
from integrators.kernel.step.sample import write
from integrators.kernel.step.sums import time_of_step
from problems.analysis.roundoff import UNIT

DEEPEST = 8  # times that a step is halved where samples do not resolve a function
ISOLATED = 16  # changes of sign in a part that is not resolved: a pole, a jump or a corner makes fewer
NOISE_FACTOR = 4.0  # times the rounding of one state: what many steps leave of a g that vanishes all along
SHORTEST = 1e-6  # of a step is more than a unit in the last place of time: else there is no point inside
SAME = 1e-5  # of a step: a touch as close to another zero is none of its own

searching = view(Search)


@compiled
def entry(address, memory):
    """Look for events in what `Search.mode` names; return DONE, or HALTED as `Search.halted` says."""
    ctx, search = context(address), searching(memory)
    search.halted = GOING
    search.raised = 0
    set_start(ctx, search)
    if search.mode == WHOLE and ctx.events.acting:
        return change_state(ctx, search) if ctx.events.acting == CHANGE else begin_anew(ctx, search)
    if search.mode == START:
        begin(ctx, search)
        return HALTED if search.raised else DONE
    if not set_end(ctx, search):
        search.halted = UNSOLVABLE
        return HALTED
    search.first = search.hits
    for event in range(search.count):
        search.touched_before[event] = search.touched[event]
    search.halted = look(ctx, search)
    if ctx.events.act and search.halted == GOING and search.room - search.hits < search.count:
        search.halted = FULL
    if search.halted != GOING:
        search.hits = search.first  # what is known of a step is all or nothing
        for event in range(search.count):
            search.touched[event] = search.touched_before[event]
        return HALTED
    if ctx.events.act:
        outcome = end_step(ctx, search)
        if outcome == DONE:
            keep_ends(search)
        return outcome
    return close(search)


@compiled
def set_start(ctx, search):
    """Set the time and the state of the last step."""
    search.time, search.time_low = time_of_step(ctx.t0, ctx.time_low, float(ctx.n), ctx.h)
    write(ctx, ctx.state, search.step_state)


@compiled
def set_end(ctx, search):
    """Set the time and the state up to which is looked; return whether there is one."""
    forget_states(search)
    if search.mode == PART:
        search.stop = NAN
        state = state_at(ctx, search, search.goal)
        for d in range(search.dim):
            search.stop_state[d] = state[d]
        search.stop = search.goal
        return is_finite(search.stop_state[0])
    if ctx.varying:
        stop, low = two_sum(ctx.t0, ctx.h)
        search.stop = stop + (low + ctx.time_low)
    else:
        search.stop = ctx.t0 + (ctx.n + 1) * ctx.h
    write(ctx, ctx.next_state, search.stop_state)
    return True


@compiled
def begin(ctx, search):
    """Set what is known of the functions at the start: a zero there is no event, unless it is due.

    It is due where it is said to happen again, and where an event changes the state whose function goes on in
    its one direction. One that has happened there before is no longer close to zero if the state has been set
    anew since.
    """
    weigh_first(ctx, search)
    for event in range(search.count):
        search.event = event
        value = function(ctx, search, search.time, search.step_state)
        noise = noise_of(ctx, search, search.time, search.step_state)
        search.ends[event] = 0.0 if abs(value) <= noise else value
        own = search.actions[event] != 0 and search.directions[event] != 0 and abs(value) <= noise
        if search.due[event] or own:
            at_zero, way = way_ahead(ctx, search, value, noise, noise, 0)
            if search.due[event] == 1 or (search.due[event] == 0 and way == search.directions[event]):
                search.ends[event] = -TINY * way
            elif at_zero:
                search.ends[event] = TINY * way
            search.due[event] = 0
        search.finite[event] = 1 if is_finite(value) else 0
        search.touched[event] = NAN
        for i in range(3):
            search.recent[3 * event + i] = NAN
    search.known = search.time


@compiled
def close(search):
    """Count what has happened; return HALTED at the last occurrence of a terminal event."""
    keep_ends(search)
    for i in range(search.first, search.hits):
        event = search.hit_events[i]
        search.happened[event] += 1
        if search.happened[event] == search.limits[event]:
            search.halted = TERMINAL
    return DONE if search.halted == GOING else HALTED


@compiled
def keep_ends(search):
    """Keep what is known at the end of what was looked at."""
    for event in range(search.count):
        search.ends[event] = search.sampled[FINEST * event + search.degree - 1]
    search.known = search.stop


@compiled
def look(ctx, search):
    """Find the events up to `Search.stop`; return GOING or why that could not be done."""
    take_series(ctx, search)
    whole(ctx, search)
    sample_first(ctx, search)
    degree = search.degree
    for event in range(search.count):
        search.event = event
        search.start_value = search.ends[event]
        search.values[0] = search.start_value
        for i in range(degree):
            search.values[1 + i] = search.sampled[FINEST * event + i]
        search.end_value = search.values[degree]
        if search.finite[event] == 0:
            for i in range(degree + 1):
                if is_finite(search.values[i]):
                    search.finite[event] = 1
        outcome = examine(ctx, search)
        if search.raised:
            return RAISED
        if outcome != GOING:
            return outcome
    return GOING


@compiled
def whole(ctx, search):
    """Look at all that is to be looked at."""
    stretch(ctx, search, 0, FINEST)


@compiled
def stretch(ctx, search, first, last):
    """Look at so many 256ths of what is to be looked at."""
    length = search.stop - search.time
    search.start = search.time if first == 0 else search.time + first / FINEST * length
    search.end = search.stop if last == FINEST else search.time + last / FINEST * length
    state = state_at(ctx, search, search.start)
    for d in range(search.dim):
        search.start_state[d] = state[d]
    state = state_at(ctx, search, search.end)
    for d in range(search.dim):
        search.end_state[d] = state[d]
    size = max(abs(search.start), abs(search.end))
    search.resolution = UNIT * size / abs(search.end - search.start)


@compiled
def examine(ctx, search):
    """Find the zeros of a function whose first samples are in `Search.values`."""
    degree = search.degree
    finite, unresolved = transform(search, degree)
    if finite and not unresolved and keeps_away(search, degree):
        return GOING
    note_samples(search, degree, finite)
    if not (unresolved or suspect(search)):
        return GOING
    if vanishes(ctx, search):  # the sign at its end is rounding's: that before it lasts
        search.sampled[FINEST * search.event + degree - 1] = TINY * sign(search.start_value)
        return GOING
    while unresolved and degree < FINEST and search.resolution < SHORTEST:
        degree = min(4 * degree, FINEST)
        sample(ctx, search, degree)
        finite, unresolved = transform(search, degree)
        note_samples(search, degree, finite)
    if unresolved and search.resolution < SHORTEST:
        return divide(ctx, search)
    return find_events(ctx, search, degree, unresolved)


@compiled
def note_samples(search, degree, finite):
    """Set what is known of a function from its samples and their coefficients."""
    if finite:
        refine(search, degree)
    else:
        keep_samples(search, degree)


@compiled
def divide(ctx, search):
    """Find the zeros in parts of the step that are halved until the samples resolve them."""
    first, size, start_value = 0, FINEST // 2, search.start_value
    while first < FINEST:
        stretch(ctx, search, first, first + size)
        search.start_value = start_value
        search.end_value = function(ctx, search, search.end, search.end_state)
        sample(ctx, search, FINEST)
        finite, unresolved = transform(search, FINEST)
        note_samples(search, FINEST, finite)
        suspect(search)
        if vanishes(ctx, search):
            start_value = TINY * sign(start_value)
        else:
            if unresolved and size > 1 and search.resolution < SHORTEST:
                size //= 2
                continue
            outcome = find_events(ctx, search, FINEST, unresolved)
            if outcome != GOING:
                return outcome
            start_value = search.end_value
        first += size
        while size < FINEST // 2 and first % (2 * size) == 0:
            size *= 2
    search.sampled[FINEST * search.event + search.degree - 1] = start_value
    whole(ctx, search)
    return GOING


@compiled
def vanishes(ctx, search):
    """Whether the function is no more than rounding all along: at both ends, and where it is largest."""
    if not (is_nothing(ctx, search, 0.0) and is_nothing(ctx, search, 1.0)):
        return False
    top = -1
    for i in range(search.n):
        inside = search.points[i] > 0.0 and search.points[i] < 1.0
        if inside and (top < 0 or abs(search.fine[i]) > abs(search.fine[top])):
            top = i
    largest = search.points[top] if top >= 0 else 0.5
    return is_nothing(ctx, search, largest) and is_nothing(ctx, search, 0.5)


@compiled
def is_nothing(ctx, search, x):
    """Whether the value at a point may be rounding's."""
    return abs(value_at(ctx, search, x)) <= NOISE_FACTOR * noise_at(ctx, search, x)


@compiled
def find_events(ctx, search, degree, unresolved):
    """Find the zeros in the stretch, and note what happens there."""
    if unresolved:
        keep_samples(search, degree)
        changes = 0
        for i in range(search.n - 1):
            if sign(search.fine[i]) != sign(search.fine[i + 1]):
                changes += 1
        if changes > ISOLATED:
            return UNRESOLVED
    if not suspect(search):
        return GOING
    find_zeros(ctx, search)
    for i in range(search.zero_count):
        if not note(ctx, search, search.zeros[i], search.zero_directions[i]):
            return FULL
    return GOING


@compiled
def note(ctx, search, x, direction):
    """Note a zero, unless it is in another direction than wanted; return whether there was room."""
    event = search.event
    t = time_at(search, x)
    # A touch at the end of a step is seen from both sides, and so may be a crossing by its own rounding.
    again = abs(t - search.touched[event]) < SAME * abs(search.stop - search.time)
    search.touched[event] = t
    if direction == 0 and again:
        return True
    if search.directions[event] != 0 and search.directions[event] != direction:
        return True
    if search.hits == search.room:
        return False
    state = state_at(ctx, search, t)
    note_hit(search, t, event, direction, state, state)
    return True
