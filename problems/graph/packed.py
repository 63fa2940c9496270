"""Graphs as numbers, texts and lists, which JSON and pickle can keep.

What comes from outside is checked first, by `problems.graph.stored`.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from problems.graph.loops import Affine, Constants, Loop, Place, Stage
from problems.graph.nodes import Graph
from problems.graph.tables import Table

_SPACES = ("t", "y", "par")


def packed(graph: Graph, n_par: int) -> dict[str, Any]:
    """Return a graph as lists.

    Operations on symbols that stand for something else while functions are derived or emitted, and on
    parameters beyond the ``n_par`` of the system (`targets.time_scale`), are left out, as ``None``: no
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
        data = _OF_PLAIN[op](data, graph) if op in _OF_PLAIN else None
        loop = loops[inside[0]] if inside else None
        graph.keep(op, tuple(graph.nodes[i] for i in args), data, int(flags), loop)
    return graph


def _place(plain: Any) -> Place:
    return plain if isinstance(plain, int) else _affine(plain)


def _stage(plain: Sequence[Any], graph: Graph) -> Stage:
    size, loops, terms = plain
    summands = tuple(
        (graph.loops[loop], tuple((_affine(place), graph.nodes[i]) for place, i in entries))
        for loop, entries in loops
    )
    return graph.stage(size, summands, tuple((place, graph.nodes[i]) for place, i in terms))


def _affine(plain: Sequence[Any]) -> Affine:
    return Affine(tuple(int(c) for c in plain[0]), int(plain[1]))


_OF_PLAIN: dict[str, Callable[[Any, Graph], Any]] = {
    "const": lambda data, _: float(data),
    "symbol": lambda data, _: (data[0], _place(data[1])),
    "index": lambda data, _: _affine(data),
    "pow": lambda data, _: int(data),
    "sum": lambda data, graph: graph.loops[data],
    "entry": lambda data, graph: (graph.constants(np.array(data[0], dtype=np.float64)), _affine(data[1])),
    "element": lambda data, graph: (_stage(data[0], graph), _place(data[1])),
    "table": lambda data, _: Table(
        tuple(map(float, data[0])), tuple(tuple(map(float, r)) for r in data[1]), len(data) == 3
    ),
}
"""What `Node.data` is, from what `_plain` returns."""


def _plain(data: Any) -> Any:
    match data:
        case Loop():
            return data.id
        case Table():
            plain: list[Any] = [list(data.knots), [list(row) for row in data.rows]]
            return [*plain, True] if data.extrapolate else plain
        case Affine():
            return [list(data.coefficients), data.offset]
        case Constants():
            return data.values.tolist()
        case Stage():
            loops = [[loop.id, [[_plain(at), n.id] for at, n in entries]] for loop, entries in data.loops]
            return [data.size, loops, [[place, node.id] for place, node in data.terms]]
        case (Constants() | Stage() as source, place):
            return [_plain(source), _plain(place)]
        case (space, place):
            return [space, _plain(place)]
    return data
