"""The ordinary end of a step of varying length, in all lanes at once.

Most steps are good enough and followed by one a little longer or shorter: these are judged, taken and
followed here, by the rules of `integrators.kernel.step.estimate` and `integrators.kernel.step.control`. A
lane where anything else happens (a step that failed or was too long, a sample that is near, a coefficient
that looks like that of a discontinuity) is left as it is, and marked for `integrators.kernel.ensemble.own` to
look after.
"""

from math import sqrt
from typing import Any

from integrators.kernel.ensemble.group import Group
from integrators.kernel.parts.estimate import (
    GAMMA_0,
)
from integrators.kernel.simd.emit import DOUBLE, splat
from integrators.kernel.simd.operations import greatest, where
from integrators.kernel.simd.values import Condition, Value
from integrators.kernel.step.rule import SMALLEST

INFINITY = float("inf")


def in_powers(k: int) -> list[list[float]]:
    """Return the factors of powers of x in Legendre polynomials on [-1, 1], orthonormal on [0, 1].

    Returns
    -------
    list of list of float
        For each power m below k those in the polynomials of degrees m, m + 2, ... below k.
    """
    from numpy.polynomial.legendre import leg2poly  # takes its time, and is needed to compile only

    powers = [leg2poly([0.0] * j + [sqrt(2 * j + 1)]) for j in range(k)]
    return [[float(powers[j][m]) for j in range(m, k, 2)] for m in range(k)]


# Rooms that the iteration does not need any more
MEASURED = "size", "moved", "block_weights", "floored_weights"


