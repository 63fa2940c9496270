"""Emission to targets that calculate with scalars in loops: numba, and heyoka, which has none."""

import numpy as np

from problems.differentiate import LoopTerm
from problems.emit.plan import Let, Plan, Reduce, Scatter, Store
from problems.emit.text import Printer
from problems.sums import Affine, Loop
from problems.tracing import Node

_MATH = {
    "sqrt": "sqrt",
    "sin": "sin",
    "cos": "cos",
    "tan": "tan",
    "exp": "exp",
    "log": "log",
    "abs": "fabs",
    "sign": "copysign(1.0, {})",
}
_PREFIX = {"y": "y", "par": "c", "out": "a"}


class _NumbaWriter:
    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.printer = Printer(plan.uses, _MATH)
        self.tables: list[str] = []
        self._table_names: dict[int, str] = {}

    def write(self) -> None:
        self._statements(self.plan.first)
        for low, high in _ranges(self.plan.zeros):
            if high - low <= 3:
                for place in range(low, high):
                    self.printer.line(f"out[{place}] = -0.0")
            else:
                self.printer.line(f"for i in range({low}, {high}):")
                self.printer.line("    out[i] = -0.0")
        for scatter in self.plan.scatters:
            self._scatter(scatter)
        self._statements(self.plan.last)

    def _statements(self, statements: list[Let | Reduce | Store]) -> None:
        for statement in statements:
            match statement:
                case Let(node):
                    self._let(node)
                case Store(place, node):
                    self.printer.line(f"out[{place}] = {self.printer.text(node)}")
                case Reduce():
                    self._reduce(statement)

    def _let(self, node: Node, variables: list[str] | None = None) -> None:
        if node.op == "symbol":
            space, place = node.data
            if space == "t":
                self.printer.names[node.id] = "t"
            elif isinstance(place, int):
                self.printer.assign(node, f"{space}[{place}]", f"{_PREFIX[space]}{place}")
            else:
                self.printer.assign(node, f"{space}[{_affine(place, variables or [])}]")
        elif node.op == "index":
            self.printer.assign(node, f"float({_affine(node.data, variables or [])})")
        else:
            self.printer.let(node)

    def _loop(self, loop: Loop) -> tuple[list[str], int]:
        """Open the loop; return the names of its integers and its depth."""
        variables = [f"i{k}" for k in range(loop.width)]
        first, steps = _progression(loop)
        n = _all_pairs(loop)
        if steps is not None:
            self.printer.line(f"for k in range({len(loop)}):")
            variables = [_affine(Affine((int(b),), int(a)), ["k"]) for a, b in zip(first, steps, strict=True)]
            return [v if v.isidentifier() or v.isdigit() else f"({v})" for v in variables], 1
        if n:
            self.printer.line(f"for i0 in range({n - 1}):")
            self.printer.line(f"    for i1 in range(i0 + 1, {n}):")
            return variables, 2
        name = self._table_names.get(loop.id)
        if name is None:
            name = self._table_names[loop.id] = f"TABLE_{len(self.tables)}"
            self.tables.append(f"{name} = np.array({loop.rows.tolist()}, dtype=np.int64)")
        self.printer.line(f"for k in range({len(loop)}):")
        for column, variable in enumerate(variables):
            self.printer.line(f"    {variable} = {name}[k, {column}]")
        return variables, 1

    def _scatter(self, scatter: Scatter) -> None:
        variables, depth = self._loop(scatter.loop)
        outer, self.printer.indent = self.printer.indent, self.printer.indent + "    " * depth
        for node in scatter.body:
            self._let(node, variables)
        for entry, unique in zip(scatter.entries, scatter.unique, strict=True):
            self._add(entry, unique, variables)
        self.printer.indent = outer

    def _add(self, entry: LoopTerm, unique: bool, variables: list[str]) -> None:
        place = _affine(entry.index, variables)
        node = entry.node
        if unique:
            self.printer.line(f"out[{place}] = {self.printer.text(node)}")
        elif node.op == "neg" and self.printer.waiting(node):
            text = self.printer.text(node).removeprefix("-")
            self.printer.line(f"out[{place}] = out[{place}] - {text}")
        else:
            self.printer.line(f"out[{place}] = out[{place}] + {self.printer.text(node, 2)}")

    def _reduce(self, statement: Reduce) -> None:
        printer = self.printer
        # By way of an output not yet in use, so that the sum starts as a lane where outputs are lanes.
        spare = self.plan.spare[statement.node.id]
        printer.line(f"out[{spare}] = -0.0")
        printer.assign(statement.node, f"out[{spare}]")
        total = printer.names[statement.node.id]
        variables, depth = self._loop(statement.loop)
        outer, printer.indent = printer.indent, printer.indent + "    " * depth
        for node in statement.body:
            self._let(node, variables)
        printer.line(f"{total} = {total} + {printer.text(statement.node.args[0], 2)}")
        printer.indent = outer


