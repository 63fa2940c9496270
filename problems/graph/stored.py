"""Graphs as files hold them, checked before a single node is made from them.

What a graph says becomes machine code that reads and writes memory at the places that it names, so a file
that was changed by accident or on purpose must not name a place outside: each index, count, shape, order
and type is checked here, and what a node depends on is derived again and compared.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from problems import limits
from problems.errors import InputError, shown
from problems.graph.arithmetic import ARITHMETIC
from problems.graph.functions import CALLED
from problems.graph.nodes import PAR, P, Q, T

_ARGUMENTS: dict[str, int | None] = {
    "const": 0,
    "entry": 0,
    "element": None,
    "symbol": 0,
    "index": 0,
    "pow": 1,
    "sum": 1,
    "table": 1,
    **{name: record.arity for name, record in (ARITHMETIC | CALLED).items()},
}
_LARGEST = 2**53  # of an index, up to which doubles and 64-bit integers are exact alike


def refuse(reason: str) -> NoReturn:
    """Refuse what is stored.

    Raises
    ------
    problems.errors.InputError
        Always.
    """
    raise InputError(f"a stored formula is damaged: {reason}; make the file again.")


def integer(value: Any, low: int, high: int, label: str) -> int:
    """Return a whole number with ``low <= value < high``, or refuse it."""
    if type(value) is not int or not low <= value < high:
        refuse(f"{label} is {shown(value)}")
    return value


def items(value: Any, label: str, size: int | None = None) -> list[Any]:
    """Return a list (of a size), or refuse it."""
    if not isinstance(value, list | tuple) or (size is not None and len(value) != size):
        refuse(f"{label} is {shown(value)}")
    return list(value)


def _number(value: Any, label: str) -> float:
    if type(value) not in (int, float) or not math.isfinite(value):
        refuse(f"{label} is {shown(value)}")
    return float(value)


@dataclass(frozen=True)
class Shape:
    """What indices may point to: the length of the state, its positions, the number of parameters."""

    dim: int
    dof: int | None
    n_par: int


@dataclass(frozen=True)
class _Known:
    """What was checked of a node: whether it may be used, what it depends on, the loop it is in."""

    usable: bool
    flags: int = 0
    loop: int | None = None


class StoredGraph:
    """A graph that was checked, by which the functions on it are checked.

    Parameters
    ----------
    state : mapping
        What `problems.graph.packed.packed` returns.
    shape : Shape
        Of the system.

    Raises
    ------
    problems.errors.InputError
        For anything that no graph of such a system has.
    """

    def __init__(self, state: Mapping[str, Any], shape: Shape) -> None:
        self.shape = shape
        if not isinstance(state, Mapping) or set(state) != {"dof", "loops", "nodes"}:
            refuse("its graph has other parts than dof, loops and nodes")
        if state["dof"] != shape.dof:
            refuse(f"its graph has dof={shown(state['dof'])}")
        self.loops = [_rows(rows) for rows in items(state["loops"], "the list of loops")]
        if len({(rows.shape, rows.tobytes()) for rows in self.loops}) != len(self.loops):
            refuse("two of its loops are the same")
        self.nodes: list[_Known] = []
        for node in items(state["nodes"], "the list of operations"):
            self.nodes.append(_Known(False) if node is None else self._node(node))

    def _node(self, plain: Any) -> _Known:
        op, args, data, flags, *inside = items(plain, "an operation")
        if not isinstance(op, str) or op not in _ARGUMENTS or len(inside) > 1:
            refuse(f"it has no operation {shown(op)}")
        numbered = items(args, f"the list of arguments of {op}", _ARGUMENTS[op])
        used = [self.node(i) for i in numbered]
        mine = integer(inside[0], 0, len(self.loops), "a loop") if inside else None
        depends = 0
        for arg in used:
            depends |= arg.flags
        loop = {arg.loop for arg in used} - {None}
        match op:
            case "const":
                _number(data, "a constant")
            case "symbol":
                depends, loop = self._symbol(data, mine)
            case "index":
                loop = {mine}
                self.places(data, mine, "an index")
            case "entry":
                values, place = items(data, "a constant of a loop", 2)
                listed = [_number(value, "a constant") for value in items(values, "constants")]
                loop = {mine}
                _within(self.places(place, mine, "the place of a constant"), len(listed), "a constant")
            case "element":
                stage, place = items(data, "a value", 2)
                size = self._stage(stage, numbered)
                loop = set() if mine is None else {mine}
                if mine is None:
                    integer(place, 0, size, "the place of a value")
                else:
                    _within(self.places(place, mine, "the place of a value"), size, "a value")
            case "pow":
                integer(data, 3, 1001, "an exponent")
            case "table":
                _check_table(data)
            case "sum":
                if not loop <= {integer(data, 0, len(self.loops), "the loop of a sum")}:
                    refuse("the term of a sum is in another loop")
                loop = set()
        if (loop or {None}) != {mine}:
            refuse(f"{op} is in loop {shown(mine)} and its arguments in others")
        if type(flags) is not int or flags != depends:
            refuse(f"{op} depends on other things than it says")
        return _Known(True, depends, mine)

    def _stage(self, plain: Any, roots: list[Any]) -> int:
        """Check an array of values that loops fill; return its size."""
        size, loops, terms = items(plain, "an array of values", 3)
        integer(size, 1, _LARGEST, "the size of an array")
        limits.check("a stored array", "TERMS", size)
        nodes: list[Any] = []
        for part in items(loops, "the loops of an array"):
            number, entries = items(part, "a loop of an array", 2)
            loop = integer(number, 0, len(self.loops), "a loop")
            for entry in items(entries, "the entries of an array"):
                place, i = items(entry, "an entry of an array", 2)
                _within(self.places(place, loop, "a place of an array"), size, "an array")
                if self.node(i).loop not in (None, loop):
                    refuse("a term of an array is in another loop")
                nodes.append(i)
        for term in items(terms, "the terms of an array"):
            place, i = items(term, "a term of an array", 2)
            integer(place, 0, size, "a place of an array")
            if self.node(i).loop is not None:
                refuse("a term of an array is in a loop")
            nodes.append(i)
        if nodes != roots:
            refuse("an array is made of other operations than it says")
        return size

    def _symbol(self, data: Any, loop: int | None) -> tuple[int, set[int | None]]:
        space, place = items(data, "a symbol", 2)
        sizes = {"t": 1, "y": self.shape.dim, "par": self.shape.n_par}
        if not isinstance(space, str) or space not in sizes:
            refuse(f"it has no symbol {shown(space)}")
        if loop is None:
            low = high = integer(place, 0, sizes[space], f"the place of {space}")
        else:
            places = self.places(place, loop, f"the place of {space}")
            low, high = int(places.min()), int(places.max())
            if low < 0 or high >= sizes[space] or space == "t":
                refuse(f"the places of {space} are {low} to {high}")
        if space != "y":
            return {"t": T, "par": PAR}[space], {loop}
        if self.shape.dof is None or high < self.shape.dof:
            return Q, {loop}
        if low < self.shape.dof:
            refuse("a symbol in a loop is of positions and momenta at once")
        return P, {loop}

    def places(self, affine: Any, loop: int | None, label: str) -> NDArray[np.int64]:
        """Return the places of an affine index in each term of a loop."""
        coefficients, offset = items(affine, label, 2)
        if loop is None:
            refuse(f"{label} is outside of a loop")
        rows = self.loops[loop]
        whole = [integer(c, -_LARGEST, _LARGEST, label) for c in items(coefficients, label, rows.shape[1])]
        integer(offset, -_LARGEST, _LARGEST, label)
        factors = np.array(whole, dtype=np.int64)
        reach = np.abs(rows.astype(np.float64)) @ np.abs(factors.astype(np.float64)) + abs(offset)
        if reach.max() >= _LARGEST:
            refuse(f"{label} is too large")
        return rows @ factors + offset

    def node(self, i: Any) -> _Known:
        """Return what is known of a node that is used, which is among those that came before."""
        node = self.nodes[integer(i, 0, len(self.nodes), "the number of an operation")]
        if not node.usable:
            refuse(f"operation {i} belongs to no function")
        return node

    def check_function(self, plain: Any, name: str, size: int | None) -> None:
        """Check what ``Function.plain`` returns; ``None``: for any number of outputs above 0."""
        outputs, loops = items(plain, name, 2)
        n = len(items(outputs, f"the list of outputs of {name}"))
        if n == 0 or n != (n if size is None else size):
            refuse(f"{name} has {n} outputs")
        for terms in outputs:
            for term in items(terms, f"an output of {name}"):
                i, key = items(term, f"a term of {name}", 2)
                integer(key, -_LARGEST, _LARGEST, f"the order of {name}")
                if self.node(i).loop is not None:
                    refuse(f"a term of {name} is in a loop")
        seen: set[int] = set()
        for part in items(loops, f"the loops of {name}"):
            number, entries = items(part, f"a loop of {name}", 2)
            loop = integer(number, 0, len(self.loops), "a loop")
            if loop in seen:
                refuse(f"{name} has a loop twice")
            seen.add(loop)
            for entry in items(entries, f"the entries of {name}"):
                coefficients, offset, i = items(entry, f"an entry of {name}", 3)
                places = self.places([coefficients, offset], loop, f"a place of {name}")
                if places.min() < 0 or places.max() >= n:
                    refuse(f"{name} writes to place {int(places.max())} of {n}")
                if self.node(i).loop not in (None, loop):
                    refuse(f"a term of {name} is in another loop")


def _within(places: NDArray[np.int64], size: int, label: str) -> None:
    if places.min() < 0 or places.max() >= size:
        refuse(f"{label} has the place {int(places.max())} of {size}")


def _rows(plain: Any) -> NDArray[np.int64]:
    rows = items(plain, "the list of a loop")
    limits.check("a stored sum", "TERMS", len(rows))
    width = len(items(rows[0], "a row of a loop")) if rows else 0
    if not 1 <= width <= 64:
        refuse(f"a loop has {len(rows)} rows of {width} integers")
    for row in rows:
        for value in items(row, "a row of a loop", width):
            integer(value, -_LARGEST, _LARGEST, "an integer of a loop")
    return np.array(rows, dtype=np.int64)


def _check_table(plain: Any) -> None:
    parts = items(plain, "a table")
    knots, rows = items(parts[:-1] if parts[2:] == [True] else parts, "a table", 2)
    places = [_number(knot, "a knot of a table") for knot in items(knots, "the knots of a table")]
    if len(places) < 2 or any(a >= b for a, b in pairwise(places)):
        refuse("the knots of a table do not ascend")
    if len(items(rows, "the rows of a table")) not in (len(places) - 1, len(places)):
        refuse("a table has other numbers of rows and knots")
    width = len(items(rows[0], "a row of a table"))
    if width == 0:
        refuse("a table has rows without coefficients")
    for row in rows:
        for value in items(row, "a row of a table", width):
            _number(value, "a coefficient of a table")
