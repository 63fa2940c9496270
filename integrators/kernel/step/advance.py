"""What Python calls: whole integrations, for one trajectory and for many."""

from numba import types

from integrators.kernel import layout as at
from integrators.kernel.native import binary as native
from integrators.kernel.simd.memory import get, get_float, get_int, put, put_float, put_int, splat8
from integrators.kernel.step.begin import (
    FARTHEST,
    prepare,
    set_factors,
    set_step,
    start_elsewhere,
    start_plain,
    take_sizes,
)
from integrators.kernel.step.finish import commit, interpolate, read, update, write
from integrators.kernel.step.iterate import (
    begin,
    close,
    reconsider,
    rewind,
    settle_part,
    solve,
    sweep,
    sweep_tested,
)
from integrators.kernel.step.sweep import compiled


@compiled
def step(ctx):
    """Take one step; the state stays where it was if the step fails."""
    outcome = solve(ctx)
    if outcome == at.DONE:
        outcome = update(ctx)
        if outcome == at.DONE:
            commit(ctx)
    return outcome


@compiled
def copy(source, target, slot, count):
    """Copy an array of ``count`` vectors from one context to another."""
    outof = get_int(source, slot)
    into = get_int(target, slot)
    for i in range(count):
        put(into, 8 * i, get(outof, 8 * i))


@compiled
def vectors_of_state(ctx):
    """Return the number of vectors of 8 in STATE."""
    rows = get_int(ctx, at.ROWS)
    return (rows + 3) // 4 if get_int(ctx, at.SECOND) else (rows + 7) // 8


@compiled
def vectors_of_stages(ctx):
    """Return the number of vectors of 8 in F."""
    return get_int(ctx, at.BLOCKS) * get_int(ctx, at.PADDED) * get_int(ctx, at.LANES) // 8


@compiled
def part_step(ctx, side, part):
    """Solve in ``side`` a step of length ``part`` from the state of ``ctx``; leaves ``ctx`` as it is.

    It starts inside the step ahead if that is solved, else after the step behind.
    """
    set_step(side, part)
    count = vectors_of_state(ctx)
    copy(ctx, side, at.STATE, count)
    copy(ctx, side, at.ERROR, count)
    put_int(side, at.N, 0)
    put_float(side, at.T0, get_float(ctx, at.T0) + get_int(ctx, at.N) * get_float(ctx, at.H))
    rewind(side)
    prepare(side)
    length = get_float(ctx, at.LENGTH)
    if get_int(ctx, at.SOLVED):
        start_elsewhere(side, ctx, 0.0, part / get_float(ctx, at.H))
    elif length != 0.0 and abs(part / length) <= FARTHEST:
        start_elsewhere(side, ctx, 1.0, part / length)
    else:
        start_plain(side)
    take_sizes(side)
    outcome = settle_part(ctx, side)
    return update(side) if outcome == at.DONE else outcome


@compiled
def add_counters(ctx, side):
    """Count the work done in ``side`` as that of ``ctx``."""
    for slot in (at.ITERATIONS, at.EVALUATIONS, at.RESTARTS):
        put_int(ctx, slot, get_int(ctx, slot) + get_int(side, slot))
        put_int(side, slot, 0)
    put_int(ctx, at.PARTIAL, get_int(ctx, at.PARTIAL) + 1)


@compiled
def land(ctx, side, t):
    """Make the end of the step in ``side``, at time ``t``, the state of ``ctx``."""
    count = vectors_of_state(ctx)
    for here, there in ((at.STATE, at.NEXT_STATE), (at.ERROR, at.NEXT_ERROR)):
        outof = get_int(side, there)
        into = get_int(ctx, here)
        for i in range(count):
            put(into, 8 * i, get(outof, 8 * i))
    copy(side, ctx, at.F, vectors_of_stages(ctx))
    put_float(ctx, at.LENGTH, get_float(side, at.H))
    put_float(ctx, at.T0, t)
    put_int(ctx, at.N, 0)
    put_int(ctx, at.SOLVED, 0)


@compiled
def sample(ctx, side, between, t, part, out):
    """Write the state ``part`` beyond the present one; return the outcome."""
    if part == 0.0:
        write(ctx, get_int(ctx, at.STATE), out)
        if between == at.LAND:
            put_float(ctx, at.T0, t)
            put_int(ctx, at.N, 0)
        return at.DONE
    if between == at.DENSE:
        outcome = solve(ctx)
        if outcome == at.DONE:
            interpolate(ctx, part / get_float(ctx, at.H), out)
        return outcome
    if between == at.SIDE:
        # Ahead of its time: the part starts from it. Where it fails, nothing in it is reached: near a
        # singularity the equations of a part may have a solution, far from the trajectory.
        outcome = solve(ctx)
        if outcome != at.DONE:
            return outcome
    outcome = part_step(ctx, side, part)
    add_counters(ctx, side)
    if outcome == at.DONE:
        write(side, get_int(side, at.NEXT_STATE), out)
        if between == at.LAND:
            land(ctx, side, t)
    return outcome


