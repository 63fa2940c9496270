"""Steps of HBVM(k, s) on trajectories in lanes, compiled around the field of one system.

Every number of a step is a row, with one trajectory in each lane, so that there is nothing to shuffle and
no sum over lanes. Stages come one after another; each uses the values that the field has had at the stages
before it in the same iteration (Gauss and Seidel). The arithmetic is that of `integrators.kernel.step`:
nodes, weights and the state are sums of two doubles, and what is at the size of the state is added last.

A trajectory whose iteration has ended keeps its values while the others iterate on: what happens
in a lane depends on nothing in the others.
"""

from typing import Any

from integrators.kernel.ensemble.control import ends_of_steps
from integrators.kernel.ensemble.form import Form
from integrators.kernel.ensemble.group import Group
from integrators.kernel.native.attributes import load_anew, view
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.lanes import everywhere, somewhere
from integrators.kernel.simd.memory import call_field, larger
from integrators.kernel.simd.operations import fma, greatest, opposite, size, two_sum, where
from integrators.kernel.simd.views import as_numbers, as_parts, as_rows, rows_on_stack
from integrators.kernel.step.begin import INFINITY, on_previous_step
from integrators.kernel.step.finish import added, moved_by
from integrators.kernel.step.rule import (
    LOG_RESIDUAL,
    LOG_RESIDUAL_VARYING,
    MOST_IN_LANES,
    STAGNATION,
    TOLERANCE,
)
from integrators.kernel.step.size import inverse_sizes, least_part
from integrators.kernel.step.stopping import further, judge, residual_at_end, stagnates
from integrators.kernel.step.sums import multiplied, part_of_drift, time_of_step

group_at, form_at = view(Group), view(Form)


@compiled
def combination(form, table, i, values, last, d, start, starts):
    """Return ``sum_j table[i, j] values[j, d]``, added to ``start`` if it ``starts``.

    Where that is unrolled the value of the stage before comes last, as ``last``: the newest one, which all
    the rest need not wait for.
    """
    k, rows, unrolled = form.k, form.rows, form.unrolled
    total = start
    for m in range(k):
        j = i + m if unrolled else m
        if j >= k:
            j -= k
        value = last if unrolled and m == k - 1 else values[rows * j + d]
        total = fma(table[k * i + j], value, total) if starts or m > 0 else table[k * i + j] * value
    return total


def measuring(lanes: int, own: Any) -> Any:
    """Return what sets the weights that turn changes of the values into those of the stages beside a block.

    ``own(form, group, first, values, h, d, weight)`` is the size of a component and how far it moves. The
    size of a block is the largest of its components'. Where every row is a block and the step size fixed,
    floored sizes are at least how far a row of the group moves, as in
    `integrators.kernel.step.size.take_sizes`.
    """

    @compiled
    def measure(form, blocks, group, first, h, factor, values, sizes, block_weights, floored_weights):
        zero = everywhere(0.0, h)
        least, norm = least_part(form.varying), group.matrix_norm
        count, width = blocks.count, blocks.width
        for g in range(blocks.groups):
            largest, farthest = zero, zero
            for b in range(count):
                start = blocks.first + (g * count + b) * width
                top = zero
                for d in range(start, start + width):
                    weight = everywhere(norm, h) if form.unit else size(factor[d]) * norm
                    extent, moved = own(form, group, first, values, h, d, weight)
                    top = greatest(top, extent)
                    if width == 1 and not form.varying:
                        farthest = greatest(farthest, moved)
                sizes[start] = top
                largest = greatest(largest, top)
            for b in range(count):
                start = blocks.first + (g * count + b) * width
                inverse, floored = inverse_sizes(sizes[start], largest, least, zero, farthest)
                for d in range(start, start + width):
                    weight = everywhere(norm, h) if form.unit else size(factor[d]) * norm
                    block_weights[d] = weight * inverse
                    floored_weights[d] = weight * floored

    return measure


