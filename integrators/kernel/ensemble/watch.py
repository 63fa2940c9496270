"""Events of trajectories in lanes: they are looked for in one lane after another, as of a single trajectory.

A step that is good enough is shown to the lane's own `Context`, which then has all that the search for events
(`integrators.kernel.inside`) and the actions (`integrators.kernel.trajectory.act`) ask for. Most steps have
been taken by then (`integrators.kernel.ensemble.control`); where an event ends one, its start is still known.
One search does for all lanes: what of it lasts from step to step is each lane's own. Where a single
trajectory would need Python, for the reason of a failure or for more room, the trajectory leaves its lane and
goes by itself.
"""

from integrators.kernel.context import ACCUMULATE, ACT, ACTS, BY_VALUES, DONE, GO_ON, HALTED, RENEW
from integrators.kernel.ensemble.group import ACCUMULATES, BY_EVENT, LEFT
from integrators.kernel.ensemble.lane import clear, context_at, fetch, unload, write, write_until
from integrators.kernel.inside.actions import earlier, keep
from integrators.kernel.inside.discontinuities import differs_at_an_end
from integrators.kernel.inside.memory import START, TERMINAL, WHOLE, Search
from integrators.kernel.inside.value import call_steps
from integrators.kernel.native.attributes import view
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.discontinuities import EXTRAPOLATED, NOTHING
from integrators.kernel.simd.memory import call_look, get, put
from integrators.kernel.step.begin import INFINITY, set_factors
from integrators.kernel.step.estimate import estimate
from integrators.kernel.step.rule import FIRST_RATE
from integrators.kernel.step.stages import place
from integrators.kernel.trajectory.vary import begin_attempts

search_at = view(Search)


@compiled
def has_room(group):
    """Whether a step of all lanes can note what happens in it."""
    return 2 * search_at(group.search).hits <= group.room


