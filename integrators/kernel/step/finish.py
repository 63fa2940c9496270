"""The end of a step: the new state, and states inside the step.

The weights' low parts enter the products with the field before anything is
rounded; the whole displacement is formed first and the state added last, as a
sum whose rounding error is kept.
"""

from integrators.kernel import layout as at
from integrators.kernel.simd.lanes import fma
from integrators.kernel.simd.memory import (
    get,
    get_float,
    get_int,
    put,
    put_float,
    put_int,
    splat8,
    sums,
    swap,
    total,
)  # fmt: skip
from integrators.kernel.step.sweep import compiled, offset, project


@compiled
def one(f, i, high, low):
    """Eight values times weights high + low."""
    values = get(f, i)
    return fma(high, values, low * values)


@compiled
def two(f, i, high, more_high, low, more_low):
    """Sixteen values times weights, added to eight."""
    values = get(f, i)
    more = get(f, i + 8)
    return fma(more_high, more, fma(high, values, fma(more_low, more, low * values)))


@compiled
def many(ctx, row, high, low):
    """All values of a row times weights, added to eight."""
    f = get_int(ctx, at.F)
    i = get_int(ctx, at.LANES) * row
    chunks = get_int(ctx, at.CHUNKS)
    result = splat8(0.0)
    for chunk in range(chunks):
        result = fma(get(low, 8 * chunk), get(f, i + offset(ctx, chunk)), result)
    for chunk in range(chunks):
        result = fma(get(high, 8 * chunk), get(f, i + offset(ctx, chunk)), result)
    return result


@compiled
def impulses(ctx, d):
    """For the rows d .. d+3, the means of the force with the weights b, then with those of the position."""
    f = get_int(ctx, at.F)
    route = get_int(ctx, at.ROUTE)
    b = get_int(ctx, at.WEIGHTS)
    b_low = get_int(ctx, at.WEIGHTS_LOW)
    w = get_int(ctx, at.POSITION_WEIGHTS)
    w_low = get_int(ctx, at.POSITION_WEIGHTS_LOW)
    if route == 8:
        i = 8 * d
        b0 = get(b, 0)
        b1 = get(b_low, 0)
        w0 = get(w, 0)
        w1 = get(w_low, 0)
        return sums(
            one(f, i, b0, b1), one(f, i + 8, b0, b1), one(f, i + 16, b0, b1), one(f, i + 24, b0, b1),
            one(f, i, w0, w1), one(f, i + 8, w0, w1), one(f, i + 16, w0, w1), one(f, i + 24, w0, w1),
        )  # fmt: skip
    if route == 16:
        i = 16 * d
        b0 = get(b, 0)
        b1 = get(b, 8)
        b2 = get(b_low, 0)
        b3 = get(b_low, 8)
        w0 = get(w, 0)
        w1 = get(w, 8)
        w2 = get(w_low, 0)
        w3 = get(w_low, 8)
        return sums(
            two(f, i, b0, b1, b2, b3), two(f, i + 16, b0, b1, b2, b3),
            two(f, i + 32, b0, b1, b2, b3), two(f, i + 48, b0, b1, b2, b3),
            two(f, i, w0, w1, w2, w3), two(f, i + 16, w0, w1, w2, w3),
            two(f, i + 32, w0, w1, w2, w3), two(f, i + 48, w0, w1, w2, w3),
        )  # fmt: skip
    return sums(
        many(ctx, d, b, b_low), many(ctx, d + 1, b, b_low),
        many(ctx, d + 2, b, b_low), many(ctx, d + 3, b, b_low),
        many(ctx, d, w, w_low), many(ctx, d + 1, w, w_low),
        many(ctx, d + 2, w, w_low), many(ctx, d + 3, w, w_low),
    )  # fmt: skip


