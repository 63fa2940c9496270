"""All zeros of a function in a stretch of time: bracketed on the polynomial, solved on partial steps.

The polynomial of a step is cheap and only of order s + 1. So it says where zeros may be, and the
states at the ends of partial steps say where they are.
"""

from integrators.kernel.inside.chebyshev import is_monotone, near
from integrators.kernel.inside.memory import FINEST, TINY
from integrators.kernel.inside.sample import is_finite, sign
from integrators.kernel.inside.solve import (
    APART,
    BESIDE,
    EXTREMUM,
    extremum,
    is_pole,
    zero_between,
)
from integrators.kernel.inside.value import noise_at, value_at
from integrators.kernel.native.jit import compiled

CLEAR_OF_ZERO = 10.0  # an extremum this many times the polynomial's error away from zero does not reach it
BLUR = 1e-7  # of the stretch: how well a minimizer that compares values finds an extremum, with room
CORNER = 2.5  # times as much at twice the distance: where g is smooth it is 4, at a corner 2


@compiled
def insert(points, directions, count, x, direction):
    """Insert a point and its direction into ``count`` others that are in order; return how many they are."""
    i = count
    while i > 0 and points[i - 1] > x:
        points[i], directions[i] = points[i - 1], directions[i - 1]
        i -= 1
    points[i], directions[i] = x, direction
    return count + 1


@compiled
def mark(search, x, direction):
    """Note the sign of the function at a point, in order."""
    search.mark_count = insert(search.marks, search.mark_signs, search.mark_count, x, direction)


@compiled
def add_zero(search, x, direction):
    """Note a zero, in order."""
    search.zero_count = insert(search.zeros, search.zero_directions, search.zero_count, x, direction)


@compiled
def turns_between(search, i, a, b):
    """Whether the parabola through point i and its neighbours turns back from zero between two points."""
    x, p = search.points + (i - 1), search.fine + (i - 1)
    left, right = (p[1] - p[0]) / (x[1] - x[0]), (p[2] - p[1]) / (x[2] - x[1])
    curvature = (right - left) / (x[2] - x[0])
    if curvature * p[1] <= 0.0:
        return False
    turn = x[1] - (left + curvature * (x[1] - x[0])) / (2.0 * curvature)
    return a < turn and turn < b


@compiled
def add_low(search, i):
    """Note a point where the polynomial turns back from near zero."""
    search.lows[search.low_count] = i
    search.low_count += 1


@compiled
def error_of_polynomial(search):
    """Return by how much the polynomial may differ from the function, with room."""
    return CLEAR_OF_ZERO * search.truncation + search.errors[search.event]


@compiled
def find_lows(search, first, last):
    """Note the points inside a run of one sign where the polynomial turns back from near zero.

    Near the ends of the stretch its parabola may miss a corner, or a turn that lies beyond the end by error,
    but not that coefficients are missing.
    """
    p, end, least, corner = search.fine, search.n - 1, near(search), error_of_polynomial(search)
    search.low_count = 0
    if last - first < 2:
        return
    turns = abs(p[0]) < corner or turns_between(search, 1, -BESIDE, search.points[1])
    if first == 0 and TINY < abs(p[0]) < least and turns:  # a sign without a size has been looked at
        add_low(search, 0)
    for i in range(first + 1, last):
        size = abs(p[i])
        if size <= abs(p[i - 1]) and size < abs(p[i + 1]) and size < least:
            add_low(search, i)
    before = search.points[end - 1]
    turns = abs(p[end]) < corner or turns_between(search, end - 1, before, 1.0 + BESIDE)
    if last == end and abs(p[end]) < least and turns:
        add_low(search, end)


@compiled
def change_beside(ctx, search, x, distance):
    """Return by how much values differ at a distance from a point."""
    here, change = value_at(ctx, search, x), 0.0
    for point in (x - distance, x + distance):
        if point >= 0.0 and point <= 1.0:
            value = value_at(ctx, search, point)
            if is_finite(value):
                change = max(change, abs(value - here))
    return change


@compiled
def blur(ctx, search, x):
    """Return by how much the value at an extremum may differ from that where a minimizer ended.

    At a corner the minimizer ends closer: there g is as different beside it as it is steep.
    """
    near = max(BLUR, APART * search.resolution / 100.0)
    change = change_beside(ctx, search, x, near)
    if change_beside(ctx, search, x, 2.0 * near) < CORNER * change:
        return change_beside(ctx, search, x, max(3.0 * EXTREMUM, 10.0 * search.resolution))
    return change


@compiled
def extremum_around(ctx, search, i, j, way):
    """Return the point of an extremum between the neighbours of two points."""
    return extremum(ctx, search, search.points[max(i - 1, 0)], search.points[min(j + 1, search.n - 1)], way)


BEYOND_END = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)  # of the stretch: how far beyond its end g may have a sign again


@compiled
def add_zero_at_end(ctx, search, x, before):
    """Note a zero at the very end, after a sign; what follows begins with the sign just beyond it."""
    raised, after = search.raised, 0
    for distance in BEYOND_END:
        beyond = 1.0 + max(distance, 100.0 * search.resolution)
        value = value_at(ctx, search, beyond)
        if abs(value) > noise_at(ctx, search, beyond):
            after = sign(value)
            break
    search.raised = raised  # a function may go no farther than the integration
    if after == before:
        add_zero(search, x, 0)
        return
    add_zero(search, x, -before)
    search.end_value = -TINY * before
    search.sampled[FINEST * search.event + search.degree - 1] = search.end_value


