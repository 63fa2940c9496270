r"""Rounds of steps, after each of which the tangent vectors are made orthonormal: ``V = Q R``.

The logarithms of R's diagonal are added up for each interval of time. How many steps the next round has
follows from how far these were apart in the last one. With as many vectors as components, the divergence of
the field is the trace of ``D^-1 f'(Y) D``, D the vectors at a stage: its integral by the quadrature of the
steps needs no derivatives but those that the vectors follow.

Steps are as long as the trajectory's errors allow. Those of a vector are its own: where it contracts much
faster than anything of the trajectory changes, R would be the decay of the discrete map. So the error of a
vector is estimated like that of a step, ``h |gamma_s|^2 / max_{j<=3} |gamma_j|``, by the coefficients of
``f'(Y) D``, relative to what is left of it; a round with too large a one is repeated with shorter steps.
"""

from math import exp, log, sqrt

from integrators.kernel.context import ADVANCE, ANEW, BUDGET, DONE, PARTIAL, TAKE, Context
from integrators.kernel.native.attributes import view
from integrators.kernel.native.jit import compiled
from integrators.kernel.parts.estimate import AT_ERROR, GAMMA_0, GAMMA_3
from integrators.kernel.simd.memory import call_entry, get, total
from integrators.kernel.simd.operations import two_sum
from integrators.kernel.simd.views import doubles, integers
from integrators.kernel.step.control import error_power
from integrators.kernel.step.fixed_point import evaluate
from integrators.kernel.step.sample import read, write
from integrators.kernel.step.stages import offset
from integrators.kernel.tangent.memory import TOO_FAR_APART, TOO_LONG, Frame, Tangents

# Logarithms of the ratio of the longest vector to the shortest after a round. The relative error of the
# shortest is the rounding unit times this ratio.
AIM = log(1e5)  # what a round's number of steps is chosen for,
LIMIT = log(1e9)  # and above which it is repeated
RANGE = 25.0  # the logarithm of a length itself may be so many times as large: doubles end at exp(709)
LONGER = 4  # times as many steps in the next round, at most
HALF = 0.5  # part that orthogonalisation leaves of a vector at least, where once is enough
LARGEST_ERROR = 1e-6  # of a vector by a step, estimated, relative to what is left of it
SAFETY, SHORTER, LONGER_STEP = 0.8, 0.2, 2.0  # bounds of a step's length, relative to the last one

context, tangents, frame_of = view(Context), view(Tangents), view(Frame)


@compiled
def step(memory, ctx):
    """Take one step of the present interval.

    Returns
    -------
    outcome : int
        BUDGET: it is taken; DONE: none is left; ANEW: the time to stop at is reached.
    taken : int
        0 or 1.
    """
    mark = memory.marks[memory.interval]
    if ctx.varying:
        end = min(mark, memory.stop)
        times = doubles(memory.times)
        times[0] = times[1] = end
        outcome = call_entry(
            memory.steps, TAKE, memory.trajectory, memory.partial, PARTIAL, 2, memory.times, 0, 0, 0,
            memory.states, 1,
        )  # fmt: skip
        return ANEW if outcome == DONE and memory.stop <= mark else outcome, ctx.samples_written
    if ctx.n >= memory.targets[memory.interval]:
        return DONE, 0
    target = integers(memory.step_targets)
    target[0] = ctx.n + 1
    outcome = call_entry(
        memory.steps, ADVANCE, memory.trajectory, memory.partial, PARTIAL, 1, memory.times,
        memory.step_targets, memory.parts, 0, memory.states, 1,
    )  # fmt: skip
    return (BUDGET, 1) if outcome == DONE else (outcome, 0)


@compiled
def slopes_of(own):
    """Return the field along the vectors at the stages of their last step.

    The implicit solver leaves the values of a polynomial in its place.
    """
    if own.implicit.code == 0:
        return own.values
    kept = own.values
    own.values = own.scratch.sums
    evaluate(own)
    own.values = kept
    return own.scratch.sums


