"""Emission to targets that calculate with whole arrays: numpy and JAX."""

from collections.abc import Sequence

import numpy as np

from problems.graph.functions import CALLED
from problems.graph.nodes import Affine, Loop, Node
from problems.targets.plan import Fill, Plan, Scatter
from problems.targets.printer import Places, Printer


class _ArrayPrinter(Printer):
    """Loops become gather, evaluate, scatter on arrays with one row per term."""

    def __init__(self, plan: Plan, library: str, functions: dict[str, str]) -> None:
        super().__init__(plan, functions)
        self._library = library

    def _table(self, values: np.ndarray) -> str:
        return self.table(f"np.array({values.tolist()})")

    def _places(self, affine: Affine, loop: Loop) -> str:
        """Return the text that selects an index of all terms: a slice where it is one."""
        values = affine.values(loop)
        steps = np.diff(values)
        if len(values) > 1 and steps[0] > 0 and (steps == steps[0]).all():
            step = "" if steps[0] == 1 else f":{steps[0]}"
            return f"{values[0]}:{values[-1] + 1}{step}"
        return self._table(values)

    def _inside(self, node: Node, loop: Loop) -> None:
        """Print a value inside a loop."""
        self.let(node, lambda affine: self._places(affine, loop))

    def visit_index(self, node: Node, index: Places) -> None:
        assert node.loop is not None
        table = self._table(node.data.values(node.loop).astype(np.float64))
        self.assign(node, f"{table}.reshape((-1,) + (1,)*(y.ndim - 1))")

    def reduce(self, node: Node, loop: Loop, body: Sequence[Node]) -> None:
        for inner in body:
            self._inside(inner, loop)
        self.assign(node, self.reduced(self.text(node.args[0]), len(loop)))

    def write(self) -> None:
        if self.plan.scatters:
            self.start("out", self.plan.n_out)
        self.statements(self.plan.first)
        for scatter in self.plan.scatters:
            self._scatter("out", scatter)
        self.statements(self.plan.last)

    def fill(self, fill: Fill) -> None:
        self.start(fill.name, fill.size)
        for scatter in fill.scatters:
            self._scatter(fill.name, scatter)
        for place, node, added in fill.terms:
            value = self.text(node, 2 if added else 1)
            self.put(fill.name, str(place), f"{fill.name}[{place}] + {value}" if added else value)

    def _scatter(self, array: str, scatter: Scatter) -> None:
        for node in scatter.body:
            self._inside(node, scatter.loop)
        shared = []
        for entry, unique in zip(scatter.entries, scatter.unique, strict=True):
            if unique:
                self.put(array, self._places(entry.index, scatter.loop), self.text(entry.node))
            else:
                shared.append(entry)
        if shared:
            # Row by row, so that each output receives its summands in the order of the loop.
            places = np.stack([entry.index.values(scatter.loop) for entry in shared], axis=1).ravel()
            values = [self.text(entry.node) for entry in shared]
            self.accumulate(array, self._table(places), values, len(scatter.loop))

    def entry(self, name: str, place: str) -> str:
        return f"{name}[{place}].reshape((-1,) + (1,)*(y.ndim - 1))"

    # What differs between the two libraries.
    def start(self, array: str, size: int) -> None:
        raise NotImplementedError

    def put(self, array: str, places: str, value: str) -> None:
        raise NotImplementedError

    def accumulate(self, array: str, places: str, values: list[str], n: int) -> None:
        raise NotImplementedError

    def reduced(self, value: str, n: int) -> str:
        raise NotImplementedError


class _NumpyPrinter(_ArrayPrinter):
    def store(self, place: int, value: str) -> None:
        self.line(f"out[{place}] = {value}")

    def start(self, array: str, size: int) -> None:
        room = "" if array == "out" else f"np.empty(({size},) + y.shape[1:], y.dtype)"
        if room:
            self.line(f"{array} = {room}")
        self.line(f"{array}[...] = -0.0")

    def put(self, array: str, places: str, value: str) -> None:
        self.line(f"{array}[{places}] = {value}")

    def accumulate(self, array: str, places: str, values: list[str], n: int) -> None:
        shape = f"({n},) + y.shape[1:]"
        rows = ", ".join(f"np.broadcast_to({value}, {shape})" for value in values)
        # np.add.at adds one row after the other, as a loop would.
        self.line(f"rows = np.stack(({rows},), axis=1).reshape((-1,) + y.shape[1:])")
        self.line(f"np.add.at({array}, {places}, rows)")

    def reduced(self, value: str, n: int) -> str:
        # cumsum adds one after the other; np.sum would add pairwise.
        return f"np.cumsum(np.broadcast_to({value}, ({n},) + y.shape[1:]), axis=0)[-1]"


class _JaxPrinter(_ArrayPrinter):
    def __init__(self, plan: Plan) -> None:
        super().__init__(plan, "jnp", {name: f.jax for name, f in CALLED.items()})
        self.outputs: dict[int, str] = {}

    def store(self, place: int, value: str) -> None:
        if self.plan.scatters:
            self.line(f"out = out.at[{place}].set({value})")
        else:
            self.outputs[place] = value

    def start(self, array: str, size: int) -> None:
        self.line(f"{array} = jnp.full({size}, -0.0)")

    def put(self, array: str, places: str, value: str) -> None:
        self.line(f"{array} = {array}.at[{places}].set({value})")

    def accumulate(self, array: str, places: str, values: list[str], n: int) -> None:
        rows = ", ".join(f"jnp.broadcast_to({value}, ({n},))" for value in values)
        self.line(f"{array} = {array}.at[{places}].add(jnp.stack(({rows},), axis=1).ravel())")

    def reduced(self, value: str, n: int) -> str:
        return f"jnp.sum(jnp.broadcast_to({value}, ({n},)))"


def numpy_text(plan: Plan, name: str) -> str:
    """Return ``def name(t, y, par, out)`` on numpy arrays; y is (dim,) or (dim, n)."""
    printer = _NumpyPrinter(plan, "np", {name: f.numpy for name, f in CALLED.items()})
    printer.write()
    return printer.finished(f"{name}(t, y, par, out)")


def jax_text(plan: Plan, name: str) -> str:
    """Return ``def name(t, y, par)`` on JAX arrays; y is (dim,)."""
    printer = _JaxPrinter(plan)
    printer.write()
    if plan.scatters:
        printer.line("return out")
    else:
        values = ", ".join(printer.outputs[place] for place in range(plan.n_out))
        printer.line(f"return jnp.stack(jnp.broadcast_arrays({values}))")
    return printer.finished(f"{name}(t, y, par)")
