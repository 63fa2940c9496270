"""Where a function goes that is 0 at the present state: the sign that it has next.

It is that of its first derivative along the trajectory that does not vanish, of the first two. Rounding hides
a derivative over a short time; then it is looked at over a longer one.
"""

from integrators.kernel.context import VALUES
from integrators.kernel.inside.sample import function, is_finite, sign
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.memory import call_field, call_line
from integrators.kernel.step.control import SHORTEST

SHORT = 2.0**-10  # of a step, which tells the slope
LONGER, MOVES = 2.0**5, 3  # where it does not, so many moves do, each as many times longer
RESTS = 2  # no sign: the trajectory is pressed to the surface that it has reached, and stays there


@compiled
def add_slope(ctx, search, t, state, base, move, into):
    """Set ``into`` to ``base`` and ``move`` times the derivative of a state; whether that is finite."""
    lanes, rows, values = ctx.lanes, ctx.rows, ctx.scratch.sums
    for block in range(ctx.calls if ctx.line else 1):
        for lane in range(lanes):
            ctx.times[lanes * block + lane] = t
            for d in range(rows):
                ctx.stages[lanes * (ctx.padded * block + d) + lane] = state[d]
    if ctx.line:  # what the field writes is not the slope
        call_line(ctx.line, VALUES, ctx)
        values = ctx.values
    else:
        call_field(ctx.field, ctx.times, ctx.stages, ctx.par, values)
    ctx.counters.evaluations += 1
    finite = True
    for d in range(rows):
        slope = values[lanes * d]
        finite = finite and is_finite(slope)
        if ctx.second:
            momentum = state[rows + d]
            into[d] = base[d] + move * (ctx.factors.velocity[d] * momentum)
            into[rows + d] = base[rows + d] + move * slope
        else:
            into[d] = base[d] + move * slope
    return finite


@compiled
def is_zero(value, change, move, t):
    """Whether a function that changes so much in the time ``move`` is 0 at ``t``, as far as times go."""
    return abs(value * move) < SHORTEST * abs(t) * abs(change)


@compiled
def way_ahead(ctx, search, value, allowed, noise, arrived):
    """Return whether the function that is looked for is 0 at the state, and the sign that it has next.

    Parameters
    ----------
    ctx : Context
    search : Search
    value, allowed, noise : float
        Its value, how large that may be and still be 0, and how much of it may be rounding.
    arrived : int
        The direction in which it has become 0, after which it may rest there; 0: that is not to be told.

    Returns
    -------
    at_zero : bool
    way : int
        The sign; 0 if it stays 0; `RESTS`.
    """
    t, state, ahead = search.time, search.step_state, search.end_state
    move = SHORT * (ctx.controller.next_length if ctx.varying else ctx.h)
    finite = add_slope(ctx, search, t, state, state, move, ahead)
    change = function(ctx, search, t + move, ahead) - value
    at_zero = abs(value) <= allowed or is_zero(value, change, move, t)
    if not (at_zero and finite):
        return at_zero, 0
    if abs(change) > noise:
        return True, sign(change)
    return True, way_by_curvature(ctx, search, value, noise, arrived, move)


@compiled
def way_by_curvature(ctx, search, value, noise, arrived, move):
    """Return the sign that the function has next, by its first two derivatives, or `RESTS`.

    It rests where it is pressed back, and would not rise before by more than rounding.
    """
    t, state, ahead, after = search.time, search.step_state, search.end_state, search.stop_state
    for _ in range(MOVES):
        if (t + move - search.last) * search.sign > 0.0:  # the field may not be known there
            return 0
        if not add_slope(ctx, search, t, state, state, move, ahead):
            return 0
        first = function(ctx, search, t + move, ahead)
        for d in range(search.dim):
            after[d] = 0.5 * (state[d] + ahead[d])
        finite = add_slope(ctx, search, t + move, ahead, after, 0.5 * move, after)
        both = function(ctx, search, t + move, after) - value
        for d in range(search.dim):
            ahead[d] = 2.0 * state[d] - ahead[d]
        before = function(ctx, search, t - move, ahead)
        first = 0.5 * (first - before) if is_finite(before) else first - value
        second = both - first
        if not (finite and is_finite(second)):
            return 0
        if abs(first) > noise or abs(second) > noise:
            low = first * second < 0.0 and first * first <= 4.0 * abs(second) * noise
            if abs(first) > noise and not low:
                return sign(first)
            return RESTS if arrived != 0 and sign(second) == arrived else sign(second)
        move *= LONGER
    return 0
