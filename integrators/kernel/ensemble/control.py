"""The ordinary end of a step of varying length, in all lanes at once.

Most steps are good enough and followed by one a little longer or shorter: these are judged, taken and
followed here, by the rules of `integrators.kernel.step.estimate` and `integrators.kernel.step.control`. A
lane where anything else happens (a step that failed or was too long, a sample that is near, a coefficient
that looks like that of a discontinuity) is left as it is, and marked for `integrators.kernel.ensemble.own` to
look after.

What differs from a single trajectory: coefficients are sums in another order, so that they differ in the last
bits; lengths are not rounded to ratios with tables, of which lanes have none.
"""

from typing import Any

from integrators.kernel.inside.discontinuities import gap_allowed
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.lanes import everywhere
from integrators.kernel.simd.operations import fma, greatest, opposite, size, where
from integrators.kernel.simd.views import as_parts
from integrators.kernel.step.control import (
    APPROACH,
    INFINITY,
    as_errors_allow,
    as_iterations_allow,
    bounded,
    is_distinct,
    is_good,
    log_of_order,
    log_ratio,
    room_for_longer,
)
from integrators.kernel.step.estimate import (
    changes,
    floored_slope,
    is_doubtful,
    is_gap,
    judged,
    local_error,
    size_in_step,
)
from integrators.kernel.step.rounding import is_evident, is_visible
from integrators.kernel.step.rule import SMALLEST
from integrators.kernel.step.size import speed_of
from integrators.kernel.step.sums import time_after
from integrators.kernel.trajectory.vary import LIMITED_GROWTH, MOST_GROWTH


