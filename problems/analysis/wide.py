"""A function at one state with 36 digits and exponents without bounds: where doubles under- or overflow.

`problems.analysis.invariants` calculates with pairs of doubles, whose products vanish below 1e-308 and are
lost above 1e308, although the states that they come from are ordinary doubles: an oscillator of amplitude
1e-170 has an energy of 1e-340. This is slow and is asked only there.
"""

import math
import operator
from collections.abc import Callable, Mapping
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from problems.calculus.function import Function
from problems.trace.functions import FUNCTIONS
from problems.trace.graph import Loop, Node, reachable

_DIGITS = 36
_WIDE = mpmath.MPContext()  # of its own: the precision of mpmath.mp belongs to the user
_WIDE.dps = _DIGITS
_OPERATIONS: dict[str, Callable[..., Any]] = {
    **{name: getattr(_WIDE, name) for name in FUNCTIONS if name not in ("abs", "sign", "round")},
    "abs": abs,
    "sign": lambda x: _WIDE.mpf(-1 if x < 0 else 1),
    "round": _WIDE.nint,
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": operator.truediv,
    "neg": operator.neg,
    "where": lambda condition, a, b: a if condition > 0 else b,
}


def evaluate(function: Function, t: float, y: NDArray[np.float64], par: NDArray[np.float64]) -> list[Any]:
    """Return the outputs at one state, numbers of mpmath; nan where one is not defined."""
    return _State({"t": [t], "y": y.tolist(), "par": par.tolist()}).outputs(function)


class _State:
    def __init__(self, inputs: Mapping[str, list[float]]) -> None:
        self.inputs = {space: [_WIDE.mpf(value) for value in values] for space, values in inputs.items()}

    def outputs(self, function: Function) -> list[Any]:
        known: dict[int, Any] = {}
        for node in reachable(function.roots):
            if node.loop is None:
                known[node.id] = self._value(node, known, 0)
        totals = [_WIDE.mpf(0) for _ in function.outputs]
        for loop, entries in function.loops:
            places = [entry.index.values(loop) for entry in entries]
            for k, values in enumerate(self._terms([entry.node for entry in entries], loop, known)):
                for place, value in zip(places, values, strict=True):
                    totals[int(place[k])] += value
        return [
            sum((known[term.node.id] for term in terms), start=total)
            for total, terms in zip(totals, function.outputs, strict=True)
        ]

    def _terms(self, roots: list[Node], loop: Loop, known: dict[int, Any]) -> list[list[Any]]:
        body = reachable(roots, loop)
        rows: list[list[Any]] = []
        inside = dict(known)
        for k in range(len(loop)):
            for node in body:
                inside[node.id] = self._value(node, inside, k)
            rows.append([inside[root.id] for root in roots])
        return rows

    def _value(self, node: Node, known: dict[int, Any], k: int) -> Any:
        match node.op:
            case "const":
                return _WIDE.mpf(node.data)
            case "symbol":
                space, place = node.data
                return self.inputs[space][
                    place if isinstance(place, int) else int(place.values(node.loop)[k])
                ]
            case "index":
                return _WIDE.mpf(int(node.data.values(node.loop)[k]))
            case "sum":
                return sum(
                    (value for (value,) in self._terms([node.args[0]], node.data, known)), _WIDE.mpf(0)
                )
        args = [known[arg.id] for arg in node.args]
        try:
            if node.op == "pow":
                value = args[0] ** node.data
            elif node.op == "table":
                value = _table(node.data, args[0])
            else:
                value = _OPERATIONS[node.op](*args)
        except (ArithmeticError, ValueError):  # a pole, or outside of a function's domain
            return _WIDE.nan
        return value if isinstance(value, _WIDE.mpf) else _WIDE.nan  # a root of a negative number is complex


def _table(table: Any, x: Any) -> Any:
    place = int(np.clip(np.searchsorted(table.knots, float(x), side="right") - 1, 0, len(table.rows) - 1))
    return _WIDE.polyval(list(table.rows[place]), x - table.knots[place])


def relative(now: list[Any], before: list[Any]) -> float:
    """Return the distance of two vectors in the 2-norm, relative to the second if that is not 0."""
    size = _WIDE.norm(before)
    gap = _WIDE.norm([a - b for a, b in zip(now, before, strict=True)])
    try:
        return float(gap / size if size != 0 else gap)
    except OverflowError:
        return math.inf