@compiled
def means(ctx, d):
    """For the rows d .. d+7, the means of the field with the weights b."""
    f = get_int(ctx, at.F)
    route = get_int(ctx, at.ROUTE)
    b = get_int(ctx, at.WEIGHTS)
    low = get_int(ctx, at.WEIGHTS_LOW)
    if route == 8:
        i = 8 * d
        b0 = get(b, 0)
        b1 = get(low, 0)
        return sums(
            one(f, i, b0, b1), one(f, i + 8, b0, b1), one(f, i + 16, b0, b1), one(f, i + 24, b0, b1),
            one(f, i + 32, b0, b1), one(f, i + 40, b0, b1), one(f, i + 48, b0, b1), one(f, i + 56, b0, b1),
        )  # fmt: skip
    if route == 16:
        i = 16 * d
        b0 = get(b, 0)
        b1 = get(b, 8)
        b2 = get(low, 0)
        b3 = get(low, 8)
        return sums(
            two(f, i, b0, b1, b2, b3), two(f, i + 16, b0, b1, b2, b3),
            two(f, i + 32, b0, b1, b2, b3), two(f, i + 48, b0, b1, b2, b3),
            two(f, i + 64, b0, b1, b2, b3), two(f, i + 80, b0, b1, b2, b3),
            two(f, i + 96, b0, b1, b2, b3), two(f, i + 112, b0, b1, b2, b3),
        )  # fmt: skip
    return sums(
        many(ctx, d, b, low), many(ctx, d + 1, b, low), many(ctx, d + 2, b, low), many(ctx, d + 3, b, low),
        many(ctx, d + 4, b, low), many(ctx, d + 5, b, low),
        many(ctx, d + 6, b, low), many(ctx, d + 7, b, low),
    )  # fmt: skip


@compiled
def add(state, error, next_state, next_error, i, increment):
    """Add an increment to one component of the state, and keep what rounding takes from the sum."""
    old = get_float(state, i)
    small = increment + get_float(error, i)
    new = old + small
    part = new - old
    put_float(next_state, i, new)
    put_float(next_error, i, (old - (new - part)) + (small - part))
    return new * 0.0