def ends_of_steps(lanes: int, few: int) -> Any:
    """Return what takes the step, and aims at the next one, in the lanes where that is all.

    It looks at ``few`` of the lanes, from lane ``first`` on.
    """

    @compiled
    def part(numbers, first):
        """Return the rows of an array as far as these lanes have them."""
        return as_parts(numbers + first, few, lanes)

    @compiled
    def speed(form, group, first, d, unity):
        """Return the velocity by momentum of row d, as `Blocks.speed`."""
        return speed_of(part(group.velocity, first)[d]) if form.second else unity

    @compiled
    def modes(form, group, values, d, scratch, zero):
        """Set the Legendre coefficients of the values of row d, in the first k rows of ``scratch``.

        Those of even degree are the same for values at mirrored nodes, those of odd degree opposite.
        """
        k, rows = form.k, form.rows
        half, halves = k // 2, (k + 1) // 2
        for i in range(half):
            x, y = values[rows * i + d], values[rows * (k - 1 - i) + d]
            scratch[k + i], scratch[k + k - 1 - i] = x + y, x - y
        if k % 2 == 1:
            scratch[k + half] = values[rows * half + d]
        for j in range(k):
            total = zero
            for i in range(half if j % 2 == 1 else halves):
                total = fma(
                    group.to_legendre[k * j + i], scratch[k + (k - 1 - i if j % 2 == 1 else i)], total
                )
            scratch[j] = total

    @compiled
    def keep_polynomial(form, group, first, d, scratch, zero):
        """Keep row d's polynomial for the next step's first values; return it at both ends of this one."""
        k, rows = form.k, form.rows
        ahead, powers = part(group.ahead, first), group.in_powers
        even, odd = zero, zero
        for j in range(k):
            if j % 2 == 0:
                even = fma(scratch[j], powers[k * k + j], even)
            else:
                odd = fma(scratch[j], powers[k * k + j], odd)
        for power in range(k):
            total = zero
            for j in range(power, k, 2):
                total = fma(scratch[j], powers[k * power + j], total)
            ahead[rows * power + d] = total
        return even - odd, even + odd

    @compiled
    def gap(group, first, d, last, start, end):
        """Return how far row d's polynomials are apart where two steps meet, if farther than it may be."""
        part(group.next_ends, first)[d] = end
        part(group.next_last_coefficients, first)[d] = last
        apart = size(start - part(group.ends, first)[d])
        return where(is_gap(apart, last, part(group.last_coefficients, first)[d]), apart, 0.0)

    @compiled
    def judge(form, group, first, values, length, scratch, scales, slopes, gamma_errors, gamma_lasts):
        """Return both errors, whether they are evident, and where blocks are certain, and visible."""
        state, gaps = part(group.state, first), part(group.gaps, first)
        zero, unity = everywhere(0.0, length), everywhere(1.0, length)
        error, quadrature_error, evident_error, evident_quadrature_error = zero, zero, zero, zero
        doubtful = visible = changing = zero > 0.0
        most_apart = gap_allowed(
            group.negligible, group.outermost, length, size(part(group.previous_length, first)[0])
        )
        rows, count, width = form.rows, form.blocks.count, form.blocks.width
        for g in range(form.blocks.groups):
            largest, steepest = zero, zero
            for b in range(count):
                start = form.blocks.first + (g * count + b) * width
                scale, slope, gamma_error, gamma_last, far = zero, zero, zero, zero, zero
                for d in range(start, start + width):
                    modes(form, group, values, d, scratch, zero)
                    at_start, at_end = keep_polynomial(form, group, first, d, scratch, zero)
                    low, high, own, here, last = judged(
                        size(scratch[form.gamma_0]),
                        size(scratch[form.gamma_1]),
                        size(scratch[form.gamma_2]),
                        size(scratch[form.gamma_3]),
                        size(scratch[form.before_error]),
                        size(scratch[form.at_error]),
                        size(scratch[form.before_last]),
                        size(scratch[form.last]),
                        group.error_decay,
                        group.quadrature_error_decay,
                    )
                    doubtful = doubtful | is_doubtful(low, high, group.doubt)
                    changing = changing | changes(low, high, size(scratch[form.gamma_0]))
                    moved = size(state[rows + d if form.second else d])
                    scale, slope = greatest(scale, moved + length * own), greatest(slope, own)
                    gamma_error, gamma_last = greatest(gamma_error, here), greatest(gamma_last, last)
                    far = greatest(far, gap(group, first, d, high, at_start, at_end))
                gaps[start], scales[start], slopes[start] = far, scale, slope
                gamma_errors[start], gamma_lasts[start] = gamma_error, gamma_last
                velocity = speed(form, group, first, start, unity)
                largest = greatest(scale * velocity, largest)
                steepest = greatest(slope * velocity, steepest)
            doubtful = doubtful | (largest < SMALLEST)
            for b in range(count):
                start = form.blocks.first + (g * count + b) * width
                mass = unity / speed(form, group, first, start, unity)
                most = largest * mass
                scale = size_in_step(scales[start], most)
                slope = floored_slope(slopes[start], steepest * mass, group.least_slope)
                gamma_error, gamma_last = gamma_errors[start], gamma_lasts[start]
                own = where(slope > 0.0, local_error(length, gamma_error, slope, scale), 0.0)
                error = greatest(own, error)
                evident_error = greatest(
                    where(is_evident(length, gamma_error, most), own, 0.0), evident_error
                )
                own = where(slope > 0.0, local_error(length, gamma_last, slope, scale), 0.0)
                quadrature_error = greatest(own, quadrature_error)
                evident_quadrature_error = greatest(
                    where(is_evident(length, gamma_last, most), own, 0.0), evident_quadrature_error
                )
                visible = visible | is_visible(length, gamma_error, scale)
                doubtful = doubtful | (gaps[start] > most_apart * scale)
        return (
            error,
            quadrature_error,
            evident_error >= error,
            evident_quadrature_error >= quadrature_error,
            opposite(doubtful) & changing,
            visible,
        )

    @compiled
    def keep(numbers, first, good, new):
        """Set a row where a step is good."""
        row = part(numbers, first)
        row[0] = where(good, new, row[0])

    @compiled
    def keep_rows(numbers, first, good, new, n):
        """Set n rows where a step is good."""
        rows_, news = part(numbers, first), part(new, first)
        for d in range(n):
            rows_[d] = where(good, news[d], rows_[d])

    @compiled
    def end_step(form, group, first, values, h, alive, scratch, scales, slopes, gamma_errors, gamma_lasts):
        length, rows = size(h), form.rows
        dim = 2 * rows if form.second else rows
        iterations, previous_length = part(group.iterations, first)[0], part(group.previous_length, first)[0]
        error, quadrature_error, error_is_evident, quadrature_error_is_evident, certain, visible = judge(
            form, group, first, values, length, scratch, scales, slopes, gamma_errors, gamma_lasts
        )
        good = alive & is_good(error, group.allowed_error, quadrature_error, group.allowed_quadrature_error)
        limited = everywhere(group.allowed_quadrature_error, length) < INFINITY
        error = log_of_order(error, group.error_power)
        quadrature_error = log_of_order(quadrature_error, group.quadrature_error_power)
        logarithm, in_doubt = as_errors_allow(
            error,
            part(group.previous_error, first)[0],
            group.error_aim,
            quadrature_error,
            part(group.previous_quadrature_error, first)[0],
            group.quadrature_error_aim,
            limited,
            log_ratio(length / size(previous_length)),
            error_is_evident,
            quadrature_error_is_evident,
            0.0,
        )
        limit = part(group.length_limit, first)[0] * APPROACH
        factor = as_iterations_allow(
            bounded(logarithm, MOST_GROWTH),
            group.target_iterations,
            iterations - part(group.before, first)[0],
            length,
            limit,
        )
        room_left = room_for_longer(
            error, group.error_aim, quadrature_error, group.quadrature_error_aim, limited
        )
        free = (factor >= LIMITED_GROWTH) | ((room_left <= group.worth) & visible)
        following = h * factor
        t, low = time_after(part(group.t0, first)[0], part(group.time_low, first)[0], h)
        time_left, since = (part(group.stop, first)[0] - t) - low, part(group.since, first)[0] + 1.0
        good = (
            good
            & certain
            & opposite(in_doubt)
            & free
            & (time_left * following > 0.0)
            & (size(time_left) > size(following))
            & (size(following) <= group.longest)
            & is_distinct(following, t)
            & (since < part(group.unwatched, first)[0])
        )
        part(group.ordinary, first)[0] = where(good, 1.0, 0.0)
        keep(group.t0, first, good, t)
        keep(group.time_low, first, good, low)
        keep(group.previous_error, first, good, error)
        keep(group.previous_quadrature_error, first, good, quadrature_error)
        keep(group.previous_length, first, good, h)
        keep(group.length_limit, first, good, limit)
        keep(group.h, first, good, following)
        keep(group.ratio, first, good, factor)
        keep(group.begin, first, good, 1.0)
        keep(group.before, first, good, iterations)
        keep(group.since, first, good, since)
        keep_rows(group.state, first, good, group.next_state, dim)
        keep_rows(group.error, first, good, group.next_error, dim)
        keep_rows(group.ends, first, good, group.next_ends, rows)
        keep_rows(group.last_coefficients, first, good, group.next_last_coefficients, rows)

    return end_step