@compiled
def mark_low(ctx, search, low, way):
    """Note what the function does where the polynomial, of sign ``way``, comes near zero and turns back."""
    x, p = search.points[low], search.fine[low]
    value = value_at(ctx, search, x)
    # Between these it may fall by as much as it rises, at a corner, which the polynomial also rounds.
    margin = error_of_polynomial(search)
    for i in range(max(low - 1, 0), min(low + 2, search.n)):
        margin = max(margin, abs(search.fine[i] - p))
    margin += CLEAR_OF_ZERO * abs(value - p)
    if not is_finite(value) or (sign(value) == way and abs(value) > margin):
        return
    if sign(value) != -way:
        x = extremum_around(ctx, search, low, low, -way)
        value = value_at(ctx, search, x)
    if not is_finite(value):
        return
    noise = noise_at(ctx, search, x)
    if sign(value) == -way and abs(value) > noise:
        mark(search, x, -way)
    elif abs(value) <= noise or abs(value) <= blur(ctx, search, x):
        if low == search.n - 1 and x >= 1.0 - BESIDE:
            add_zero_at_end(ctx, search, x, way)
        else:
            add_zero(search, x, 0)


@compiled
def mark_run(ctx, search, first, last):
    """Note where the function has which sign in a run: at its largest values, and at extrema near zero."""
    way = sign(search.fine[first])
    find_lows(search, first, last)
    starts = first == 0 and search.points[0] == 0.0
    ends = last == search.n - 1 and search.points[last] == 1.0
    count = search.low_count
    if (starts or ends) and count == 0:  # the sign is that of the stretch's end
        return
    for i in range(count + 1):
        a = search.lows[i - 1] if i > 0 else first
        b = search.lows[i] if i < count else last
        top = a
        for j in range(a, b + 1):
            top = j if abs(search.fine[j]) > abs(search.fine[top]) else top
        x = search.points[top]
        if x > 0.0 and x < 1.0:
            value = value_at(ctx, search, x)
            if value == 0.0 or sign(value) == -way:  # the polynomial errs: g may still get there nearby
                x = extremum_around(ctx, search, a, b, way)
                value = value_at(ctx, search, x)
                if is_finite(value) and sign(value) != way and abs(value) <= blur(ctx, search, x):
                    add_zero(search, x, 0)
            if is_finite(value) and value != 0.0:
                mark(search, x, sign(value))
        if i < count:
            mark_low(ctx, search, search.lows[i], way)


@compiled
def solve(ctx, search, a, b, after):
    """Note the zero between two points where the function has different signs; there is none at a pole."""
    wanted = search.directions[search.event]
    if wanted != 0 and wanted != after:
        return
    x = zero_between(ctx, search, a, b)
    if not is_pole(ctx, search, x, a, b):
        add_zero(search, x, after)


@compiled
def crosses_at_most_once(search):
    """Whether the polynomial only rises or only falls, and is not near zero at an end: so it turns nowhere.

    A sign without a size, at the start, has been looked at.
    """
    n, points, p, least = search.n, search.points, search.fine, near(search)
    clear = (abs(p[0]) <= TINY or abs(p[0]) >= least) and abs(p[n - 1]) >= least
    whole = points[0] == 0.0 and points[n - 1] == 1.0 and p[0] != 0.0
    return whole and clear and search.fitted > 0 and is_monotone(search)


@compiled
def find_zeros(ctx, search):
    """Set the zeros in (0, 1], in order."""
    search.mark_count = search.zero_count = 0
    n, p = search.n, search.fine
    if search.scale == 0.0:  # zero all along
        return
    if crosses_at_most_once(search):
        if sign(p[0]) != sign(p[n - 1]):
            solve(ctx, search, 0.0, 1.0, sign(p[n - 1]))
        return
    first = 0
    while first < n:
        last = first
        while last + 1 < n and sign(p[last + 1]) == sign(p[first]):
            last += 1
        if p[first] != 0.0:
            mark_run(ctx, search, first, last)
        first = last + 1
    for i in range(1, n - 1):
        before = sign(p[i - 1])
        if p[i] == 0.0 and before != 0 and before == sign(p[i + 1]):  # a sample right at a touch
            mark_low(ctx, search, i, before)
    if search.points[0] == 0.0 and p[0] != 0.0:
        mark(search, 0.0, sign(p[0]))
    count, marks, signs = search.mark_count, search.marks, search.mark_signs
    for i in range(count - 1):
        if signs[i] != signs[i + 1]:
            solve(ctx, search, marks[i], marks[i + 1], signs[i + 1])
    if search.points[n - 1] == 1.0 and count > 0:
        before = signs[count - 1]
        if p[n - 1] == 0.0:
            add_zero_at_end(ctx, search, 1.0, before)
        elif before != sign(p[n - 1]):
            solve(ctx, search, marks[count - 1], 1.0, sign(p[n - 1]))
    drop_false_touches(search)


@compiled
def drop_false_touches(search):
    """Drop touches that are the crossing's own, close beside it."""
    kept = 0
    for i in range(search.zero_count):
        x, direction = search.zeros[i], search.zero_directions[i]
        own = True
        for j in range(search.zero_count):
            if direction == 0 and abs(search.zeros[j] - x) <= BESIDE and search.zero_directions[j] != 0:
                own = False
        if own:
            search.zeros[kept], search.zero_directions[kept] = x, direction
            kept += 1
    search.zero_count = kept