@compiled
def update_by_increment(ctx):
    """As `update`, from increments: those of q are not found from the forces without cancellation."""
    rows = get_int(ctx, at.ROWS)
    state, error = get_int(ctx, at.STATE), get_int(ctx, at.ERROR)
    next_state, next_error = get_int(ctx, at.NEXT_STATE), get_int(ctx, at.NEXT_ERROR)
    increment = get_int(ctx, at.INCREMENT)
    damage = 0.0
    for d in range(rows):
        if get_int(ctx, at.SECOND):
            i = 8 * (d // 4) + d % 4
            damage += add(state, error, next_state, next_error, i + 4, get_float(increment, d))
            damage += add(state, error, next_state, next_error, i, get_float(increment, rows + d))
        else:
            damage += add(state, error, next_state, next_error, d, get_float(increment, d))
    return at.DONE if damage == 0.0 else at.NOT_FINITE


@compiled
def update(ctx):
    """NEXT_STATE, NEXT_ERROR from STATE, ERROR and the solved F; return DONE or NOT_FINITE."""
    if get_int(ctx, at.SOLVED) == at.BY_INCREMENT:
        return update_by_increment(ctx)
    rows = get_int(ctx, at.ROWS)
    state = get_int(ctx, at.STATE)
    error = get_int(ctx, at.ERROR)
    next_state = get_int(ctx, at.NEXT_STATE)
    next_error = get_int(ctx, at.NEXT_ERROR)
    h = get_float(ctx, at.H)
    damage = splat8(0.0)
    if get_int(ctx, at.SECOND):
        factor = get_int(ctx, at.STEP_FACTOR)
        kick = get_int(ctx, at.KICK_FACTOR)
        for i in range((rows + 3) // 4):
            z = get(state, 8 * i)
            e = get(error, 8 * i)
            kh = get(factor, 8 * i)
            drift = kh * z
            drift_low = fma(kh, e, fma(kh, z, -drift))
            # z + drift exactly, then all that is smaller.
            drift = swap(drift)
            moved = z + drift
            part = moved - z
            lost = (z - (moved - part)) + (drift - part)
            small = (get(kick, 8 * i) * (h * impulses(ctx, 4 * i)) + (swap(drift_low) + e)) + lost
            new = moved + small
            part = new - moved
            put(next_state, 8 * i, new)
            put(next_error, 8 * i, (moved - (new - part)) + (small - part))
            damage += new * 0.0
    else:
        for i in range((rows + 7) // 8):
            y = get(state, 8 * i)
            small = h * means(ctx, 8 * i) + get(error, 8 * i)
            new = y + small
            part = new - y
            put(next_state, 8 * i, new)
            put(next_error, 8 * i, (y - (new - part)) + (small - part))
            damage += new * 0.0
    return at.DONE if total(damage) == 0.0 else at.NOT_FINITE


@compiled
def commit(ctx):
    """Make NEXT_STATE the state: the step is taken."""
    for here, there in ((at.STATE, at.NEXT_STATE), (at.ERROR, at.NEXT_ERROR)):
        old = get_int(ctx, here)
        put_int(ctx, here, get_int(ctx, there))
        put_int(ctx, there, old)
    put_int(ctx, at.N, get_int(ctx, at.N) + 1)
    put_int(ctx, at.STEPS, get_int(ctx, at.STEPS) + 1)
    put_float(ctx, at.LENGTH, get_float(ctx, at.H))
    put_int(ctx, at.SOLVED, 0)


@compiled
def write(ctx, state, out):
    """Write a state in the layout of STATE to memory as (q, p) or y."""
    rows = get_int(ctx, at.ROWS)
    if get_int(ctx, at.SECOND):
        for d in range(rows):
            i = 8 * (d // 4) + d % 4
            put_float(out, d, get_float(state, i + 4))
            put_float(out, rows + d, get_float(state, i))
    else:
        for d in range(rows):
            put_float(out, d, get_float(state, d))


@compiled
def read(ctx, state, values):
    """Read a state that is laid out as `write` does."""
    rows = get_int(ctx, at.ROWS)
    if get_int(ctx, at.SECOND):
        for d in range(rows):
            i = 8 * (d // 4) + d % 4
            put_float(state, i + 4, get_float(values, d))
            put_float(state, i, get_float(values, rows + d))
    else:
        for d in range(rows):
            put_float(state, d, get_float(values, d))


@compiled
def interpolate(ctx, c, out):
    """Write the collocation polynomial of the solved step at t + c h.

    With the coefficients gamma of the field, y + h sum_j gamma_j int_0^c P_j; in
    second-order form the positions take the integrals of that polynomial's slope,
    projected like it: q + c h q' + h kh sum_j gamma_j (int_0^c P) X_s, column j.
    """
    rows = get_int(ctx, at.ROWS)
    padded = get_int(ctx, at.PADDED)
    s = get_int(ctx, at.DEGREE)
    second = get_int(ctx, at.SECOND)
    gamma = get_int(ctx, at.COEFFICIENTS)
    first = get_int(ctx, at.FIRST_COEFFICIENT)
    state = get_int(ctx, at.STATE)
    error = get_int(ctx, at.ERROR)
    h = get_float(ctx, at.H)
    project(ctx, get_int(ctx, at.PROJECTION), get_int(ctx, at.COEFFICIENT_CHUNKS))
    write(ctx, error, out)
    x = 2.0 * c - 1.0
    # Integrals of P_{j-1}, P_j, P_{j+1}, by int_0^c L_j = (L_{j+1} - L_{j-1}) / (2 (2j+1)) for j > 0.
    lower, here = 0.0, c
    before, legendre = 1.0, x
    for j in range(s):
        after = ((2.0 * j + 3.0) * x * legendre - (j + 1.0) * before) / (j + 2.0)
        upper = (after - before) / (2.0 * (2.0 * j + 3.0) ** 0.5) if j + 1 < s else 0.0
        slope_weight = h * here
        weight = 0.5 * here if j == 0 else -lower / (2.0 * (4.0 * j * j - 1.0) ** 0.5)
        weight = h * (weight + upper / (2.0 * (4.0 * (j + 1.0) * (j + 1.0) - 1.0) ** 0.5))
        i = first + j
        for d in range(rows):
            value = get_float(gamma, ((i // 8) * padded + d) * 8 + i % 8)
            if second:
                kh = get_float(get_int(ctx, at.ROW_FACTOR), d)
                put_float(out, d, get_float(out, d) + kh * (weight * value))
                put_float(out, rows + d, get_float(out, rows + d) + slope_weight * value)
            else:
                put_float(out, d, get_float(out, d) + slope_weight * value)
        lower, here = here, upper
        before, legendre = legendre, after
    for d in range(rows):
        if second:
            i = 8 * (d // 4) + d % 4
            drift = c * (get_float(get_int(ctx, at.STEP_FACTOR), i) * get_float(state, i))
            put_float(out, d, get_float(state, i + 4) + (drift + get_float(out, d)))
            put_float(out, rows + d, get_float(state, i) + get_float(out, rows + d))
        else:
            put_float(out, d, get_float(state, d) + get_float(out, d))