def _affine(affine: Affine, variables: list[str]) -> str:
    parts = []
    for coefficient, variable in zip(affine.coefficients, variables, strict=True):
        if coefficient:
            parts.append(variable if coefficient == 1 else f"{coefficient}*{variable}")
    if affine.offset or not parts:
        parts.append(str(affine.offset))
    return " + ".join(parts).replace("+ -", "- ")


def _progression(loop: Loop) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the first row and the constant step between rows, ``None`` if there is none."""
    first = loop.rows[0]
    steps = np.diff(loop.rows, axis=0)
    if len(steps) == 0:
        return first, np.zeros_like(first)
    return first, steps[0] if (steps == steps[0]).all() else None


def _all_pairs(loop: Loop) -> int:
    """Return n if the rows are all pairs (i, j), i < j < n, in order; else 0."""
    if loop.width != 2:
        return 0
    n = int(loop.rows[-1, 1]) + 1
    if len(loop) != n * (n - 1) // 2:
        return 0
    i, j = np.triu_indices(n, 1)
    return n if np.array_equal(loop.rows[:, 0], i) and np.array_equal(loop.rows[:, 1], j) else 0


def _ranges(places: list[int]) -> list[tuple[int, int]]:
    """Return runs of consecutive places as half-open ranges."""
    runs: list[tuple[int, int]] = []
    for place in places:
        if runs and runs[-1][1] == place:
            runs[-1] = (runs[-1][0], place + 1)
        else:
            runs.append((place, place + 1))
    return runs


def numba_text(plan: Plan, name: str) -> str:
    """Return ``def name(t, y, par, out)`` on scalars, preceded by its index tables if it has any."""
    writer = _NumbaWriter(plan)
    writer.write()
    head = "".join(table + "\n" for table in writer.tables)
    return head + f"def {name}(t, y, par, out):\n" + "\n".join(writer.printer.lines) + "\n"


def heyoka_text(plan: Plan, name: str) -> str:
    """Return ``def name(t, y, par, hy)``, which returns the list of expressions; no loops."""
    functions = {f: f"hy.{f}" for f in _MATH} | {
        "abs": "(hy.relu({0}) + hy.relu(-({0})))",
        "sign": "(hy.relup({0}) - hy.relup(-({0})))",
    }
    printer = Printer(plan.uses, functions)
    printer.line(f"out = [None]*{plan.n_out}")
    for statement in plan.first:
        match statement:
            case Let(node) if node.op == "symbol":
                space, place = node.data
                printer.names[node.id] = "t" if space == "t" else f"{space}[{place}]"
            case Let(node):
                printer.let(node)
            case Store(place, node):
                printer.line(f"out[{place}] = {printer.text(node)}")
    printer.line("return out")
    return f"def {name}(t, y, par, hy):\n" + "\n".join(printer.lines) + "\n"
