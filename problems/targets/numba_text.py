"""Emission to numba: scalars (or lanes) in straight code and in plain loops."""

from collections.abc import Sequence

import numpy as np

from problems.graph.functions import CALLED
from problems.graph.nodes import READS, Loop, Node
from problems.targets.loops import Nest, Range, Table, nest, ranges
from problems.targets.plan import Fill, Plan, Reduce, Scatter
from problems.targets.printer import Places, Printer, variable

MOST_ALONE = 200  # statements outside of loops, which are repeated for every part

_FUNCTIONS = {name: f.numba for name, f in CALLED.items()}


class _NumbaPrinter(Printer):
    target = "out"  # the array that loops fill

    def write(self) -> None:
        self.statements(self.plan.first)
        self._loops(self.plan.zeros, self.plan.scatters)
        self.statements(self.plan.last)
        for statement in self.plan.first + self.plan.last:
            if isinstance(statement, Fill):
                self.line(f"release({statement.name}, {statement.size})")

    def _loops(self, zeros: list[int], scatters: Sequence[Scatter]) -> None:
        """Print the loops that fill an array."""
        for places in _runs(zeros):
            # -0.0 is what leaves the first summand as it is, its sign included.
            if len(places) <= 3:
                for place in places:
                    self.line(f"{self.target}[{place}] = -0.0")
            else:
                self.line(f"for k in {places}:")
                self.line(f"    {self.target}[k] = -0.0")
        for scatter in scatters:
            self._loop(scatter.loop, scatter.body, scatter)

    def fill(self, fill: Fill) -> None:
        self.line(f"{fill.name} = room(out, {fill.size})")
        self.target = fill.name
        self._loops(fill.zeros, fill.scatters)
        for place, node, added in fill.terms:
            value = self.text(node, 2 if added else 1)
            self.line(f"{fill.name}[{place}] = " + (f"{fill.name}[{place}] + " if added else "") + value)
        self.target = "out"

    def store(self, place: int, value: str) -> None:
        self.line(f"out[{place}] = {value}")

    def reduce(self, node: Node, loop: Loop, body: Sequence[Node]) -> None:
        # By way of an output not yet in use: the sum is a lane where outputs are lanes.
        spare = self.plan.spare[node.id]
        self.line(f"out[{spare}] = -0.0")
        self.assign(node, f"out[{spare}]")
        self._loop(loop, body, node)

    def visit_index(self, node: Node, index: Places) -> None:
        assert index is not None
        self.assign(node, f"float({index(node.data)})")

    def _loop(self, loop: Loop, body: Sequence[Node], target: Scatter | Node) -> None:
        """Print a loop that adds to the outputs of a scatter, or to a declared sum."""
        nested = nest(loop)
        if nested is not None:
            self._nested(nested, body, target)
            return
        pieces = ranges(loop)
        if pieces is None:
            name = self.table(f"np.array({loop.rows.tolist()}, dtype=np.int64)")
            self._simple(Table(name, len(loop), loop.width), body, target)
        else:
            for piece in pieces:
                self._simple(piece, body, target)

    def _simple(self, header: Range | Table, body: Sequence[Node], target: Scatter | Node) -> None:
        outside = self.indent
        carried: dict[int, int] = {}
        if isinstance(header, Range) and isinstance(target, Scatter) and header.n > 1:
            carried = _carried(header, target)
            for i in carried:
                self.line(
                    f"{variable('summed', i)} = {self.target}[{header.along(target.entries[i].index).offset}]"
                )
        opening = header.opening()
        for line in opening:
            self.line(line)
        self.indent = outside + "    " * bool(opening)
        for node in body:
            self.let(node, header.index)
        before = {first: variable("summed", first) for first in carried}
        self._add_to(
            target, header, before, {second: variable("summed", first) for first, second in carried.items()}
        )
        self.indent = outside
        if isinstance(header, Range) and isinstance(target, Scatter):
            for first, second in carried.items():
                along = header.along(target.entries[second].index)
                last = along.offset + along.coefficients[0] * (header.n - 1)
                self.line(f"{self.target}[{last}] = {variable('summed', first)}")

    def _nested(self, header: Nest, body: Sequence[Node], target: Scatter | Node) -> None:
        """Print two nested loops; what depends on i alone stays out of the inner one, sums too."""
        outside = self.indent
        outer = _outer(body)
        held = _held(target) if isinstance(target, Scatter) else []
        self.line(f"for i in {header.outer}:")
        self.indent = outside + "    "
        for node in body:
            if node.id in outer:
                self.let(node, header.index)
                if self.waiting(node):  # for the inner loop
                    self.assign(node, self.text(node))
        entries = target.entries if isinstance(target, Scatter) else ()
        for i in held:
            self.line(f"{variable('summed', i)} = {self.target}[{header.index(entries[i].index)}]")
        self.line(f"for j in {header.inner}:")
        self.indent = outside + "        "
        for node in body:
            if node.id not in outer:
                self.let(node, header.index)
        variables = {i: variable("summed", i) for i in held}
        self._add_to(target, header, variables, variables)
        self.indent = outside + "    "
        for i in held:
            self.line(f"{self.target}[{header.index(entries[i].index)}] = {variable('summed', i)}")
        self.indent = outside

    def _add_to(
        self,
        target: Scatter | Node,
        header: Range | Nest | Table,
        before: dict[int, str],
        after: dict[int, str],
    ) -> None:
        """Print the additions of one term of a loop.

        ``before`` and ``after`` name the variables that hold the outputs of some entries, by
        number, before and after the addition; the others are in memory.
        """
        if isinstance(target, Node):
            total = self.names[target.id]
            self.line(f"{total} = {total} + {self.text(target.args[0], 2)}")
            return
        # What uses a variable that goes from one term to the next comes before what renews it.
        for i in sorted(range(len(target.entries)), key=lambda i: i not in before or i in after):
            node = target.entries[i].node
            place = f"{self.target}[{header.index(target.entries[i].index)}]"
            now, to = before.get(i, place), after.get(i, place)
            if target.unique[i] and now == to == place:
                self.line(f"{place} = {self.text(node)}")
            elif node.op == "neg" and self.waiting(node):
                self.line(f"{to} = {now} - {self.text(node).removeprefix('-')}")
            else:
                self.line(f"{to} = {now} + {self.text(node, 2)}")