@compiled
def keep_start(group):
    """Keep where all lanes are before a step."""
    for i in range(group.lanes // 8):
        put(group.start_t0, 8 * i, get(group.t0, 8 * i))
        put(group.start_time_low, 8 * i, get(group.time_low, 8 * i))
    for i in range(group.dim * group.lanes // 8):
        put(group.start_state, 8 * i, get(group.state, 8 * i))
        put(group.start_error, 8 * i, get(group.error, 8 * i))


@compiled
def turn_to(group, lane):
    """Let the search look into a lane, and return it."""
    search, first = search_at(group.search), group.events * lane
    search.own, search.partial = group.contexts[lane], group.partials[lane]
    search.ends, search.touched = group.function_values + first, group.function_zeros + first
    search.finite, search.happened = group.function_finite + first, group.happened + first
    search.recent = group.recent + 3 * first
    search.member, search.room = group.member[lane], search.hits + group.room // (2 * group.lanes)
    return search


@compiled
def look_at_start(group, lane, ctx):
    """Begin to look for events at a trajectory's start; return whether all functions have values there."""
    search, partial = turn_to(group, lane), context_at(group.partials[lane])
    for i in range(group.parameters):
        partial.par[i] = ctx.par[i]
    for d in range(group.rows):
        b = ctx.blocks.of_row[d]
        partial.factors.velocity[d] = ctx.factors.velocity[d]
        partial.blocks.speed[b], partial.blocks.mass[b] = ctx.blocks.speed[b], ctx.blocks.mass[b]
    for i in range(group.events):
        search.happened[i] = search.due[i] = 0
    ctx.events.acting, ctx.events.acted = 0, -search.sign * INFINITY
    search.mode = START
    outcome = call_look(ctx.events.code, ctx, group.search)
    search.mode = WHOLE
    return outcome == DONE


@compiled
def watch(group, lane, ctx):
    """Look for events in the step of a lane, which is good enough; return whether it is to be taken whole."""
    outcome = look(group, lane, ctx)
    if outcome != DONE:
        end_step(group, lane, ctx, outcome)
    return outcome == DONE


@compiled
def watch_ordinary(group, lane):
    """Look for events in a step that has been taken with all others; return whether it stays taken."""
    ctx = context_at(group.contexts[lane])
    controller, discontinuities = ctx.controller, ctx.discontinuities
    ctx.t0, ctx.time_low = group.start_t0[lane], group.start_time_low[lane]
    ctx.h = group.previous_length[lane]
    fetch(group, lane, ctx)
    outcome = look(group, lane, ctx)
    if outcome == DONE:
        return True
    ctx.counters.steps += int(group.since[lane]) - 1
    group.since[lane] = group.ordinary[lane] = 0.0
    controller.next_length, controller.length_after = ctx.h, group.h[lane]
    controller.length_limit = group.length_limit[lane]
    estimate(ctx)  # which notes what is known of the field at both ends
    discontinuities.boundary = NOTHING
    discontinuities.next_boundary = EXTRAPOLATED if discontinuities.doubt < INFINITY else NOTHING
    end_step(group, lane, ctx, outcome)
    return False


@compiled
def look(group, lane, ctx):
    """Look for events in the solved step of a lane; the outcome, DONE if nothing ends it."""
    turn_to(group, lane)
    show(group, lane, ctx)
    return call_look(ctx.events.code, ctx, group.search)


@compiled
def end_step(group, lane, ctx, outcome):
    """Do what a look asks for that ends the step, or the search."""
    search = search_at(group.search)
    terminal = outcome == HALTED and search.halted == TERMINAL
    # What ends the step must not be found in one that a jump beyond its nodes would undo.
    if not (terminal or outcome == ACTS) or (
        ctx.discontinuities.next_boundary == EXTRAPOLATED and differs_at_an_end(ctx)
    ):
        unload(group, lane, LEFT)
    elif terminal:
        last = find_last(search)
        write_until(group, lane, search.hit_times[last], search.sign)
        end_by_event(group, lane, search, last)
    else:
        act(group, lane, ctx, search)


@compiled
def show(group, lane, ctx):
    """Let the context of a lane have the solved step as that of a single trajectory has it."""
    set_factors(ctx, ctx.h)
    for d in range(group.dim):
        ctx.state[place(ctx, d)] = group.start_state[group.lanes * d + lane]
        ctx.error[place(ctx, d)] = group.start_error[group.lanes * d + lane]
    ctx.solver.rate = group.rate[lane]
    ctx.solved, ctx.n, ctx.blocks.age = BY_VALUES, 0, 0


@compiled
def comes_before(search, i, j):
    """Whether occurrence i comes before occurrence j, or at the same time and was found before."""
    return earlier(search, i, j) or (i < j and not earlier(search, j, i))


@compiled
def is_last(search, i):
    """Whether occurrence i is the one with which its event ends the trajectory."""
    event = search.hit_events[i]
    number = search.happened[event]  # those of this step are counted already
    for j in range(search.first, search.hits):
        if search.hit_events[j] == event and comes_before(search, i, j):
            number -= 1
    return search.limits[event] > 0 and number == search.limits[event]


@compiled
def find_last(search):
    """Return the first occurrence that ends the trajectory."""
    last = -1
    for i in range(search.first, search.hits):
        if is_last(search, i) and (last < 0 or comes_before(search, i, last)):
            last = i
    return last


@compiled
def end_by_event(group, lane, search, last):
    """End a trajectory with an occurrence; what would have happened after it has not."""
    end, event, kept = search.hit_times[last], search.hit_events[last], search.first
    for i in range(search.first, search.hits):
        late = (search.hit_times[i] - end) * search.sign
        if late < 0.0 or (late == 0.0 and i <= last):
            keep(search, i, kept)
            kept += 1
    search.hits = kept
    group.stops[group.member[lane]] = end
    unload(group, lane, BY_EVENT + event)


@compiled
def act(group, lane, ctx, search):
    """Take the step of a lane up to the event that ends it, and go on from the state that the event makes."""
    controller, wanted = ctx.controller, ctx.controller.next_length
    if ctx.h != wanted and abs(controller.length_after) < abs(wanted):
        controller.length_after = wanted  # it was to end at a sample: what comes after need not be as short
    outcome = call_steps(search, ACT, search.part, search.action_state)
    if outcome == RENEW and group.renews:
        renew(group, lane, ctx, search)
        outcome = DONE
    if outcome == DONE:
        outcome = call_steps(search, GO_ON, search.part, search.action_state)
    if outcome == HALTED and search.halted == TERMINAL:
        end_by_event(group, lane, search, find_last(search))
        return
    if outcome == DONE:
        begin_again(group, lane, ctx)
        return
    group.stops[group.member[lane]] = ctx.t0
    unload(group, lane, ACCUMULATES if outcome == ACCUMULATE else LEFT)


@compiled
def renew(group, lane, ctx, search):
    """Let the parameters that an event has made be those of a lane."""
    partial = context_at(group.partials[lane])
    for i in range(group.parameters):
        value = search.new_par[i]
        ctx.par[i] = partial.par[i] = group.par[group.lanes * i + lane] = value


@compiled
def begin_again(group, lane, ctx):
    """Let the trajectory of a lane begin at the state of its context."""
    for d in range(group.dim):
        group.state[group.lanes * d + lane] = ctx.state[place(ctx, d)]
        group.error[group.lanes * d + lane] = 0.0
    clear(group, lane)
    group.rate[lane] = FIRST_RATE
    begin_attempts(ctx)
    write(group, lane, ctx)
