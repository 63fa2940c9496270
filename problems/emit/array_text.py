"""Emission to targets that calculate with whole arrays: numpy and JAX."""

import numpy as np

from problems.emit.plan import Let, Plan, Reduce, Scatter, Store
from problems.emit.printer import Printer
from problems.trace.graph import FUNCTIONS, Affine, Loop, Node

_PREFIX = {"y": "y", "par": "c", "out": "a"}


class _ArrayWriter:
    """Loops become gather, evaluate, scatter on arrays with one row per term."""

    def __init__(self, plan: Plan, library: str) -> None:
        self.plan = plan
        self.library = library
        named = {name: f"{library}.{name}" for name in FUNCTIONS}
        named |= {"abs": f"{library}.abs", "sign": library + ".copysign(1.0, {})"}
        self.printer = Printer(plan.uses, named)
        self.tables: list[str] = []

    def _table(self, values: np.ndarray) -> str:
        text = f"np.array({values.tolist()})"
        for known in self.tables:
            if known.split(" = ", 1)[1] == text:
                return known.split(" = ", 1)[0]
        name = f"TABLE_{len(self.tables)}"
        self.tables.append(f"{name} = {text}")
        return name

    def _places(self, affine: Affine, loop: Loop) -> str:
        """Return the text that selects an index of all terms: a slice where it is one."""
        values = affine.values(loop)
        steps = np.diff(values)
        if len(values) > 1 and steps[0] > 0 and (steps == steps[0]).all():
            step = "" if steps[0] == 1 else f":{steps[0]}"
            return f"{values[0]}:{values[-1] + 1}{step}"
        return self._table(values)

    def _let(self, node: Node, loop: Loop | None = None) -> None:
        if node.op == "symbol":
            space, place = node.data
            if space == "t":
                self.printer.names[node.id] = "t"
            elif isinstance(place, int):
                self.printer.assign(node, f"{space}[{place}]", f"{_PREFIX[space]}{place}")
            else:
                assert loop is not None
                self.printer.assign(node, f"{space}[{self._places(place, loop)}]")
        elif node.op == "index":
            assert loop is not None
            table = self._table(node.data.values(loop).astype(np.float64))
            self.printer.assign(node, f"{table}.reshape((-1,) + (1,)*(y.ndim - 1))")
        else:
            self.printer.let(node)

    def _statements(self, statements: list[Let | Reduce | Store]) -> None:
        for statement in statements:
            match statement:
                case Let(node):
                    self._let(node)
                case Store(place, node):
                    self.store(place, self.printer.text(node))
                case Reduce():
                    for node in statement.body:
                        self._let(node, statement.loop)
                    value = self.printer.text(statement.node.args[0])
                    self.printer.assign(statement.node, self.reduced(value, len(statement.loop)))

    def write(self) -> None:
        if self.plan.scatters:
            self.start()
        self._statements(self.plan.first)
        for scatter in self.plan.scatters:
            self._scatter(scatter)
        self._statements(self.plan.last)

    def _scatter(self, scatter: Scatter) -> None:
        for node in scatter.body:
            self._let(node, scatter.loop)
        shared = []
        for entry, unique in zip(scatter.entries, scatter.unique, strict=True):
            if unique:
                self.put(self._places(entry.index, scatter.loop), self.printer.text(entry.node))
            else:
                shared.append(entry)
        if shared:
            # Row by row, so that each output receives its summands in the order of the loop.
            places = np.stack([entry.index.values(scatter.loop) for entry in shared], axis=1).ravel()
            values = [self.printer.text(entry.node) for entry in shared]
            self.accumulate(self._table(places), values, len(scatter.loop))

    # What differs between the two libraries.
    def store(self, place: int, value: str) -> None:
        raise NotImplementedError

    def start(self) -> None:
        raise NotImplementedError

    def put(self, places: str, value: str) -> None:
        raise NotImplementedError

    def accumulate(self, places: str, values: list[str], n: int) -> None:
        raise NotImplementedError

    def reduced(self, value: str, n: int) -> str:
        raise NotImplementedError


class _NumpyWriter(_ArrayWriter):
    def store(self, place: int, value: str) -> None:
        self.printer.line(f"out[{place}] = {value}")

    def start(self) -> None:
        self.printer.line("out[...] = -0.0")

    def put(self, places: str, value: str) -> None:
        self.printer.line(f"out[{places}] = {value}")

    def accumulate(self, places: str, values: list[str], n: int) -> None:
        shape = f"({n},) + y.shape[1:]"
        rows = ", ".join(f"np.broadcast_to({value}, {shape})" for value in values)
        # np.add.at adds one row after the other, as a loop would.
        self.printer.line(f"rows = np.stack(({rows},), axis=1).reshape((-1,) + y.shape[1:])")
        self.printer.line(f"np.add.at(out, {places}, rows)")

    def reduced(self, value: str, n: int) -> str:
        # cumsum adds one after the other; np.sum would add pairwise.
        return f"np.cumsum(np.broadcast_to({value}, ({n},) + y.shape[1:]), axis=0)[-1]"


class _JaxWriter(_ArrayWriter):
    def __init__(self, plan: Plan) -> None:
        super().__init__(plan, "jnp")
        self.outputs: dict[int, str] = {}

    def store(self, place: int, value: str) -> None:
        if self.plan.scatters:
            self.printer.line(f"out = out.at[{place}].set({value})")
        else:
            self.outputs[place] = value

    def start(self) -> None:
        self.printer.line(f"out = jnp.full({self.plan.n_out}, -0.0)")

    def put(self, places: str, value: str) -> None:
        self.printer.line(f"out = out.at[{places}].set({value})")

    def accumulate(self, places: str, values: list[str], n: int) -> None:
        rows = ", ".join(f"jnp.broadcast_to({value}, ({n},))" for value in values)
        self.printer.line(f"out = out.at[{places}].add(jnp.stack(({rows},), axis=1).ravel())")

    def reduced(self, value: str, n: int) -> str:
        return f"jnp.sum(jnp.broadcast_to({value}, ({n},)))"


def numpy_text(plan: Plan, name: str) -> str:
    """Return ``def name(t, y, par, out)`` on numpy arrays; y is (dim,) or (dim, n)."""
    writer = _NumpyWriter(plan, "np")
    writer.write()
    head = "".join(table + "\n" for table in writer.tables)
    return head + f"def {name}(t, y, par, out):\n" + "\n".join(writer.printer.lines) + "\n"


def jax_text(plan: Plan, name: str) -> str:
    """Return ``def name(t, y, par)`` on JAX arrays; y is (dim,)."""
    writer = _JaxWriter(plan)
    writer.write()
    if not plan.scatters:
        values = ", ".join(writer.outputs[place] for place in range(plan.n_out))
        writer.printer.line(f"return jnp.stack(jnp.broadcast_arrays({values}))")
    else:
        writer.printer.line("return out")
    head = "".join(table + "\n" for table in writer.tables)
    return head + f"def {name}(t, y, par):\n" + "\n".join(writer.printer.lines) + "\n"