@compiled
def trace_of_quotient(matrix, other, n):
    """Return the trace of matrix^-1 other, both (n, n) and overwritten: Gauss's elimination, by columns."""
    for j in range(n):
        pivot = j
        for i in range(j + 1, n):
            if abs(matrix[n * i + j]) > abs(matrix[n * pivot + j]):
                pivot = i
        if pivot != j:
            for i in range(n):
                matrix[n * j + i], matrix[n * pivot + i] = matrix[n * pivot + i], matrix[n * j + i]
                other[n * j + i], other[n * pivot + i] = other[n * pivot + i], other[n * j + i]
        for i in range(j + 1, n):
            factor = matrix[n * i + j] / matrix[n * j + j]
            for m in range(j + 1, n):
                matrix[n * i + m] -= factor * matrix[n * j + m]
            for m in range(n):
                other[n * i + m] -= factor * other[n * j + m]
    trace = 0.0
    for m in range(n):
        for i in range(n - 1, m - 1, -1):
            solved = other[n * i + m]
            for j in range(i + 1, n):
                solved -= matrix[n * i + j] * other[n * j + m]
            other[n * i + m] = solved / matrix[n * i + i]
        trace += other[n * m + m]
    return trace


@compiled
def add_divergence(memory, ctx):
    """Add the integral of the divergence over the last step to that of the interval."""
    followers, n, integral = tangents(memory.tangents), memory.dim, 0.0
    for stage in range(ctx.k):
        first = 0
        for g in range(followers.groups):
            own = context(followers.own[g])
            slopes = slopes_of(own)
            place = offset(own, stage // 8) + stage % 8
            for v in range(followers.vectors[g]):
                for d in range(n):
                    row = place + own.lanes * (n * v + d)
                    memory.stages[n * d + first + v] = own.stages[row]
                    memory.slopes[n * d + first + v] = slopes[row]
            first += followers.vectors[g]
        trace = trace_of_quotient(memory.stages, memory.slopes, n)
        integral += context(followers.own[0]).h * ctx.tables.weights[stage] * trace
    i = memory.interval
    memory.divergence[i], low = two_sum(memory.divergence[i], integral)
    memory.divergence_low[i] += low


@compiled
def length(vector, n):
    """Return the length of a vector, whose squares may leave the range of doubles."""
    largest = 0.0
    for d in range(n):
        largest = max(largest, abs(vector[d]))
    if largest == 0.0:
        return 0.0
    squares = 0.0
    for d in range(n):
        squares += (vector[d] / largest) ** 2
    return largest * sqrt(squares)


@compiled
def orthonormalise(memory):
    """Replace V by Q, and set the logarithms of R's diagonal.

    By the modified method of Gram and Schmidt, a second time where the first leaves little of a vector.
    """
    n = memory.dim
    smallest, largest, farthest = 1e300, -1e300, 0.0
    for j in range(memory.count):
        vector = memory.vectors + n * j
        before = length(vector, n)
        after = before
        for _ in range(2):
            for i in range(j):
                unit, product = memory.vectors + n * i, 0.0
                for d in range(n):
                    product += unit[d] * vector[d]
                for d in range(n):
                    vector[d] -= product * unit[d]
            after = length(vector, n)
            if after > HALF * before:
                break
            before = after
        for d in range(n):
            vector[d] /= after
        size = log(after)
        memory.sizes[j] = size
        smallest, largest, farthest = min(smallest, size), max(largest, size), max(farthest, abs(size))
        if not abs(size) < 1e300:
            farthest = 1e300
    memory.extent = max(largest - smallest, farthest / RANGE)


@compiled
def estimate_error(memory, ctx):
    """Set the largest error of a vector by the last step, relative to what is left of it, estimated."""
    followers, worst, first = tangents(memory.tangents), 0.0, 0
    estimators, chunks = ctx.estimate.estimators, ctx.chunks
    for g in range(followers.groups):
        own = context(followers.own[g])
        slopes, rows = slopes_of(own), ctx.rows
        for v in range(followers.vectors[g]):
            largest, last = 0.0, 0.0
            for which in range(GAMMA_0, AT_ERROR + 1):
                if GAMMA_3 < which < AT_ERROR:
                    continue
                squares, table = 0.0, estimators + 8 * chunks * which
                for d in range(rows):
                    row, coefficient = own.lanes * (rows * v + d), 0.0
                    for chunk in range(chunks):
                        values = get(slopes, row + offset(own, chunk))
                        coefficient += total(get(table, 8 * chunk) * values)
                    squares += coefficient * coefficient
                if which == AT_ERROR:
                    last = squares
                else:
                    largest = max(largest, squares)
            if largest > 0.0:
                left = exp(memory.sizes[first + v])
                worst = max(worst, abs(own.h) * (last / sqrt(largest)) / left)
        first += followers.vectors[g]
    memory.error = worst


@compiled
def bound_steps(memory, ctx, h):
    """Let no step be longer than the vectors' errors allow, the last one having been of length h."""
    controller, factor = ctx.controller, LONGER_STEP
    if memory.error > 0.0:
        factor = SAFETY * (LARGEST_ERROR / memory.error) ** error_power(controller.error_degree)
    if factor < LONGER_STEP:
        controller.longest = min(memory.longest, abs(h) * max(factor, SHORTER))
    else:
        controller.longest = memory.longest


@compiled
def end_round(memory, ctx):
    """Make the vectors orthonormal, and keep what they have grown by; return DONE, or why not."""
    followers, n, first = tangents(memory.tangents), memory.dim, 0
    for g in range(followers.groups):
        own, room, rows = context(followers.own[g]), followers.room, ctx.rows
        write(own, own.state, room)
        for v in range(followers.vectors[g]):
            for i in range(n):
                half, d = i // rows, i % rows
                memory.vectors[n * (first + v) + i] = room[half * own.rows + v * rows + d]
        first += followers.vectors[g]
    h = context(followers.own[0]).h
    orthonormalise(memory)
    if not memory.extent <= LIMIT:
        return TOO_FAR_APART
    if ctx.varying:
        estimate_error(memory, ctx)
        bound_steps(memory, ctx, h)
        if not memory.error <= LARGEST_ERROR:
            return TOO_LONG
    first = 0
    for g in range(followers.groups):
        own, room, rows = context(followers.own[g]), followers.room, ctx.rows
        for v in range(followers.vectors[g]):
            for i in range(n):
                half, d = i // rows, i % rows
                room[half * own.rows + v * rows + d] = memory.vectors[n * (first + v) + i]
        read(own, own.state, room)
        for d in range(8 * ((own.rows + 3) // 4) if own.second else own.rows):
            own.error[d] = 0.0
        own.length = own.older_length = 0.0
        own.blocks.age = 0
        first += followers.vectors[g]
    i = memory.interval
    memory.ends[i] = ctx.t0 if ctx.varying else ctx.t0 + float(ctx.n) * ctx.h
    write(ctx, ctx.state, memory.end_states + n * i)
    for v in range(memory.count):
        place = memory.count * i + v
        memory.growth[place], low = two_sum(memory.growth[place], memory.sizes[v])
        memory.growth_low[place] += low
    steps = memory.taken * AIM / max(memory.extent, 1e-9)
    memory.wanted = int(min(max(steps, 1.0), float(LONGER * memory.wanted)))
    memory.rounds += 1
    memory.rounds_left -= 1
    memory.taken = 0
    return DONE


@compiled
def entry(address):
    """Take rounds to the end of the last interval; return DONE, or why it comes back before.

    BUDGET: nothing is wrong; ANEW: `Frame.stop` is reached; TOO_FAR_APART, TOO_LONG: the last round is to be
    repeated; or the outcome of a step.
    """
    memory = frame_of(address)
    ctx = context(memory.trajectory)
    while memory.interval < memory.intervals:
        asked, over = min(memory.wanted, memory.most), False
        if memory.taken < asked:
            outcome, taken = step(memory, ctx)
            memory.taken += taken
            memory.budget -= taken
            if taken and memory.has_divergence:
                add_divergence(memory, ctx)
            over = outcome == DONE
            if not (over or (outcome == BUDGET and taken)):
                return outcome
        if over or memory.taken >= asked:
            if memory.taken:
                outcome = end_round(memory, ctx)
                if outcome != DONE:
                    return outcome
            if over:
                memory.interval += 1
            if memory.budget <= 0 or memory.rounds_left <= 0:
                return BUDGET
    return DONE