@compiled
def advance(ctx, side, between, count, times, targets, parts, first, out, budget):
    """Take own steps, and make the states asked for.

    Parameters
    ----------
    ctx, side : address
        Contexts: of the trajectory, and for partial steps.
    between : int
        `SIDE`, `LAND` or `DENSE`.
    count : int
        Samples.
    times, targets, parts : address of ``count`` doubles, integers, doubles
        Sample i is at step n = targets[i] and parts[i] beyond; `LAND` counts from sample i - 1.
    first : int
        The first sample still to be made.
    out : address of (count, dim) doubles
        Samples; overwritten.
    budget : int
        Own steps after which to come back.

    Returns
    -------
    int
        The outcome; MADE tells how many samples are made.
    """
    dim = get_int(ctx, at.ROWS) * (2 if get_int(ctx, at.SECOND) else 1)
    for i in range(first, count):
        put_int(ctx, at.MADE, i)
        target = get_int(targets, i)
        for _ in range(get_int(ctx, at.N), target):
            if budget == 0:
                return at.BUDGET
            outcome = step(ctx)
            if outcome != at.DONE:
                return outcome
            budget -= 1
        outcome = sample(ctx, side, between, get_float(times, i), get_float(parts, i), out + 8 * dim * i)
        if outcome != at.DONE:
            return outcome
    put_int(ctx, at.MADE, count)
    return at.DONE


@compiled
def busy(ctx):
    """Whether a trajectory of a batch has a step to solve."""
    return get_int(ctx, at.ALIVE) == 1 and get_int(ctx, at.OUTCOME) == at.RUNNING


@compiled
def together(contexts, count):
    """Take one step on each living trajectory, all of them at the same time.

    One trajectory's field waits for its own square roots and divisions; the
    others' work fills that time. Each sees the operations it would see alone.
    """
    most = 0
    for m in range(count):
        ctx = get_int(contexts, m)
        if get_int(ctx, at.ALIVE):
            put_int(ctx, at.OUTCOME, at.DONE)
            if get_int(ctx, at.SOLVED) == 0:
                free = begin(ctx)
                put_int(ctx, at.UNTESTED, free)
                most = max(most, free)
    for j in range(most):
        for m in range(count):
            ctx = get_int(contexts, m)
            if busy(ctx) and j < get_int(ctx, at.UNTESTED):
                sweep(ctx)
    running = True
    while running:
        running = False
        for m in range(count):
            ctx = get_int(contexts, m)
            if busy(ctx):
                sweep_tested(ctx)
                running = running or get_int(ctx, at.OUTCOME) == at.RUNNING
                if get_int(ctx, at.OUTCOME) != at.RUNNING:
                    close(ctx)
                    if get_int(ctx, at.STRATEGY) != at.FIXED_POINT:
                        put_int(ctx, at.OUTCOME, reconsider(ctx, get_int(ctx, at.OUTCOME)))
    for m in range(count):
        ctx = get_int(contexts, m)
        if get_int(ctx, at.ALIVE):
            outcome = get_int(ctx, at.OUTCOME)
            if outcome == at.DONE:
                outcome = update(ctx)
            if outcome == at.DONE:
                commit(ctx)
            else:
                put_int(ctx, at.ALIVE, 0)
            put_int(ctx, at.OUTCOME, outcome)


@compiled
def advance_batch(contexts, members, between, count, times, targets, parts, first, out, budget):
    """Make the samples from ``first`` on of all living members of a batch; see `advance`.

    ``contexts`` points to the addresses of the members' contexts and then of those for
    their partial steps; ``out`` holds (members, count, dim) doubles. A member that fails stops living,
    with its OUTCOME and MADE; the others go on. One that needs the implicit solver stops so
    as well, with WANTED set. Returns the sample that is next after ``budget`` steps, or ``count``.
    """
    ctx = get_int(contexts, 0)
    dim = get_int(ctx, at.ROWS) * (2 if get_int(ctx, at.SECOND) else 1)
    for i in range(first, count):
        n, living = 0, False
        for m in range(members):
            ctx = get_int(contexts, m)
            if get_int(ctx, at.ALIVE):
                put_int(ctx, at.MADE, i)
                n, living = get_int(ctx, at.N), True
        if not living:
            return count
        for _ in range(n, get_int(targets, i)):
            if budget == 0:
                return i
            budget -= 1
            together(contexts, members)
        for m in range(members):
            ctx = get_int(contexts, m)
            if get_int(ctx, at.ALIVE):
                place = out + 8 * dim * (count * m + i)
                t = get_float(times, i)
                outcome = sample(ctx, get_int(contexts, members + m), between, t, get_float(parts, i), place)
                put_int(ctx, at.OUTCOME, outcome)
                put_int(ctx, at.ALIVE, 1 if outcome == at.DONE else 0)
                put_int(ctx, at.MADE, i + 1 if outcome == at.DONE else i)
    return count


@compiled
def reset(ctx, start):
    """Put a trajectory at a start, with T0 and H as they are: no history, factors from VELOCITY."""
    state = get_int(ctx, at.STATE)
    error = get_int(ctx, at.ERROR)
    for i in range(vectors_of_state(ctx)):
        put(state, 8 * i, splat8(0.0))
        put(error, 8 * i, splat8(0.0))
    read(ctx, state, start)
    set_factors(ctx, get_float(ctx, at.H))
    put_float(ctx, at.LENGTH, 0.0)
    for slot in (at.N, at.SOLVED, at.AGE, at.FREE, at.MADE):
        put_int(ctx, slot, 0)
    put_int(ctx, at.OUTCOME, at.DONE)
    put_int(ctx, at.ALIVE, 1)


# What `entry` can do.
ADVANCE, ADVANCE_BATCH, RESET = range(3)


@compiled
def entry(what, a, b, c, d, e, f, g, h, i, j):
    """Do what ``what`` names, with its arguments: the one C function of the kernel."""
    if what == ADVANCE:
        return advance(a, b, c, d, e, f, g, h, i, j)
    if what == ADVANCE_BATCH:
        return advance_batch(a, b, c, d, e, f, g, h, i, j)
    reset(a, b)
    return at.DONE


def build() -> bytes:
    """Compile the kernel."""
    return native.build(entry, [(types.int64, "i64")] * 11, "i64")
