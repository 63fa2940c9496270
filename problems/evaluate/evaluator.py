"""A graph evaluated over arrays of states, with numbers of any kind.

Constants, parameters and states are the doubles that the integrators see; every operation carries the digits
of the numbers.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from problems.derive.function import Function
from problems.graph.fold import Fold
from problems.graph.loops import Affine, Loop, Stage
from problems.graph.nodes import Node, reachable

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Numbers:
    """Arrays of numbers of one kind, which have operators and can be indexed like NumPy's.

    Attributes
    ----------
    of : callable
        Makes such numbers of doubles.
    operations : mapping of str to callable
        The value of each operation at such numbers.
    rows : callable
        ``rows(values, n, columns)``: the values, broadcast to the shape (n, columns).
    total : callable
        The sum of an array along its first axis.
    stacked : callable
        An array of arrays, one row for each.
    """

    of: Callable[[Any], Any]
    operations: Mapping[str, Callable[..., Any]]
    rows: Callable[[Any, int, int], Any]
    total: Callable[[Any], Any]
    stacked: Callable[[list[Any]], Any]

    def value(self, node: Node, *args: Any) -> Any:
        """Return the value of an operation at numbers."""
        if node.op == "pow":
            return self.operations["pow"](args[0], node.data)
        return node.data.at(args[0]) if node.op == "table" else self.operations[node.op](*args)


class Evaluator(Fold[Any]):
    """The values of nodes at states: in a loop one row per term, one column per state.

    Parameters
    ----------
    numbers : Numbers
        The kind.
    t, y, par
        Times (1, n), states (dim, n) and parameters (n_par, 1) or (n_par, n), of that kind.
    n : int
        Number of states.
    """

    def __init__(self, numbers: Numbers, t: Any, y: Any, par: Any, n: int) -> None:
        super().__init__()
        self._numbers, self._n = numbers, n
        self._stages: dict[Stage, Any] = {}
        self._inputs = {"t": t, "y": y, "par": par}

    def outputs(self, function: Function) -> list[Any]:
        """Return the outputs of a function, shape (n,) each."""
        # Overflow and 0/0 at a state that is not finite give nan there, which is the answer.
        with np.errstate(all="ignore"):
            for node in reachable(function.roots):
                if node.loop is None:
                    self.known[node.id] = self.visit(node, [self.known[arg.id] for arg in node.reads])
            loops = ((loop, [(entry.index, entry.node) for entry in each]) for loop, each in function.loops)
            terms = ((place, term.node) for place, each in enumerate(function.outputs) for term in each)
            return self._filled(len(function.outputs), loops, terms)

    def _filled(
        self,
        size: int,
        loops: Iterable[tuple[Loop, Sequence[tuple[Affine, Node]]]],
        terms: Iterable[tuple[int, Node]],
    ) -> list[Any]:
        """Return so many sums, shape (n,) each: of what loops add to them, then of single terms."""
        summands: list[list[Any]] = [[] for _ in range(size)]
        for loop, entries in loops:
            values = self._inside([node for _, node in entries], loop)
            for (index, _), rows in zip(entries, values, strict=True):
                for row, place in enumerate(index.values(loop)):
                    summands[place].append(rows[row])
        for place, node in terms:
            summands[place].append(self.known[node.id])
        return [self._added(parts) for parts in summands]

    def _added(self, parts: list[Any]) -> Any:
        return self._numbers.rows(sum(parts, start=self._numbers.of(0.0)), 1, self._n)[0]

    def _inside(self, roots: list[Node], loop: Loop) -> list[Any]:
        """Return the values of nodes of a loop, shape (terms, n) each; of others the same in each term."""
        return [self._numbers.rows(values, len(loop), self._n) for values in self.of_term(roots, loop)]

    def visit_const(self, node: Node) -> Any:
        return self._numbers.of(node.data)

    def visit_symbol(self, node: Node) -> Any:
        space, place = node.data
        return self._inputs[space][place if isinstance(place, int) else place.values(node.loop)]

    def visit_index(self, node: Node) -> Any:
        return self._numbers.of(node.data.values(node.loop).astype(np.float64)[:, np.newaxis])

    def visit_entry(self, node: Node) -> Any:
        constants, place = node.data
        return self._numbers.of(constants.values[place.values(node.loop)][:, np.newaxis])

    def visit_element(self, node: Node, *_: Any) -> Any:
        stage, place = node.data
        if stage not in self._stages:
            self._stages[stage] = self._numbers.stacked(self._filled(stage.size, stage.loops, stage.terms))
        return self._stages[stage][place if isinstance(place, int) else place.values(node.loop)]

    def visit_sum(self, node: Node, *_: Any) -> Any:
        return self._numbers.total(self._inside([node.args[0]], node.data)[0])

    def visit_operation(self, node: Node, *args: Any) -> Any:
        return self._numbers.value(node, *args)
