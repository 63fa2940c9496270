"""A function at any point of a step: exact, at the end of a partial step of the method itself."""

from integrators.kernel.context import DONE, PART, Context
from integrators.kernel.inside.memory import CACHED
from integrators.kernel.inside.sample import NAN, function, noise_of, part_at, time_at
from integrators.kernel.native.attributes import view
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import call_entry

context = view(Context)


@compiled
def call_steps(search, operation, part, out):
    """Let the compiled steps do an operation on the trajectory; see `integrators.kernel.trajectory.entry`."""
    return call_entry(search.steps, operation, search.own, search.partial, 0, 0, 0, 0, part, 0, out, 0)


@compiled
def forget_states(search):
    """Begin with a new step."""
    for i in range(CACHED):
        search.cache_times[i] = NAN
    search.cache_next = 0
    search.part[1] = 0.0


@compiled
def state_at(ctx, search, t):
    """Return the state at a time, by a partial step of the method; NaN where that fails."""
    if t == search.time:
        return search.step_state
    if t == search.stop:
        return search.stop_state
    for i in range(CACHED):
        if search.cache_times[i] == t:
            return search.cache_states + search.dim * i
    i = search.cache_next
    state = search.cache_states + search.dim * i
    search.cache_next = (i + 1) % CACHED
    search.cache_times[i] = t
    search.part[0] = part_at(search, t)
    partial = context(search.partial)
    outcome = call_steps(search, PART, search.part, state)
    # A partial step that only the implicit solver would solve is none: steps do not change.
    ctx.implicit.wanted = 0
    search.iterations += partial.counters.iterations
    search.evaluations += partial.counters.evaluations
    search.partial_steps += 1
    search.part[1] = search.part[0] if outcome == DONE else 0.0
    partial.counters.iterations = partial.counters.evaluations = partial.counters.restarts = 0
    if outcome != DONE:
        for d in range(search.dim):
            state[d] = NAN
    return state


@compiled
def value_at(ctx, search, x):
    """Return the value of the function at a point, which may be a little beyond the end; NaN: none."""
    t = time_at(search, x)
    if t == search.start:  # where only the sign may be known
        return search.start_value
    if x == 1.0:
        return search.end_value
    return function(ctx, search, t, state_at(ctx, search, t))


@compiled
def noise_at(ctx, search, x):
    """Return how much of the value at a point rounding of the state may account for."""
    t = time_at(search, x)
    return noise_of(ctx, search, t, state_at(ctx, search, t))