def _outer(body: Sequence[Node]) -> set[int]:
    """Return the nodes that depend on the first of two loop integers alone."""
    outer: set[int] = set()
    inside = {node.id for node in body}
    for node in body:
        if node.op in READS:
            alone = node.place.coefficients[1] == 0
        else:
            alone = all(arg.id in outer for arg in node.args if arg.id in inside)
        if alone:
            outer.add(node.id)
    return outer


def _held(scatter: Scatter) -> list[int]:
    """Return the entries whose output is the same throughout the inner loop and touched by no other."""
    places = [entry.index.values(scatter.loop) for entry in scatter.entries]
    return [
        i
        for i, entry in enumerate(scatter.entries)
        if entry.index.coefficients[1] == 0
        and not any((places[i] == other).any() for j, other in enumerate(places) if j != i)
    ]


def _carried(header: Range, scatter: Scatter) -> dict[int, int]:
    """Return pairs of entries of which the second adds to the output that the first adds to next.

    In a chain of neighbours the output of k + 1 is then kept in a variable from
    one term to the next, instead of going through memory.
    """
    along = [header.along(entry.index) for entry in scatter.entries]
    k = np.arange(header.n)
    places = [a.offset + a.coefficients[0] * k for a in along]
    pairs: dict[int, int] = {}
    for first, a in enumerate(along):
        for second, b in enumerate(along):
            step = a.coefficients[0]
            if step == 0 or b.coefficients[0] != step or b.offset != a.offset + step:
                continue
            mine = np.union1d(places[first], places[second])
            others = [p for i, p in enumerate(places) if i not in (first, second)]
            if not any(np.isin(mine, other).any() for other in others):
                pairs[first] = second
    return pairs


