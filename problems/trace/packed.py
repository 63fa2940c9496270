"""Graphs as numbers, texts and lists, which JSON and pickle can keep.

What comes from outside is checked first, by `problems.trace.stored`.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from problems.trace.graph import Affine, Graph, Loop, Table

_SPACES = ("t", "y", "par")


def packed(graph: Graph, n_par: int) -> dict[str, Any]:
    """Return a graph as lists.

    Operations on symbols that stand for something else while functions are derived or emitted, and on
    parameters beyond the ``n_par`` of the system (`problems.emit.time_scale`), are left out, as ``None``: no
    function of the system depends on them, and they are made again when they are needed.
    """
    passing: set[int] = set()
    nodes: list[list[Any] | None] = []
    for node in graph.nodes:
        space, place = node.data if node.op == "symbol" else ("", None)
        beyond = space == "par" and isinstance(place, int) and place >= n_par
        stand_in = node.op == "symbol" and (space not in _SPACES or beyond)
        if stand_in or any(arg.id in passing for arg in node.args):
            passing.add(node.id)
            nodes.append(None)
        else:
            inside = [] if node.loop is None else [node.loop.id]
            nodes.append([node.op, [arg.id for arg in node.args], _plain(node.data), node.flags, *inside])
    return {"dof": graph.dof, "loops": [loop.rows.tolist() for loop in graph.loops], "nodes": nodes}


def unpacked(state: Mapping[str, Any]) -> Graph:
    """Return the graph that `packed` was given: the same nodes, with the same numbers."""
    graph = Graph(state["dof"])
    loops = [graph.loop(np.array(rows, dtype=np.int64)) for rows in state["loops"]]
    for plain in state["nodes"]:
        if plain is None:
            graph.skip()
            continue
        op, args, data, flags, *inside = plain
        data = _OF_PLAIN[op](data, loops) if op in _OF_PLAIN else None
        loop = loops[inside[0]] if inside else None
        graph.keep(op, tuple(graph.nodes[i] for i in args), data, int(flags), loop)
    return graph


def _affine(plain: Sequence[Any]) -> Affine:
    return Affine(tuple(int(c) for c in plain[0]), int(plain[1]))


_OF_PLAIN: dict[str, Callable[[Any, list[Loop]], Any]] = {
    "const": lambda data, _: float(data),
    "symbol": lambda data, _: (data[0], data[1] if isinstance(data[1], int) else _affine(data[1])),
    "index": lambda data, _: _affine(data),
    "pow": lambda data, _: int(data),
    "sum": lambda data, loops: loops[data],
    "table": lambda data, _: Table(tuple(map(float, data[0])), tuple(tuple(map(float, r)) for r in data[1])),
}
"""What `Node.data` is, from what `_plain` returns."""


def _plain(data: Any) -> Any:
    match data:
        case Loop():
            return data.id
        case Table():
            return [list(data.knots), [list(row) for row in data.rows]]
        case Affine():
            return [list(data.coefficients), data.offset]
        case (space, place):
            return [space, _plain(place)]
    return data