def steps(lanes: int, few: int) -> Any:
    """Return ``void(field, form, group, count)``, so many steps of a `Group` around a field.

    What begins and ends a step is done in ``few`` lanes after others, those of a register: results are not
    waited for, as in the iterations, and with more lanes most numbers would go through memory.
    """
    end_varying_step = ends_of_steps(lanes, few)

    @compiled
    def part(numbers, first):
        """Return the rows of an array from lane ``first`` on, few lanes of each."""
        return as_parts(numbers + first, few, lanes)

    @compiled
    def rows_from(rows, first):
        """Return the same of rows of all lanes."""
        return part(as_numbers(rows), first)

    @compiled
    def drift(form, group, first, d, kh):
        """Return kh (p + its error) as a sum of two doubles."""
        rows = form.rows
        state, error = part(group.state, first), part(group.error, first)
        return multiplied(kh, state[rows + d], error[rows + d])

    @compiled
    def component_size(form, group, first, values, h, d, weight):
        """Return the size of a component at the start and, about, at the end of a step; and its movement."""
        y = part(group.state, first)[d]
        if form.second:
            moved, _ = drift(form, group, first, d, h * part(group.velocity, first)[d])
        else:
            moved = h * values[form.rows * (form.k - 1) + d]
        return greatest(size(y), size(y + moved)), size(moved)

    @compiled
    def vector_size(form, group, first, values, h, d, weight):
        """As `component_size`; a vector is also as large as the newest values move the stages."""
        extent, moved = component_size(form, group, first, values, h, d, weight)
        return greatest(extent, size(weight * values[form.rows * (form.k - 1) + d])), moved

    measure, measure_along = measuring(lanes, component_size), measuring(lanes, vector_size)

    @compiled
    def measure_vectors(form, group, factor, values, sizes, block_weights, floored_weights):
        for first in range(0, lanes, few):
            measure_along(
                form, form.vectors, group, first, part(group.h, first)[0], rows_from(factor, first),
                rows_from(values, first), rows_from(sizes, first),
                rows_from(block_weights, first), rows_from(floored_weights, first),
            )  # fmt: skip

    @compiled
    def begin(form, group, first, h, factor):
        """Set what stages have besides the state and the values; return the time of the step."""
        k, rows, second, varying = form.k, form.rows, form.second, form.varying
        error, velocity = part(group.error, first), part(group.velocity, first)
        base = part(group.base, first)
        for d in range(rows):
            lacks = error[d]
            if second:
                kh = h * velocity[d]
                if not form.unit:
                    factor[d] = h * kh if varying else kh
                moved, moved_low = drift(form, group, first, d, kh)
                for i in range(k):
                    base[rows * i + d] = part_of_drift(
                        group.nodes[i], group.nodes_low[i], moved, moved_low, lacks
                    )
            else:
                if varying:
                    factor[d] = h
                for i in range(k):
                    base[rows * i + d] = lacks
        t0, low = part(group.t0, first)[0], part(group.time_low, first)[0]
        return time_of_step(t0, low, 0.0 if varying else float(group.n), h)

    @compiled
    def at(form, x, powers, d):
        """Return the polynomial of row d at x."""
        k, rows = form.k, form.rows
        total = powers[rows * (k - 1) + d]
        for j in range(k - 1):
            total = fma(total, x, powers[rows * (k - 2 - j) + d])
        return total

    @compiled
    def predict(form, group, first, values, ahead):
        """Set first values: the last step's polynomial at the nodes of this one."""
        k, rows = form.k, form.rows
        if form.varying:
            predict_from_polynomial(form, group, first, values, ahead)
            return
        table = load_anew(group, "extrapolation")
        for i in range(k):
            for d in range(rows):
                last = values[rows * (i - 1 if i > 0 else k - 1) + d]
                ahead[rows * i + d] = combination(form, table, i, values, last, d, last, False)
        for i in range(k * rows):
            values[i] = ahead[i]

    @compiled
    def predict_from_polynomial(form, group, first, values, ahead):
        """As `predict`, from the powers of the polynomial: this step's length may be another one."""
        k, rows = form.k, form.rows
        ratio, start = part(group.ratio, first)[0], part(group.begin, first)[0]
        nowhere = ratio == 0.0
        for i in range(k):
            x = on_previous_step(group.nodes[i], start, ratio)
            for d in range(rows):
                values[rows * i + d] = where(nowhere, 0.0, at(form, x, ahead, d))

    @compiled
    def begin_step(form, group, factor, values, ahead, sizes, block_weights, floored_weights, time):
        """Set what the first iteration starts from, and in ``time`` the step's, as a sum of two doubles."""
        for first in range(0, lanes, few):
            h, factors, own = part(group.h, first)[0], rows_from(factor, first), rows_from(values, first)
            times = rows_from(time, first)
            times[0], times[1] = begin(form, group, first, h, factors)
            measure(
                form, form.blocks, group, first, h, factors, own, rows_from(sizes, first),
                rows_from(block_weights, first), rows_from(floored_weights, first),
            )  # fmt: skip
            predict(form, group, first, own, rows_from(ahead, first))

    @compiled
    def iteration(
        field, form, group, t, t_low, h, active, factor, kept, moved, stage, field_values, newest, time
    ):
        """Set new values at all stages, one after another, and how much they have changed."""
        k, rows, unit, unrolled = form.k, form.rows, form.unit, form.unrolled
        base, state = as_rows(group.base, lanes), as_rows(group.state, lanes)
        matrix = load_anew(group, "matrix")
        for d in range(rows):
            moved[d] = 0.0
        for i in range(k):
            # Its address is loaded anew for each stage of few: the compiler would keep all values, of which
            # registers hold a few, and spend as much on moving them as on the products.
            values = kept if form.held or not unrolled else as_rows(load_anew(group, "values"), lanes)
            for d in range(rows):
                start = base[rows * i + d]
                last = newest[d] if i > 0 else values[rows * (k - 1) + d]
                total = combination(form, matrix, i, values, last, d, start, unit)
                stage[d] = state[d] + (total if unit else fma(factor[d], total, start))
            time[0] = t + fma(group.nodes[i], h, t_low)
            call_field(field, as_numbers(time), as_numbers(stage), group.par, as_numbers(field_values))
            for d in range(rows):
                old, new = values[rows * i + d], field_values[d]
                moved[d] = larger(moved[d], size(new - old))
                kept_value = where(active, new, old)
                values[rows * i + d] = kept_value
                if unrolled:
                    newest[d] = kept_value

    @compiled
    def largest_change(form, moved, weights, zero):
        """Return the largest of the changes of all rows."""
        top = zero
        for d in range(form.rows):
            top = larger(top, size(moved[d] * weights[d]))
        return top

    @compiled
    def mean(form, values, d, high, low, zero):
        """Return the mean of row d of the values with weights high + low, as a sum of two doubles."""
        k, rows = form.k, form.rows
        middle = k // 2
        first, last = zero, zero
        for j in range(middle):
            first = fma(low[j], values[rows * j + d], first)
        for j in range(middle):
            first = fma(high[j], values[rows * j + d], first)
        for j in range(middle, k):
            last = fma(low[j], values[rows * j + d], last)
        for j in range(middle, k):
            last = fma(high[j], values[rows * j + d], last)
        return two_sum(first, last)

    @compiled
    def keep(form, group, first, d, new, low, alive):
        """Set a component at the end of the step in lanes that are alive, and return which still are."""
        state, error = part(group.state, first), part(group.error, first)
        next_state = part(group.next_state, first) if form.varying else state
        next_error = part(group.next_error, first) if form.varying else error
        # The last iterations are not judged: in one component of a lane they may have left no number.
        good = alive & (new - new == 0.0)
        next_state[d] = where(good, new, state[d])
        next_error[d] = where(good, low, error[d])
        return good

    @compiled
    def finish(form, group, first, values, h, alive):
        """Set the state at the end, as a sum of two doubles, the displacement first; return who is alive."""
        rows, second = form.rows, form.second
        state, error, zero = part(group.state, first), part(group.error, first), everywhere(0.0, h)
        for d in range(rows):
            y, lacks = state[d], error[d]
            force, force_low = mean(form, values, d, group.weights, group.weights_low, zero)
            if second:
                kh = h * part(group.velocity, first)[d]
                moved, moved_low = drift(form, group, first, d, kh)
                p, p_lacks = state[rows + d], error[rows + d]
                kick, kick_low = mean(
                    form, values, d, group.position_weights, group.position_weights_low, zero
                )
                new, low = moved_by(y, lacks, moved, moved_low, h, kh, kick, kick_low)
                alive = keep(form, group, first, d, new, low, alive)
                new, low = added(p, p_lacks, h, force, force_low)
                alive = keep(form, group, first, rows + d, new, low, alive)
            else:
                new, low = added(y, lacks, h, force, force_low)
                alive = keep(form, group, first, d, new, low, alive)
        return alive

    @compiled
    def end_step(form, group, values, scratch, moved, sizes, block_weights, floored_weights):
        for first in range(0, lanes, few):
            h, own = part(group.h, first)[0], rows_from(values, first)
            alive = finish(form, group, first, own, h, part(group.alive, first)[0] > 0.0)
            part(group.alive, first)[0] = where(alive, 1.0, 0.0)
            if form.varying:
                end_varying_step(
                    form, group, first, own, h, alive, scratch,
                    rows_from(sizes, first), rows_from(moved, first),
                    rows_from(block_weights, first), rows_from(floored_weights, first),
                )  # fmt: skip

    @compiled
    def run(field, constants, address, count):
        group, form = group_at(address), form_at(constants)
        rows, varying, unrolled, held = form.rows, form.varying, form.unrolled, form.held
        of_stages = form.k * rows
        log_residual = LOG_RESIDUAL_VARYING if varying else LOG_RESIDUAL
        state, values = as_rows(group.state, lanes), as_rows(group.values, lanes)
        # Rows are on the stack, in registers if possible, where loops are unrolled.
        factor = rows_on_stack(state, rows) if unrolled else as_rows(group.factor, lanes)
        moved = rows_on_stack(state, rows) if unrolled else as_rows(group.moved, lanes)
        block_weights = rows_on_stack(state, rows) if unrolled else as_rows(group.block_weights, lanes)
        floored_weights = rows_on_stack(state, rows) if unrolled else as_rows(group.floored_weights, lanes)
        sizes = rows_on_stack(state, rows) if unrolled else as_rows(group.size, lanes)
        stage = rows_on_stack(state, rows) if unrolled else as_rows(group.stage, lanes)
        field_values = rows_on_stack(state, rows) if unrolled else as_rows(group.field_values, lanes)
        kept = rows_on_stack(state, of_stages) if held else values
        ahead = rows_on_stack(state, of_stages) if unrolled and not varying else as_rows(group.ahead, lanes)
        newest, time = rows_on_stack(state, rows) if unrolled else values, rows_on_stack(state, 1)
        clock, scratch = rows_on_stack(state, 2), rows_on_stack(part(group.state, 0), 2 * form.k)
        h = as_rows(group.h, lanes)[0]
        zero, infinite = everywhere(0.0, h), everywhere(INFINITY, h)
        if held:
            for i in range(of_stages):
                kept[i] = values[i]
        alive = as_rows(group.alive, lanes)[0] > 0.0
        iterations, rate = as_rows(group.iterations, lanes)[0], as_rows(group.rate, lanes)[0]
        taken = 0
        while True:
            begin_step(form, group, factor, kept, ahead, sizes, block_weights, floored_weights, clock)
            t, t_low = clock[0], clock[1]
            last, best, stalled = infinite, infinite, zero
            left = infinite  # iterations still to be made; infinite: that is not known
            again = zero > 0.0
            active = alive
            tried = 0
            while True:
                iteration(
                    field, form, group, t, t_low, h, active, factor, kept, moved, stage, field_values, newest,
                    time,
                )  # fmt: skip
                if form.vectors.groups:
                    measure_vectors(form, group, factor, kept, sizes, block_weights, floored_weights)
                tried += 1
                iterations = where(active, iterations + 1.0, iterations)
                left = left - 1.0
                # A lane is not judged any more once it is known how many iterations are left. Where that is
                # known of all, the end of the iteration need not wait for the rule.
                undecided = active & (left >= INFINITY)
                if tried == 1:  # one change tells no rate
                    last = best = largest_change(form, moved, block_weights, zero)
                elif somewhere(undecided):
                    # What is judged is the change that the next iteration would make of the stages, beside
                    # their block: bounded by that of the values.
                    change = largest_change(form, moved, block_weights, zero)
                    floored_change = largest_change(form, moved, floored_weights, zero)
                    best, stalled, measured_rate, converged, residual = judge(
                        change, last, best, stalled, rate, float(tried), TOLERANCE, 0.0
                    )
                    last = change
                    over = converged | stagnates(floored_change, stalled, STAGNATION)
                    remaining = further(
                        residual_at_end(converged, residual, best), measured_rate, log_residual
                    )
                    left = where(undecided, where(over, remaining, INFINITY), left)
                    rate = where(undecided, measured_rate, rate)
                    failing = undecided & (left >= INFINITY)
                    if not (tried == MOST_IN_LANES or (not varying and tried == 2 * MOST_IN_LANES)):
                        failing = failing & opposite(change < INFINITY)
                    if somewhere(failing):
                        # A shorter step is tried, or this one without values where that has not been; else
                        # the trajectory leaves.
                        leaves = failing if varying else failing & again
                        if not varying:
                            anew = failing & opposite(again)
                            again = again | anew
                            last = where(anew, INFINITY, last)
                            best = where(anew, INFINITY, best)
                            left = where(anew, INFINITY, left)
                            stalled = where(anew, 0.0, stalled)
                            for i in range(of_stages):
                                kept[i] = where(anew, 0.0, kept[i])
                        active = active & opposite(leaves)
                        alive = alive & opposite(leaves)
                active = active & (left > 0.0)
                if not somewhere(active):
                    break
            as_rows(group.alive, lanes)[0] = where(alive, 1.0, 0.0)
            as_rows(group.iterations, lanes)[0] = iterations
            end_step(form, group, kept, scratch, moved, sizes, block_weights, floored_weights)
            alive = as_rows(group.alive, lanes)[0] > 0.0
            taken += 1
            group.n += 1
            if not somewhere(alive & (everywhere(float(count - taken), h) > 0.0)):
                break
            if varying:
                if somewhere(opposite(as_rows(group.ordinary, lanes)[0] > 0.0)):
                    break
                h = as_rows(group.h, lanes)[0]
        if held:
            for i in range(of_stages):
                values[i] = kept[i]
        as_rows(group.rate, lanes)[0] = rate
        group.living = 1 if somewhere(alive) else 0

    return run
