"""Steps of HBVM(k, s) on trajectories in lanes, compiled around the field of one system.

Every number of a step is a vector, with one trajectory in each lane, so that there is nothing to shuffle and
no sum over lanes. Stages come one after another; each uses the values that the field has had at the stages
before it in the same iteration (Gauss and Seidel). The arithmetic is that of `integrators.kernel.step`:
nodes, weights and the state are sums of two doubles, and what is at the size of the state is added last.

A trajectory whose iteration has ended keeps its values while the others iterate on: what happens
in a lane depends on nothing in the others.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from llvmlite import ir

from integrators.kernel.ensemble.control import Control
from integrators.kernel.ensemble.group import Group
from integrators.kernel.ensemble.writer import Index, Writer
from integrators.kernel.native import machine
from integrators.kernel.simd.emit import DOUBLE, INTEGER, splat, text_of
from integrators.kernel.simd.operations import where
from integrators.kernel.simd.values import Value
from integrators.kernel.step.rule import (
    LOG_RESIDUAL,
    LOG_RESIDUAL_VARYING,
    MOST_IN_LANES,
    STAGNATION,
    TOLERANCE,
)

INFINITY = float("inf")
ROWS_AT_A_TIME = 2  # rows of a product side by side: their sums stay in registers, and share its matrix


Blocks = tuple[tuple[int, int, int], ...]
"""First row, number of blocks and rows of a block, of groups of blocks."""


@dataclass(frozen=True)
class Form:
    """What the code of a step depends on besides the field.

    Attributes
    ----------
    lanes, k, rows : int
        Trajectories side by side, stages, components of a stage.
    second : bool
        Second-order form: stages hold positions, the state is (q, p).
    unit : bool
        Whether the rows' factors h q' / p are in the matrix.
    varying : bool
        Whether every lane has a step of its own length. The matrix is that of a step of 1, the end of the
        step goes to `Group.next_state`, and a lane whose equations are not solved is not alive then.
    unrolled : bool
        Whether stages and rows are unrolled; see `ensemble.prepared.unrolled_for`.
    judged : tuple of int
        Degrees of the Legendre coefficients that such a step is judged by; see `tables.degrees_judged`.
    groups : tuple of tuple of int
        First row, number of blocks and rows of a block, of groups of blocks (positions, momenta).
    vectors : tuple of tuple of int
        The same of tangent vectors, which may begin at 0: they are measured after each iteration.
    """

    lanes: int
    k: int
    rows: int
    second: bool
    unit: bool
    varying: bool
    unrolled: bool
    judged: tuple[int, ...]
    groups: Blocks
    vectors: Blocks = ()


class Steps(Writer):
    """Writes LLVM's text of ``void(group, count)``, so many steps of a `Group`, around a field on lanes."""

    # Where the arrays of `Group` are, by their names there.
    nodes: Any
    nodes_low: Any
    weights: Any
    weights_low: Any
    position_weights: Any
    position_weights_low: Any
    state: Any
    error: Any
    velocity: Any
    par: Any
    factor: Any
    moved: Any
    block_weights: Any
    floored_weights: Any
    size: Any
    stage: Any
    field_values: Any

    def __init__(self, inner: str, form: Form):
        super().__init__(inner, form.lanes, unrolled=form.unrolled)
        self.form = form

    def text(self) -> str:
        """Return the module."""
        b, form = self.b, self.form
        k, rows = form.k, form.rows
        count = self.function.args[1]
        self.zero = Value(b, ir.Constant(self.kind, [0.0] * form.lanes))
        self.unity = self.zero.constant(1.0)
        slots = Group.slots
        for name in (
            "nodes",
            "nodes_low",
            "weights",
            "weights_low",
            "position_weights",
            "position_weights_low",
        ):
            setattr(self, name, self.array(slots[name]))
        for name in ("state", "error", "velocity", "par"):
            setattr(self, name, self.array(slots[name]))
        for name in ("factor", "moved", "block_weights", "floored_weights", "size", "stage", "field_values"):
            setattr(self, name, self.room(slots[name], rows))
        self.held = self.unrolled and machine.many_registers()
        self.values = self.room(slots["values"], k * rows) if self.held else self.array(slots["values"])
        self.ahead = self.array(slots["ahead"]) if form.varying else self.room(slots["ahead"], k * rows)
        self.base = self.array(slots["base"])
        kept = self.array(slots["values"])
        pointer = DOUBLE.as_pointer()
        self.result, self.exception = b.alloca(pointer), b.alloca(pointer)
        self.h = self.get(self.array(slots["h"]))
        if self.held:
            self.each(k * rows, lambda i: self.put(self.get(kept, i), self.values, i))
        alive = self.get(self.array(slots["alive"]))
        self.alive = self.variable(self.bits, alive.compare("!=", 0.0))
        self.iterations, self.rate = (
            self.variable(self.kind, self.get(self.array(slots[name])).value)
            for name in ("iterations", "rate")
        )
        taken = self.variable(INTEGER, ir.Constant(INTEGER, 0))
        loop, end = self.function.append_basic_block("step"), self.function.append_basic_block("done")
        b.branch(loop)
        b.position_at_end(loop)
        self.step()
        steps = b.add(b.load(taken), ir.Constant(INTEGER, 1))
        b.store(steps, taken)
        b.store(b.add(b.load(self.word(slots["n"])), ir.Constant(INTEGER, 1)), self.word(slots["n"]))
        living = self.any(b.load(self.alive))
        b.cbranch(b.and_(living, b.icmp_signed("<", steps, count)), loop, end)
        b.position_at_end(end)
        if self.held:
            self.each(k * rows, lambda i: self.put(self.get(self.values, i), kept, i))
        self.put(self.unity.where(b.load(self.alive), 0.0), self.array(slots["alive"]))
        for variable, name in ((self.iterations, "iterations"), (self.rate, "rate")):
            self.put(Value(b, b.load(variable)), self.array(slots[name]))
        b.store(b.zext(self.any(b.load(self.alive)), INTEGER), self.word(slots["living"]))
        b.ret_void()
        return text_of(self.module)

    def step(self) -> None:
        """Write one step of all lanes."""
        self.begin()
        self.sizes()
        self.predict()
        self.iterate()
        self.finish()
        if self.form.varying:
            Control(self).take()

    def each_row(self, body: Callable[[Any], None]) -> None:
        """Write ``body(d)`` for every component of a stage."""
        self.each(self.form.rows, body)

    def begin(self) -> None:
        """Set what stages have besides the state and the values, and the time of the step."""
        from integrators.kernel.step.sums import part_of_drift, time_of_step  # imports numba

        b, form = self.b, self.form

        def row(d: Index) -> None:
            error = self.get(self.error, d)
            if not form.second:
                if form.varying:
                    self.put(self.h, self.factor, d)
                self.each(form.k, lambda i: self.put(error, self.base, self.at(i, form.rows, d)))
                return
            kh = self.h * self.get(self.velocity, d)
            if not form.unit:
                self.put(self.h * kh if form.varying else kh, self.factor, d)
            drift = self.drift(d, kh)

            def stage(i: Index) -> None:
                c, c_low = self.number(self.nodes, i), self.number(self.nodes_low, i)
                self.put(part_of_drift(c, c_low, *drift, error), self.base, self.at(i, form.rows, d))

            self.each(form.k, stage)

        self.each_row(row)
        slots = Group.slots
        n = Value(b, splat(b, b.sitofp(b.load(self.word(slots["n"])), DOUBLE), form.lanes))
        t0, time_low = (self.get(self.array(slots[name])) for name in ("t0", "time_low"))
        self.t, self.t_low = time_of_step(t0, time_low, n, self.h)

    def drift(self, d: Index, kh: Value) -> tuple[Value, Value]:
        """Return kh (p + its error) as a sum of two doubles."""
        from integrators.kernel.step.sums import multiplied  # imports numba

        momentum = self.at(1, self.form.rows, d)
        return multiplied(kh, self.get(self.state, momentum), self.get(self.error, momentum))

    def sizes(self) -> None:
        """Set what a change of the values is: that of the stages which follows from it, beside their block.

        The size of a block is the largest at the start of the step and, about, at its end. Where every row is
        a block and the step size fixed, floored_change sizes are at least how far a row of the group moves,
        as in `integrators.kernel.step.size.take_sizes`.
        """
        self.invert_sizes(self.form.groups, lambda d, _: self.component_size(d))

    def sizes_of_vectors(self) -> None:
        """Set the same of tangent vectors, which are also as large as the newest values move the stages."""

        def own(d: Index, weight: Value) -> tuple[Value, Value]:
            last = self.get(self.values, self.at(self.form.k - 1, self.form.rows, d))
            size, moved = self.component_size(d)
            return size.max((weight * last).absolute()), moved

        self.invert_sizes(self.form.vectors, own)

    def component_size(self, d: Index) -> tuple[Value, Value]:
        """Return the size of a component at the start and, about, at the end of a step; and its movement."""
        y = self.get(self.state, d)
        if self.form.second:
            moved, _ = self.drift(d, self.h * self.get(self.velocity, d))
        else:
            moved = self.h * self.get(self.values, self.at(self.form.k - 1, self.form.rows, d))
        return y.absolute().max((y + moved).absolute()), moved.absolute()

    def invert_sizes(self, groups: Blocks, own: Callable[[Index, Value], tuple[Value, Value]]) -> None:
        """Write the weights of changes in groups of blocks, by ``own(d, weight)``.

        That is the size of a component, and how far it moves. The weight turns a change of the values into
        one of the stages.
        """
        from integrators.kernel.step.size import inverse_sizes, least_part  # imports numba

        form = self.form
        least = least_part(form.varying)
        matrix_norm = Value(
            self.b, splat(self.b, self.b.load(self.word(Group.slots["matrix_norm"], DOUBLE)), form.lanes)
        )

        def weight_of(d: Index) -> Value:
            return matrix_norm if form.unit else self.get(self.factor, d).absolute() * matrix_norm

        for first, blocks, width in groups:
            tops = largest, farthest = [self.variable(self.kind, self.zero.value) for _ in range(2)]

            def measure(block: Index, first: int = first, width: int = width, tops: Any = tops) -> None:
                start = self.at(block, width, first)
                size = self.zero
                for i in range(width):
                    d = self.at(start, 1, i)
                    component_size, moved = own(d, weight_of(d))
                    size = size.max(component_size)
                    if width == 1 and not form.varying:
                        self.b.store(self.load(tops[1]).max(moved).value, tops[1])
                self.put(size, self.size, start)
                self.b.store(self.load(tops[0]).max(size).value, tops[0])

            self.each(blocks, measure)
            tops = self.load(largest), self.load(farthest)

            def invert(block: Index, first: int = first, width: int = width, tops: Any = tops) -> None:
                start = self.at(block, width, first)
                inverses = inverse_sizes(self.get(self.size, start), tops[0], least, self.zero, tops[1])
                for i in range(width):
                    d = self.at(start, 1, i)
                    weight = weight_of(d)
                    self.put(weight * inverses[0], self.block_weights, d)
                    self.put(weight * inverses[1], self.floored_weights, d)

            self.each(blocks, invert)

    def combination(
        self, table: Any, i: Index, values: Any, known: dict[Index, Value] | None = None
    ) -> Callable[..., list[Value]]:
        """Return what makes ``sum_j table[i, j] values[j, d]`` for rows d, each added to a start.

        Values that are ``known`` by their index are not loaded.
        """
        k, rows = self.form.k, self.form.rows
        factors = [self.number(table, self.at(i, k, j)) for j in range(k)]

        # The newest value comes last: all the rest need not wait for it.
        order = [*range(i, k), *range(i)] if isinstance(i, int) else [*range(k)]

        def totals(some: list[Index], starts: list[Value] | None = None) -> list[Value]:
            for j in order:
                indices = [self.at(j, rows, d) for d in some]
                factor = factors[j]
                operands = [known[p] if known and p in known else self.get(values, p) for p in indices]
                if starts is None:
                    starts = [factor * value for value in operands]
                else:
                    starts = [factor.fma(value, start) for value, start in zip(operands, starts, strict=True)]
            assert starts is not None
            return starts

        return totals

    def few_rows(self, body: Callable[[list[Index]], None]) -> None:
        """Write ``body`` for `ROWS_AT_A_TIME` components of a stage at a time."""
        if not self.unrolled:
            self.each_row(lambda d: body([d]))
            return
        for first in range(0, self.form.rows, ROWS_AT_A_TIME):
            body([*range(first, min(first + ROWS_AT_A_TIME, self.form.rows))])

    def predict(self) -> None:
        """First values: the last step's polynomial at the nodes of this one."""
        k, rows = self.form.k, self.form.rows
        if self.form.varying:
            self.predict_from_polynomial()
            return
        table = self.table(Group.slots["extrapolation"])

        def stage(i: Index) -> None:
            totals = self.combination(table, i, self.values)

            def ahead(some: list[Index]) -> None:
                for d, total in zip(some, totals(some), strict=True):
                    self.put(total, self.ahead, self.at(i, rows, d))

            self.few_rows(ahead)

        self.each(k, stage)
        self.each(k * rows, lambda i: self.put(self.get(self.ahead, i), self.values, i))

    def predict_from_polynomial(self) -> None:
        """As `predict`, from the powers of the polynomial: this step's length may be another one."""
        from integrators.kernel.step.begin import on_previous_step  # imports numba

        slots, k, rows = Group.slots, self.form.k, self.form.rows
        ratio, begin = (self.get(self.array(slots[name])) for name in ("ratio", "begin"))
        there = ratio.compare("!=", 0.0)

        def stage(i: Index) -> None:
            x = on_previous_step(self.number(self.nodes, i), begin, ratio)

            def row(d: Index) -> None:
                powers = [self.get(self.ahead, self.at(j, rows, d)) for j in range(k)]
                self.put(x.polynomial(powers).where(there, 0.0), self.values, self.at(i, rows, d))

            self.each_row(row)

        self.each(k, stage)

    def iterate(self) -> None:
        """Iterate until every lane is solved, or has left."""
        b, form = self.b, self.form
        infinite = self.zero.constant(INFINITY).value
        none = ir.Constant(self.bits, [0] * form.lanes)
        self.last, self.best = self.variable(self.kind, infinite), self.variable(self.kind, infinite)
        self.stalled = self.variable(self.kind, self.zero.value)
        # Iterations still to be made; infinite: that is not known
        self.left = self.variable(self.kind, infinite)
        self.again = self.variable(self.bits, none)
        self.active = self.variable(self.bits, b.load(self.alive))
        self.tried = self.variable(INTEGER, ir.Constant(INTEGER, 0))
        loop, end = self.function.append_basic_block("iteration"), self.function.append_basic_block("solved")
        b.branch(loop)
        b.position_at_end(loop)
        self.iteration()
        self.rule()
        b.cbranch(self.any(b.load(self.active)), loop, end)
        b.position_at_end(end)

    def iteration(self) -> None:
        """Set new values at all stages, one after another, and how much they have changed."""
        b, form = self.b, self.form
        k, rows = form.k, form.rows
        active = b.load(self.active)
        matrix = self.table(Group.slots["matrix"])
        newest: dict[Index, Value] = {}  # of the stage before, which is waited for
        self.each_row(lambda d: self.put(self.zero, self.moved, d))

        def stage(i: Index) -> None:
            # Its address is loaded anew for each stage of few: the compiler would keep all values, of which
            # registers hold a few, and spend as much on moving them as on the products.
            values = self.values if self.held or not self.unrolled else self.table(Group.slots["values"])
            totals = self.combination(matrix, i, values, dict(newest))
            newest.clear()

            def displace(some: list[Index]) -> None:
                bases = [self.get(self.base, self.at(i, rows, d)) for d in some]
                for d, total, base in zip(
                    some, totals(some, bases if form.unit else None), bases, strict=True
                ):
                    moved = total if form.unit else self.get(self.factor, d).fma(total, base)
                    self.put(self.get(self.state, d) + moved, self.stage, d)

            self.few_rows(displace)
            time = self.t + self.number(self.nodes, i).fma(self.h, self.t_low)
            b.call(
                self.field, [self.result, self.exception, time.value, self.stage, self.par, self.field_values]
            )

            def keep(d: Index) -> None:
                index = self.at(i, rows, d)
                old, new = self.get(values, index), self.get(self.field_values, d)
                self.put(self.get(self.moved, d).larger((new - old).absolute()), self.moved, d)
                kept = new.where(active, old)
                self.put(kept, values, index)
                if self.unrolled:
                    newest[index] = kept

            self.each_row(keep)

        self.each(k, stage)

    def rule(self) -> None:
        """Count an iteration, and apply the stopping rule, in every lane by itself.

        A lane is not judged any more once it is known how many iterations are left. Where that is known of
        all, the end of the iteration need not wait for the rule.
        """
        b, form = self.b, self.form
        if form.vectors:
            self.sizes_of_vectors()
        tried = b.add(b.load(self.tried), ir.Constant(INTEGER, 1))
        b.store(tried, self.tried)
        active, iterations, left = b.load(self.active), self.load(self.iterations), self.load(self.left) - 1.0
        b.store((iterations + 1.0).where(active, iterations).value, self.iterations)
        b.store(left.value, self.left)
        undecided = b.and_(active, left.compare(">=", INFINITY))
        with b.if_then(self.any(undecided)):
            self.judge(undecided, tried)
        b.store(b.and_(b.load(self.active), self.load(self.left).compare(">", 0.0)), self.active)

    def judge(self, undecided: Any, tried: Any) -> None:
        """Let lanes know how many iterations are left, where that has become known, and end those that fail.

        What is judged is the change that the next iteration would make of the stages, beside
        their block: bounded by that of the values.
        """
        # Imports numba
        from integrators.kernel.step.stopping import further, judge, residual_at_end, stagnates

        b, form = self.b, self.form
        change, floored_change = (self.variable(self.kind, self.zero.value) for _ in range(2))

        def largest(d: Index) -> None:
            moved = self.get(self.moved, d)
            for scales, top in ((self.block_weights, change), (self.floored_weights, floored_change)):
                size = (moved * self.get(scales, d)).absolute()
                b.store(self.load(top).larger(size).value, top)

        self.each_row(largest)
        largest_change, best, rate = self.load(change), self.load(self.best), self.load(self.rate)
        count = Value(b, splat(b, b.sitofp(tried, DOUBLE), form.lanes))
        best, stalled, rate, converged, residual = judge(
            largest_change, self.load(self.last), best, self.load(self.stalled), rate, count, TOLERANCE, 0.0
        )
        over = converged | stagnates(self.load(floored_change), stalled, STAGNATION)
        log_residual = LOG_RESIDUAL_VARYING if form.varying else LOG_RESIDUAL
        more = where(over, further(residual_at_end(converged, residual, best), rate, log_residual), INFINITY)
        left = more.where(undecided, self.load(self.left))
        news = (
            (self.last, largest_change),
            (self.best, best),
            (self.stalled, stalled),
            (self.rate, rate.where(undecided, self.load(self.rate))),
            (self.left, left),
        )
        for variable, value in news:
            b.store(value.value, variable)

        ends = (MOST_IN_LANES,) if form.varying else (MOST_IN_LANES, 2 * MOST_IN_LANES)
        over = [b.icmp_signed("==", tried, ir.Constant(INTEGER, n)) for n in ends]
        all_of_them, none = (ir.Constant(undecided.type, [bit] * form.lanes) for bit in (1, 0))
        gives_up = b.not_((largest_change < INFINITY).value)
        for flag in over:
            gives_up = b.or_(gives_up, b.select(flag, all_of_them, none))
        failing = b.and_(b.and_(undecided, left.compare(">=", INFINITY)), gives_up)
        with b.if_then(self.any(failing), likely=False):
            self.restart(failing)

    def restart(self, failing: Any) -> None:
        """Begin again without values where that has not been tried, or else let the trajectory leave."""
        b, form = self.b, self.form
        if form.varying:  # a shorter step is tried
            for mask in (self.active, self.alive):
                b.store(b.and_(b.load(mask), b.not_(failing)), mask)
            return
        leaves = b.and_(failing, b.load(self.again))
        anew = b.and_(failing, b.not_(b.load(self.again)))
        b.store(b.or_(b.load(self.again), anew), self.again)
        infinite = self.zero.constant(INFINITY)
        for variable in (self.last, self.best, self.left):
            b.store(infinite.where(anew, Value(b, b.load(variable))).value, variable)
        b.store(self.zero.where(anew, Value(b, b.load(self.stalled))).value, self.stalled)
        self.each(
            form.k * form.rows,
            lambda i: self.put(self.zero.where(anew, self.get(self.values, i)), self.values, i),
        )
        b.store(b.and_(b.load(self.active), b.not_(leaves)), self.active)
        b.store(b.and_(b.load(self.alive), b.not_(leaves)), self.alive)

    def finish(self) -> None:
        """Set the state at the end, as a sum of two doubles; the displacement is formed first."""
        from integrators.kernel.step.finish import added, moved_by  # imports numba

        b, form = self.b, self.form
        ends = [(self.state, self.state), (self.error, self.error)]
        if form.varying:
            ahead = [self.array(Group.slots[name]) for name in ("next_state", "next_error")]
            ends = [(ahead[0], self.state), (ahead[1], self.error)]

        def half(d: Index, high: Any, low: Any, nodes: range) -> Value:
            total = self.zero
            for table in (low, high):
                for j in nodes:
                    total = self.number(table, j).fma(self.get(self.values, self.at(j, form.rows, d)), total)
            return total

        def mean(d: Index, high: Any, low: Any) -> tuple[Value, Value]:
            middle = form.k // 2
            return half(d, high, low, range(middle)).two_sum(half(d, high, low, range(middle, form.k)))

        def keep(d: Index, new: Value, low: Value) -> None:
            # The last iterations are not judged: in one component of a lane they may have left no number.
            good = b.and_(b.load(self.alive), (new - new).compare("==", 0.0))
            b.store(good, self.alive)
            for value, base, now in ((new, *ends[0]), (low, *ends[1])):
                self.put(value.where(good, self.get(now, d)), base, d)

        def row(d: Index) -> None:
            state, error = self.get(self.state, d), self.get(self.error, d)
            force = mean(d, self.weights, self.weights_low)
            if not form.second:
                keep(d, *added(state, error, self.h, *force))
                return
            kh = self.h * self.get(self.velocity, d)
            drift = self.drift(d, kh)
            momentum = self.at(1, form.rows, d)
            p, p_error = self.get(self.state, momentum), self.get(self.error, momentum)
            kick = mean(d, self.position_weights, self.position_weights_low)
            keep(d, *moved_by(state, error, *drift, self.h, kh, *kick))
            keep(momentum, *added(p, p_error, self.h, *force))

        self.each_row(row)