def _runs(places: list[int]) -> list[range]:
    """Return increasing places as ranges."""
    runs: list[range] = []
    for place in places:
        last = runs[-1] if runs else range(0)
        step = place - last[-1] if last else 0
        if len(last) == 1 or (last and step == last.step):
            runs[-1] = range(last.start, place + 1, step)
        else:
            runs.append(range(place, place + 1))
    return runs


class _PartPrinter(_NumbaPrinter):
    """Prints what sets the outputs from ``first`` to ``last`` only: the same sums in the same order."""

    def store(self, place: int, value: str) -> None:
        self.line(f"if first <= {place} < last:")
        self.line(f"    out[{place}] = {value}")

    def _loops(self, zeros: list[int], scatters: Sequence[Scatter]) -> None:
        for places in _runs(zeros):
            self.line(f"for k in range(max({places.start}, first), min({places.stop}, last)):")
            self.line("    out[k] = -0.0")
        for scatter in scatters:
            for piece in ranges(scatter.loop) or ():
                self._part(piece, scatter)

    def _part(self, piece: Range, scatter: Scatter) -> None:
        """Print the terms of a range that add to these outputs, those that add to others too apart."""
        if piece.n == 1:
            self._guarded(piece, scatter)
            return
        shifts = [piece.along(entry.index).offset for entry in scatter.entries]
        low, high = min(shifts), max(shifts)
        self.line(f"begin = min(max(0, first - {high}), {piece.n})")
        self.line(f"end = max(begin, min({piece.n}, last - {low}))")
        self.line(f"inner = min(max(begin, first - {low}), end)")
        self.line(f"outer = max(inner, min(end, last - {high}))")
        outside = self.indent
        for start, stop in (("begin", "inner"), ("inner", "outer"), ("outer", "end")):
            self.line(f"for k in range({start}, {stop}):")
            self.indent = outside + "    "
            if start == "inner":
                for node in scatter.body:
                    self.let(node, piece.index)
                self._add_to(scatter, piece, {}, {})
            else:
                self._guarded(piece, scatter)
            self.indent = outside

    def _guarded(self, piece: Range, scatter: Scatter) -> None:
        """Print one term; of the outputs it adds to those in the part."""
        for node in scatter.body:
            self.let(node, piece.index)
        outside = self.indent
        for i, entry in enumerate(scatter.entries):
            self.line(f"if first <= {piece.index(entry.index)} < last:")
            self.indent = outside + "    "
            self._add_to(Scatter(scatter.loop, (), (entry,), (scatter.unique[i],)), piece, {}, {})
            self.indent = outside


def numba_text_of_part(plan: Plan, name: str) -> str | None:
    """Return ``def name(t, y, par, out, first, last)``, which sets some of the outputs.

    ``None`` where a part costs as much as all, or where loops are not over one output after another.
    """
    alone = plan.first + plan.last
    if not plan.scatters or len(alone) > MOST_ALONE or any(isinstance(one, Fill | Reduce) for one in alone):
        return None
    for scatter in plan.scatters:
        pieces = None if nest(scatter.loop) is not None else ranges(scatter.loop)
        if pieces is None:
            return None
        for piece in pieces:
            if piece.n > 1 and any(piece.along(e.index).coefficients != (1,) for e in scatter.entries):
                return None
    printer = _PartPrinter(plan, _FUNCTIONS)
    printer.write()
    return printer.finished(f"{name}(t, y, par, out, first, last)")


def numba_text(plan: Plan, name: str) -> str:
    """Return ``def name(t, y, par, out)`` on scalars, preceded by its index tables if it has any."""
    printer = _NumbaPrinter(plan, _FUNCTIONS)
    printer.write()
    return printer.finished(f"{name}(t, y, par, out)")
