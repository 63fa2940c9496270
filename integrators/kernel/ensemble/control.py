"""The ordinary end of a step of varying length, in all lanes at once.

Most steps are good enough and followed by one a little longer or shorter: these are judged, taken and
followed here, by the rules of `integrators.kernel.step.vary` and `integrators.kernel.step.estimate`. A lane
where anything else happens (a step that failed or was too long, a sample that is near, a coefficient that
looks like a kink's) is left as it is, and marked for `integrators.kernel.ensemble.own` to look after.
"""

from typing import Any

from integrators.kernel.ensemble.group import Group
from integrators.kernel.simd.emit import DOUBLE, splat
from integrators.kernel.simd.values import Value
from integrators.kernel.step.rule import NOTHING, SMALLEST

INFINITY = float("inf")
COEFFICIENTS = 8  # that a step is judged by; see `Context.estimators`
BORDERS = range(10, 12)  # rows there that extrapolate to the start and to the end of the step


class Control:
    """Writes the end of a step.

    Judging and aiming follow `estimate`, `longer` and `accepts` there line by line, but for the last bits
    and for lengths that are not rounded to ratios with tables, of which lanes have none.

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
        found = conditions[0]
        for one in conditions[1:]:
            found = self.w.b.and_(found, one)
        return found

    def judge(self) -> None:
        """Set `error`, `defect`, whether blocks are `certain` and `visible`: see `estimate` and `watch`."""
        from integrators.kernel.step.estimate import ALIKE, UNSEEN

        w, b = self.w, self.w.b
        error, defect = (w.variable(w.kind, w.zero.value) for _ in range(2))
        none = w.zero.compare("!=", 0.0)
        doubtful, visible, changes = (w.variable(w.bits, none) for _ in range(3))
        unseen_for = (self.h + self.row("length_behind").absolute()) * self.number("outermost")

        def raise_to(variable: Any, value: Value) -> None:
            b.store(Value(b, b.load(variable)).larger(value).value, variable)

        def note(variable: Any, condition: Any) -> None:
            b.store(b.or_(b.load(variable), condition), variable)

        for first, blocks, width in w.form.groups:
            largest, steepest = (w.variable(w.kind, w.zero.value) for _ in range(2))

            tops = largest, steepest

            def measure(block: Any, first: int = first, width: int = width, tops: Any = tops) -> None:
                start = w.at(block, width, first)
                extent = slope = missing = unseen = gap = w.zero
                for i in range(width):
                    d = w.at(start, 1, i)
                    f = self.coefficients(d)
                    low = f[1].larger(f[2]).larger(f[3])
                    high = f[6].larger(f[7])
                    note(doubtful, high.compare(">", self.number("doubt") * low))
                    note(changes, low.larger(high).compare(">", f[0] * ALIKE))
                    own = f[0].larger(low)
                    changing = w.get(w.state, w.at(1, w.form.rows, d) if w.form.second else d).absolute()
                    extent, slope = extent.larger(changing + self.h * own), slope.larger(own)
                    missing = missing.larger(f[5].larger(self.number("error_decay") * f[4]))
                    unseen = unseen.larger(f[7].larger(self.number("defect_decay") * f[6]))
                    gap = gap.larger(self.gap(d, f[6].larger(f[7])))
                w.put(gap, w.array(Group.slots["gaps"]), start)
                rows = w.size, w.moved, w.strict, w.floored
                for value, room in zip((extent, slope, missing, unseen), rows, strict=True):
                    w.put(value, room, start)
                raise_to(tops[0], extent)
                raise_to(tops[1], slope)

            w.each(blocks, measure)
            top, steep = Value(b, b.load(largest)), Value(b, b.load(steepest))
            note(doubtful, top.compare("<", SMALLEST))

            def compare(block: Any, first: int = first, width: int = width, tops: Any = (top, steep)) -> None:
                start = w.at(block, width, first)
                size = w.get(w.size, start).larger(tops[0] * NOTHING)
                slope = w.get(w.moved, start).larger(self.number("least_slope") * tops[1])
                missing, unseen = w.get(w.strict, start), w.get(w.floored, start)
                inverse, moves = w.one / size, slope.compare(">", 0.0)
                part = self.h / slope
                for value, worst in ((missing, error), (unseen, defect)):
                    raise_to(worst, ((value * inverse) * (value * part)).where(moves, 0.0))
                note(visible, (self.h * missing).compare(">", size * UNSEEN))
                jump = w.get(w.array(Group.slots["gaps"]), start) * unseen_for
                note(doubtful, jump.compare(">", size * self.number("negligible")))

            w.each(blocks, compare)
        self.error, self.defect = (Value(b, b.load(worst)) for worst in (error, defect))
        self.certain = b.and_(b.not_(b.load(doubtful)), b.load(changes))
        self.visible = b.load(visible)

    def coefficients(self, d: Any, which: range = range(COEFFICIENTS)) -> list[Value]:
        """Return the sizes of the Legendre coefficients of row d of the field by which steps are judged.

        Or its values at `BORDERS`.
        """
        w, k = self.w, self.w.form.k
        table, found = w.table(Group.slots["estimators"]), []
        for j in which:
            total = w.zero
            for i in range(k):
                value = w.get(w.values, w.at(i, w.form.rows, d))
                total = w.number(table, -(-k // 8) * 8 * j + i).fma(value, total)
            found.append(total.absolute() if j < COEFFICIENTS else total)
        return found

    def gap(self, d: Any, last: Value) -> Value:
        """Return how far row d's polynomials are apart where two steps meet, if farther than it may be."""
        from integrators.kernel.step.kinks import OUTSIDE

        w, slots = self.w, Group.slots
        start, end = self.coefficients(d, BORDERS)
        w.put(end, w.array(slots["ends_ahead"]), d)
        w.put(last, w.array(slots["lasts_ahead"]), d)
        apart = (start - w.get(w.array(slots["ends"]), d)).absolute()
        most = (last + w.get(w.array(slots["lasts"]), d)) * OUTSIDE
        return apart.where(apart.compare(">", most), 0.0)

    def aim(self) -> None:
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
        from integrators.kernel.step.vary import GROW, HELD_BACK

        w, b = self.w, self.w.b
        limited = self.number("allowed_defect") < INFINITY
        error_aim, defect_aim = self.number("error_aim"), self.number("defect_aim")
        self.error = log_of_order(self.error, self.number("error_power"))
        self.defect = log_of_order(self.defect, self.number("defect_power"))
        factor = as_errors_allow(
            self.error,
            self.row("error_behind"),
            error_aim,
            self.defect,
            self.row("defect_behind"),
            defect_aim,
            limited,
            log_ratio(self.h / self.row("length_behind").absolute()),
        )
        self.limit = self.row("length_limit") * APPROACH
        iterations = Value(b, b.load(w.sweeps)) - self.row("before")
        self.factor = as_iterations_allow(
            bounded(factor, GROW), self.number("busy"), iterations, self.h, self.limit
        )
        room = room_for_longer(self.error, error_aim, self.defect, defect_aim, limited)
        kept = b.and_(room.compare("<=", self.number("worth")), self.visible)
        self.free = b.or_(self.factor.compare(">=", HELD_BACK), kept)

    def take(self) -> None:
        """Take the step, and aim at the next one, in the lanes where that is all."""
        from integrators.kernel.step.control import SHORTEST  # imports numba, which compiling needs anyhow

        w, b = self.w, self.w.b
        slots = Group.slots
        self.judge()
        good = self.all(
            b.load(w.alive),
            self.certain,
            self.error.compare("<=", self.number("allowed_error")),
            self.defect.compare("<=", self.number("allowed_defect")),
        )
        self.aim()
        length = w.h * self.factor
        t, low = self.row("t0").two_sum(w.h)
        t, low = t.two_sum(low + self.row("time_low"))
        rest, since = (self.row("stop") - t) - low, self.row("since") + 1.0
        good = self.all(
            good,
            self.free,
            (rest * length).compare(">", 0.0),
            rest.absolute().compare(">", length.absolute()),
            length.absolute().compare("<=", self.number("longest")),
            length.absolute().compare(">", t.absolute() * SHORTEST),
            since.compare("<", self.row("unwatched")),
        )
        w.put(w.one.where(good, 0.0), w.array(slots["ordinary"]))
        news = {
            "t0": t, "time_low": low, "error_behind": self.error, "defect_behind": self.defect,
            "length_behind": w.h, "length_limit": self.limit, "h": length, "ratio": self.factor,
            "begin": w.one, "before": Value(b, b.load(w.sweeps)), "since": since,
        }  # fmt: skip
        for name, value in news.items():
            w.put(value.where(good, self.row(name)), w.array(slots[name]))
        rows = w.form.rows
        dim = rows * (2 if w.form.second else 1)
        ends, lasts = w.array(slots["ends"]), w.array(slots["lasts"])
        moves = ("next_state", w.state, dim), ("next_error", w.error, dim)
        for ahead, now, count in (*moves, ("ends_ahead", ends, rows), ("lasts_ahead", lasts, rows)):
            source = w.array(slots[ahead])

            def move(d: Any, source: Any = source, now: Any = now) -> None:
                w.put(w.get(source, d).where(good, w.get(now, d)), now, d)

            w.each(count, move)