class Control:
    """Writes the end of a step.

    Estimate, verdict and next length are the functions of `integrators.kernel.step.estimate`,
    `discontinuities` and `control` that a single trajectory calls, applied to rows. What differs:
    coefficients are sums in another order, so that they differ in the last bits; lengths are not rounded to
    ratios with tables, of which lanes have none; and only the ordinary end of a step is written. Every other
    one is left to `own.end_attempt`.

    Parameters
    ----------
    w : Steps
        Writes the step itself, of `integrators.kernel.ensemble.steps`.
    """

    def __init__(self, w: Any):
        self.w, self.h = w, w.h.absolute()

    def row(self, name: str) -> Value:
        """Return a row of one number in each lane."""
        return self.w.get(self.w.array(Group.slots[name]))

    def number(self, name: str) -> Value:
        """Return a number of the group in all lanes."""
        b = self.w.b
        return Value(b, splat(b, b.load(self.w.word(Group.slots[name], DOUBLE)), self.w.lanes))

    def all(self, *conditions: Any) -> Any:
        """Return where all conditions hold."""
        result = conditions[0]
        for condition in conditions[1:]:
            result = self.w.b.and_(result, condition)
        return result

    def judge(self) -> None:
        """Set `error`, `quadrature_error`, where blocks are `certain` and `visible`; see `estimate`."""
        from integrators.kernel.step import estimate as rules  # imports numba, which compiling needs anyhow
        from integrators.kernel.step.discontinuities import gap_allowed
        from integrators.kernel.step.rounding import is_evident, is_visible

        w, b = self.w, self.w.b
        error, quadrature_error, evident_error, evident_quadrature_error = (
            w.variable(w.kind, w.zero.value) for _ in range(4)
        )
        none = w.zero.compare("!=", 0.0)
        doubtful, visible, changing = (w.variable(w.bits, none) for _ in range(3))
        most_apart = gap_allowed(
            self.number("negligible"),
            self.number("outermost"),
            self.h,
            self.row("previous_length").absolute(),
        )

        def raise_to(variable: Any, value: Value) -> None:
            b.store(greatest(value, Value(b, b.load(variable))).value, variable)

        def note(variable: Any, condition: Condition) -> None:
            b.store(b.or_(b.load(variable), condition.value), variable)

        for first, blocks, width in w.form.groups:
            largest, steepest = (w.variable(w.kind, w.zero.value) for _ in range(2))

            tops = largest, steepest

            def measure(block: Any, first: int = first, width: int = width, tops: Any = tops) -> None:
                start = w.at(block, width, first)
                scale = slope = gamma_error = gamma_last = gap = w.zero
                for i in range(width):
                    d = w.at(start, 1, i)
                    gammas, start_value, end_value = self.coefficients(d)
                    low, high, own, here, last = rules.judged(
                        *gammas, self.number("error_decay"), self.number("quadrature_error_decay")
                    )
                    note(doubtful, rules.is_doubtful(low, high, self.number("doubt")))
                    note(changing, rules.changes(low, high, gammas[GAMMA_0]))
                    moved = w.get(w.state, w.at(1, w.form.rows, d) if w.form.second else d).absolute()
                    scale, slope = greatest(scale, moved + self.h * own), greatest(slope, own)
                    gamma_error, gamma_last = greatest(gamma_error, here), greatest(gamma_last, last)
                    gap = greatest(gap, self.gap(d, high, start_value, end_value))
                w.put(gap, w.array(Group.slots["gaps"]), start)
                for name, value in zip(MEASURED, (scale, slope, gamma_error, gamma_last), strict=True):
                    w.put(value, getattr(w, name), start)
                speed = self.speed(start)
                raise_to(tops[0], scale * speed)
                raise_to(tops[1], slope * speed)

            w.each(blocks, measure)
            top, largest_slope = Value(b, b.load(largest)), Value(b, b.load(steepest))
            note(doubtful, top < SMALLEST)

            def compare(
                block: Any, first: int = first, width: int = width, tops: Any = (top, largest_slope)
            ) -> None:
                start = w.at(block, width, first)
                scale, slope, gamma_error, gamma_last = (w.get(getattr(w, name), start) for name in MEASURED)
                mass = w.unity / self.speed(start)
                largest = tops[0] * mass
                scale = rules.size_in_step(scale, largest)
                slope = rules.floored_slope(slope, tops[1] * mass, self.number("least_slope"))
                for gamma, worst, evident in (
                    (gamma_error, error, evident_error),
                    (gamma_last, quadrature_error, evident_quadrature_error),
                ):
                    own = where(slope > 0.0, rules.local_error(self.h, gamma, slope, scale), 0.0)
                    raise_to(worst, own)
                    raise_to(evident, where(is_evident(self.h, gamma, largest), own, 0.0))
                note(visible, is_visible(self.h, gamma_error, scale))
                note(doubtful, w.get(w.array(Group.slots["gaps"]), start) > most_apart * scale)

            w.each(blocks, compare)
        self.error, self.quadrature_error = (Value(b, b.load(worst)) for worst in (error, quadrature_error))
        self.evident = [
            Value(b, b.load(evident)) >= own
            for evident, own in (
                (evident_error, self.error),
                (evident_quadrature_error, self.quadrature_error),
            )
        ]
        self.certain = b.and_(b.not_(b.load(doubtful)), b.load(changing))
        self.visible = b.load(visible)

    def speed(self, d: Any) -> Value:
        """Return the velocity by momentum of row d, as `Blocks.speed`."""
        from integrators.kernel.step.size import speed_of

        w = self.w
        return speed_of(w.get(w.velocity, d)) if w.form.second else w.unity

    def coefficients(self, d: Any) -> tuple[list[Value], Value, Value]:
        """Return what row d is judged by, and keep its polynomial for the first values of the next step.

        Returns
        -------
        sizes : list of Value
            Of the field's coefficients `GAMMA_0` .. `LAST`.
        start, end : Value
            The polynomial at both ends of the step.
        """
        w, form = self.w, self.w.form
        sums = self.modes(d)
        ends = [w.zero, w.zero]  # at the end what polynomials of even degree contribute, and of odd degree
        for j, coefficient in enumerate(sums):
            ends[j % 2] = coefficient.fma(sqrt(2 * j + 1), ends[j % 2])
        for power, factors in enumerate(in_powers(form.k)):
            total = w.zero
            for coefficient, factor in zip(sums[power::2], factors, strict=True):
                total = coefficient.fma(factor, total)
            w.put(total, w.ahead, w.at(power, form.rows, d))
        even, odd = ends
        return [sums[j].absolute() for j in form.judged], even - odd, even + odd

    def modes(self, d: Any) -> list[Value]:
        """Return the Legendre coefficients of the values of row d.

        Those of even degree are the same for values at mirrored nodes, those of odd degree opposite.
        """
        w, k, rows = self.w, self.w.form.k, self.w.form.rows
        table, values = (
            w.table(Group.slots["to_legendre"]),
            [w.get(w.values, w.at(i, rows, d)) for i in range(k)],
        )
        pairs = [(values[i], values[k - 1 - i]) for i in range(k // 2)]
        parts = [x + y for x, y in pairs] + values[k // 2 : k - k // 2], [x - y for x, y in pairs]
        sums = []
        for j in range(k):
            total = w.zero
            for i, part in enumerate(parts[j % 2]):
                total = w.number(table, k * j + i).fma(part, total)
            sums.append(total)
        return sums

    def gap(self, d: Any, last: Value, start: Value, end: Value) -> Value:
        """Return how far row d's polynomials are apart where two steps meet, if farther than it may be."""
        from integrators.kernel.step.estimate import is_gap

        w, slots = self.w, Group.slots
        w.put(end, w.array(slots["next_ends"]), d)
        w.put(last, w.array(slots["next_last_coefficients"]), d)
        previous, previous_last = (w.get(w.array(slots[name]), d) for name in ("ends", "last_coefficients"))
        apart = (start - previous).absolute()
        return where(is_gap(apart, last, previous_last), apart, 0.0)

    def set_factor(self) -> None:
        """Set the `factor` of the next step's length to this one's; see `integrators.kernel.step.control`."""
        from integrators.kernel.step.control import (
            APPROACH,
            as_errors_allow,
            as_iterations_allow,
            bounded,
            log_of_order,
            log_ratio,
            room_for_longer,
        )
        from integrators.kernel.step.vary import LIMITED_GROWTH, MOST_GROWTH

        w, b = self.w, self.w.b
        limited = self.number("allowed_quadrature_error") < INFINITY
        error_aim, quadrature_error_aim = self.number("error_aim"), self.number("quadrature_error_aim")
        self.error = log_of_order(self.error, self.number("error_power"))
        self.quadrature_error = log_of_order(self.quadrature_error, self.number("quadrature_error_power"))
        factor, in_doubt = as_errors_allow(
            self.error,
            self.row("previous_error"),
            error_aim,
            self.quadrature_error,
            self.row("previous_quadrature_error"),
            quadrature_error_aim,
            limited,
            log_ratio(self.h / self.row("previous_length").absolute()),
            *self.evident,
            0.0,
        )
        self.limit = self.row("length_limit") * APPROACH
        iterations = Value(b, b.load(w.iterations)) - self.row("before")
        self.certain = b.and_(self.certain, b.not_(in_doubt.value))
        self.factor = as_iterations_allow(
            bounded(factor, MOST_GROWTH), self.number("target_iterations"), iterations, self.h, self.limit
        )
        room = room_for_longer(self.error, error_aim, self.quadrature_error, quadrature_error_aim, limited)
        kept = b.and_(room.compare("<=", self.number("worth")), self.visible)
        self.free = b.or_(self.factor.compare(">=", LIMITED_GROWTH), kept)

    def take(self) -> None:
        """Take the step, and aim at the next one, in the lanes where that is all."""
        from integrators.kernel.step.control import is_distinct, is_good
        from integrators.kernel.step.sums import time_after

        w, b = self.w, self.w.b
        slots = Group.slots
        self.judge()
        good = self.all(
            b.load(w.alive),
            is_good(
                self.error,
                self.number("allowed_error"),
                self.quadrature_error,
                self.number("allowed_quadrature_error"),
            ).value,
        )
        self.set_factor()
        length = w.h * self.factor
        t, low = time_after(self.row("t0"), self.row("time_low"), w.h)
        time_left, since = (self.row("stop") - t) - low, self.row("since") + 1.0
        good = self.all(
            good,
            self.certain,
            self.free,
            (time_left * length).compare(">", 0.0),
            time_left.absolute().compare(">", length.absolute()),
            length.absolute().compare("<=", self.number("longest")),
            is_distinct(length, t).value,
            since.compare("<", self.row("unwatched")),
        )
        w.put(w.unity.where(good, 0.0), w.array(slots["ordinary"]))
        news = {
            "t0": t, "time_low": low, "previous_error": self.error,
            "previous_quadrature_error": self.quadrature_error,
            "previous_length": w.h, "length_limit": self.limit, "h": length, "ratio": self.factor,
            "begin": w.unity, "before": Value(b, b.load(w.iterations)), "since": since,
        }  # fmt: skip
        for name, value in news.items():
            w.put(value.where(good, self.row(name)), w.array(slots[name]))
        rows = w.form.rows
        dim = rows * (2 if w.form.second else 1)
        ends, last_coefficients = w.array(slots["ends"]), w.array(slots["last_coefficients"])
        moves = ("next_state", w.state, dim), ("next_error", w.error, dim)
        for ahead, now, count in (
            *moves,
            ("next_ends", ends, rows),
            ("next_last_coefficients", last_coefficients, rows),
        ):
            source = w.array(slots[ahead])

            def move(d: Any, source: Any = source, now: Any = now) -> None:
                w.put(w.get(source, d).where(good, w.get(now, d)), now, d)

            w.each(count, move)
