"""A function run once on symbols, its operations kept in the user's own order.

A `Graph` holds the operations; equal operations on equal arguments are one
`Node` (hash-consing), so common subexpressions cost nothing. Only rewritings
that leave every bit of the result as it is are made: ``a + (-b)`` is ``a - b``,
``(-a)*b`` is ``-(a*b)``, ``1*a`` is ``a``, a division by a power of two is a
multiplication, two factors of which one is a power of two are one, ``b + a``
reuses ``a + b``. (Adding a literal zero is dropped, which can change the sign of
a zero and nothing else.) Sums are never re-associated and never sorted: on a
problem with a symmetry, such as Sitnikov's, the order of the operations decides
whether rounding keeps it.

Powers: ``x**2`` is ``x*x``; ``x**n`` is one node, expanded by the emitters to
products by binary powering, ``x**n = (x**(n//2))**2`` times ``x`` for odd ``n``;
``x**(n + 1/2)`` is ``x**n*sqrt(x)``; negative powers are ``1/x**n``.
"""

import math
import numbers
from collections.abc import Callable, Hashable, Iterable
from fractions import Fraction
from operator import attrgetter
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from problems import limits
from problems.graph.arithmetic import ARITHMETIC
from problems.graph.functions import FUNCTIONS
from problems.graph.loops import Affine, Constants, Loop, Place, Stage, Summands
from problems.graph.source_line import refuse, users_line
from problems.graph.tables import Table

T, Q, P, PAR = 1, 2, 4, 8  # what a node depends on: time, positions, momenta, parameters
STATE = Q | P

LARGEST_POWER = 1000
"""Largest integer exponent, which becomes products."""


def is_power_of_two(value: float) -> bool:
    """Whether multiplying by ``value`` is exact (barring overflow and underflow)."""
    return value != 0.0 and math.isfinite(value) and abs(math.frexp(value)[0]) == 0.5


def _ufunc(spelled: str) -> str:
    """Return what NumPy itself calls a function that is emitted under this name."""
    return getattr(getattr(np, spelled.removeprefix("np."), None), "__name__", "")


def _described(value: Any) -> str:
    shape = getattr(value, "shape", None)
    return f"an array of shape {shape}" if shape else f"{value!r:.40}"


class Condition:
    """What a comparison of symbols is: not true or false, but what `m.where` chooses by.

    Parameters
    ----------
    choose : callable
        Returns the node of ``a`` where the condition holds, else ``b``.
    """

    __slots__ = ("choose",)

    def __init__(self, choose: "Callable[[Node, Node], Node]"):
        self.choose = choose

    def __and__(self, other: "Condition") -> "Condition":
        return Condition(lambda a, b: self.choose(other.choose(a, b), b))

    def __or__(self, other: "Condition") -> "Condition":
        return Condition(lambda a, b: self.choose(a, other.choose(a, b)))

    def __invert__(self) -> "Condition":
        return Condition(lambda a, b: self.choose(b, a))

    def __bool__(self) -> NoReturn:
        refuse(*_BRANCH)


_BRANCH = (
    "this compares or branches on a symbol",
    "the function is run once, on symbols, so write one formula for all states "
    "(m.abs(x), m.min(x, y), m.max(x, y); m.where(x > 0, a, b) for two pieces)",
)


READS = frozenset({"symbol", "index", "entry", "element"})
"""Operations that read an input, a loop's index, one of some constants or a value of a stage."""


class Node:
    """One operation of a graph; what a user's function sees as a number.

    Attributes
    ----------
    graph : Graph
        The graph that the node belongs to.
    id : int
        Position in the graph; arguments always come before their users.
    op : str
        ``"const"``, ``"symbol"``, ``"index"``, ``"add"``, ``"sub"``, ``"mul"``, ``"div"``,
        ``"neg"``, ``"pow"``, ``"sum"``, ``"where"`` (the second argument where the first is
        above 0, else the third), ``"table"``, ``"entry"`` (one of some constants), ``"element"`` (of a
        stage) or one of `problems.graph.functions.FUNCTIONS`.
    args : tuple of Node
        The arguments, in the user's order; of an element, all that its stage is made of.
    data : Any
        The value of a constant; (space, index) of a symbol; the affine index of
        ``"index"``; the exponent of ``"pow"``; the loop of ``"sum"``; the `Table` of ``"table"``;
        (`Constants`, index) of ``"entry"``; (`Stage`, index) of ``"element"``.
    flags : int
        What the node depends on, of `T`, `Q`, `P`, `PAR`.
    loop : Loop or None
        The declared sum's loop inside which the node lives, or ``None``.
    """

    __slots__ = ("args", "data", "flags", "graph", "id", "loop", "op")

    def __init__(
        self, graph: "Graph", op: str, args: "tuple[Node, ...]", data: Any, flags: int, loop: Loop | None
    ) -> None:
        self.graph = graph
        self.id = len(graph.nodes)
        self.op = op
        self.args = args
        self.data = data
        self.flags = flags
        self.loop = loop

    @property
    def reads(self) -> "tuple[Node, ...]":
        """The nodes whose values it is calculated from where it stands: a loop's are in the loop."""
        return () if self.op in ("element", "sum") else self.args

    @property
    def place(self) -> Any:
        """Where an input, a constant or a value of a stage is read, or what an index is: a `Place`."""
        return self.data if self.op == "index" else self.data[1]

    def __repr__(self) -> str:
        inside = ", ".join([f"#{arg.id}" for arg in self.args] + ([repr(self.data)] if self.data else []))
        return f"#{self.id}={self.op}({inside})"

    def __add__(self, other: Any) -> "Node":
        return self.graph.add(self, self.graph.node(other))

    def __radd__(self, other: Any) -> "Node":
        return self.graph.add(self.graph.node(other), self)

    def __sub__(self, other: Any) -> "Node":
        return self.graph.sub(self, self.graph.node(other))

    def __rsub__(self, other: Any) -> "Node":
        return self.graph.sub(self.graph.node(other), self)

    def __mul__(self, other: Any) -> "Node":
        return self.graph.mul(self, self.graph.node(other))

    def __rmul__(self, other: Any) -> "Node":
        return self.graph.mul(self.graph.node(other), self)

    def __truediv__(self, other: Any) -> "Node":
        return self.graph.div(self, self.graph.node(other))

    def __rtruediv__(self, other: Any) -> "Node":
        return self.graph.div(self.graph.node(other), self)

    def __neg__(self) -> "Node":
        return self.graph.neg(self)

    def __pos__(self) -> "Node":
        return self

    def __abs__(self) -> "Node":
        return self.graph.call("abs", self)

    def __pow__(self, exponent: Any) -> "Node":
        if isinstance(exponent, Node):
            return self._real_power(exponent)
        if not isinstance(exponent, numbers.Real) or isinstance(exponent, bool):
            refuse(f"the exponent {exponent!r} is not a number", "give an integer or half an integer")
        twice = 2 * float(exponent)
        if float(exponent).is_integer() and abs(twice) > 2 * LARGEST_POWER:
            refuse(f"the exponent {exponent!r} is above {LARGEST_POWER}", "give a smaller one")
        if not twice.is_integer() or abs(twice) > 2 * LARGEST_POWER:
            return self._real_power(self.graph.node(exponent))
        return self.graph.power(self, int(twice))

    def __rpow__(self, base: Any) -> "Node":
        return self.graph.node(base)._real_power(self)

    def _real_power(self, exponent: "Node") -> "Node":
        """Return the power of a positive number."""
        return self.graph.call("exp", exponent * self.graph.call("log", self))

    def __mod__(self, period: Any) -> "Node":
        return self - period * (self // period)

    def __rmod__(self, number: Any) -> "Node":
        return self.graph.node(number) % self

    def __floordiv__(self, divisor: Any) -> "Node":
        return self.graph.call("floor", self / divisor)

    def __rfloordiv__(self, number: Any) -> "Node":
        return self.graph.node(number) // self

    # What a traced function cannot do. Comparisons refuse by themselves: `==` falling
    # back to identity would take one branch in silence.
    def _branch(self, *_: Any) -> NoReturn:
        refuse(*_BRANCH)

    __bool__ = __eq__ = __ne__ = _branch  # type: ignore[assignment]

    def __gt__(self, other: Any) -> Condition:
        difference = self.graph.sub(self, self.graph.node(other))
        return Condition(lambda a, b: self.graph.where(difference, a, b))

    def __lt__(self, other: Any) -> Condition:
        difference = self.graph.sub(self.graph.node(other), self)
        return Condition(lambda a, b: self.graph.where(difference, a, b))

    def __ge__(self, other: Any) -> Condition:
        return ~(self < other)

    def __le__(self, other: Any) -> Condition:
        return ~(self > other)

    def __hash__(self) -> int:
        return hash((id(self.graph), self.id))

    def _number(self, *_: Any) -> NoReturn:
        refuse(
            "this needs the value of a symbol",
            "declare the argument m and use m.sqrt, m.sin, m.cos, m.exp, m.log, m.abs, m.round, m.where",
        )

    __float__ = __int__ = __complex__ = __index__ = __round__ = __trunc__ = __floor__ = __ceil__ = _number

    def __array__(self, *_: Any, **__: Any) -> NoReturn:
        refuse(
            "this makes a numpy array of symbols",
            "write the formula in components, with Python lists and loops and the functions of m",
        )

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **_: Any) -> Any:
        # numpy scalars are ordinary numbers: np.float64(2.0)*q[0] arrives here.
        binary = {
            "add": self.graph.add,
            "subtract": self.graph.sub,
            "multiply": self.graph.mul,
            "divide": self.graph.div,
        }.get(ufunc.__name__)
        if binary is not None and method == "__call__" and len(inputs) == 2:
            return binary(self.graph.node(inputs[0]), self.graph.node(inputs[1]))
        name = ufunc.__name__
        better = next((known for known, f in FUNCTIONS.items() if name in (known, _ufunc(f.numpy))), name)
        remedy = f"use m.{better}" if better in FUNCTIONS else "write it with + - * / and the functions of m"
        return refuse(f"this applies numpy's {name} to a symbol", f"declare the argument m and {remedy}")


class Graph:
    """Hash-consed operations of one system.

    Parameters
    ----------
    dof : int or None
        Number of positions at the head of the state (``None``: all of the state
        counts as positions).
    """

    def __init__(self, dof: int | None = None) -> None:
        self.dof = dof
        self.nodes: list[Node] = []
        self._loops: dict[Hashable, Loop] = {}
        self._constants: dict[bytes, Constants] = {}
        self._stages: dict[Hashable, Stage] = {}
        self.scopes: list[Loop] = []  # those whose terms are being traced, each with the columns of the last
        self._lifted: dict[tuple[int, int], Node] = {}
        self.limit: int | None = None  # of operations, while a user's function makes them
        self._written = 0  # operations so far: symbols and constants are none
        self._table: dict[Hashable, Node] = {}

    def _intern(
        self,
        op: str,
        args: tuple[Node, ...],
        data: Any = None,
        *,
        flags: int = 0,
        loop: Loop | None = None,
    ) -> Node:
        if len(args) > 1:
            args = self._in_one_loop(args)
        known = self._table.get(key := _key(op, args, data, loop))
        if known is not None:
            return known
        for arg in args:
            flags |= arg.flags
            if arg.loop is not None and arg.loop is not loop:
                if loop is not None:
                    refuse(
                        "this mixes the terms of two sums",
                        "use the symbols of one m.sum inside its own term only",
                    )
                loop = arg.loop
        node = Node(self, op, args, data, flags, loop)
        self._written += bool(args)
        if self.limit is not None and self._written > self.limit:
            limits.check(f"{users_line()}: this", "OPERATIONS", self._written, limits.WRITTEN_OUT)
        self.nodes.append(node)
        self._table[key] = node
        return node

    def _in_one_loop(self, args: tuple[Node, ...]) -> tuple[Node, ...]:
        """Return arguments of loops one inside the other as those of the innermost."""
        loops = {arg.loop for arg in args if arg.loop is not None}
        if len(loops) < 2 or not all(loop in self.scopes for loop in loops):
            return args
        innermost = max(loops, key=self.scopes.index)
        return tuple(arg if arg.loop is None else self.lifted(arg, innermost) for arg in args)

    def lifted(self, node: Node, loop: Loop) -> Node:
        """Return a node of a loop in one whose list begins with the columns of that."""
        if node.loop is None or node.loop is loop:
            return node
        for inner in reachable([node], node.loop):
            if (inner.id, loop.id) not in self._lifted:
                self._lifted[inner.id, loop.id] = self._of_loop(inner, loop)
        return self._lifted[node.id, loop.id]

    def lifted_to(self, node: Node, loop: Loop) -> Node:
        """Return a node as one of a loop that is being traced; others belong to a loop that has ended."""
        if node.loop is not None and node.loop not in self.scopes and node.loop is not loop:
            refuse(
                "this mixes the terms of two sums",
                "use the symbols of one m.sum inside its own term only",
            )
        return self.lifted(node, loop)

    def _of_loop(self, node: Node, loop: Loop) -> Node:
        if node.op in READS:
            return self.widened(node, loop)
        return self.apply(node, tuple(self._lifted.get((arg.id, loop.id), arg) for arg in node.args))

    def widened(self, node: Node, loop: Loop, at: int = 0) -> Node:
        """Return a node of `READS` in a loop whose list has the columns of its own from ``at`` on."""
        return self.elsewhere(node, node.place.widened(loop.width, at), loop)

    def elsewhere(self, node: Node, place: Place, loop: Loop | None) -> Node:
        """Return what a node of `READS` reads at another place, of a loop or (``None``) outside of all."""
        match node.op:
            case "symbol":
                return self.symbol(node.data[0], place, flags=node.flags, loop=loop)
            case "entry":
                return self.entry(node.data[0], place, loop)
            case "element":
                return self.element(node.data[0], place, loop)
        return self.const(float(place)) if isinstance(place, int) else self.index(place, loop)

    def keep(self, op: str, args: tuple[Node, ...], data: Any, flags: int, loop: Loop | None) -> Node:
        """Append an operation as it is, without any rewriting: one of a graph that was packed, or a sum."""
        node = Node(self, op, args, data, flags, loop)
        self.nodes.append(node)
        self._table[_key(op, args, data, loop)] = node
        return node

    def skip(self) -> None:
        """Append an operation that nothing finds: the place of one that was left out."""
        self.nodes.append(Node(self, "const", (), 0.0, 0, None))

    def loop(self, rows: NDArray[np.int64]) -> Loop:
        """Return the loop over a list of indices, shape (n, width); one object per list."""
        return self._loops.setdefault((rows.shape, rows.tobytes()), Loop(rows, len(self._loops)))

    @property
    def loops(self) -> list[Loop]:
        """The loops of declared sums, by number."""
        return list(self._loops.values())

    def const(self, value: float) -> Node:
        """Return the node of a literal."""
        return self._intern("const", (), value)

    def symbol(self, space: str, index: int | Affine, *, flags: int, loop: Loop | None = None) -> Node:
        """Return the node of one input: ``space`` is "t", "y", "par" or "out"."""
        return self._intern("symbol", (), (space, index), flags=flags, loop=loop)

    def index(self, affine: Affine, loop: Loop | None) -> Node:
        """Return the node of a loop index used as a number."""
        return self._intern("index", (), affine, loop=loop)

    def constants(self, values: NDArray[np.float64]) -> Constants:
        """Return numbers that loops read, shape (n,); one object per list."""
        return self._constants.setdefault(values.tobytes(), Constants(values, len(self._constants)))

    def entry(self, constants: Constants, place: Place, loop: Loop | None) -> Node:
        """Return one of some constants."""
        if isinstance(place, int):
            return self.node(constants.values[place])
        return self._intern("entry", (), (constants, place), loop=loop)

    def stage(self, size: int, loops: Summands, terms: tuple[tuple[int, Node], ...] = ()) -> Stage:
        """Return an array that is filled by loops and single terms; one object for the same summands."""
        key = (
            size,
            tuple((loop.id, tuple((place, node.id) for place, node in entries)) for loop, entries in loops),
            tuple((place, node.id) for place, node in terms),
        )
        return self._stages.setdefault(key, Stage(len(self._stages), size, loops, terms))

    def element(self, stage: Stage, place: Place, loop: Loop | None) -> Node:
        """Return one value of a stage."""
        node = self._table.get(_key("element", (), (stage, place), loop))
        if node is not None:
            return node
        flags = 0
        for root in stage.roots:
            flags |= root.flags
        return self.keep("element", stage.roots, (stage, place), flags, loop)

    def sum(self, body: Node, loop: Loop) -> Node:
        """Return the node of a declared sum of ``body`` over ``loop``, in the loop's order."""
        node = self._table.get(_key("sum", (body,), loop, None))
        return self.keep("sum", (body,), loop, body.flags, None) if node is None else node

    def node(self, value: Any) -> Node:
        """Return ``value``, a number or a node of this graph, as a node."""
        if isinstance(value, Node):
            if value.graph is not self:
                refuse(
                    "this symbol belongs to another traced function",
                    "do not keep symbols between calls; return what is needed instead",
                )
            return value
        as_node = getattr(value, "as_node", None)
        if as_node is not None:
            return as_node()
        if isinstance(value, numbers.Real) and not isinstance(value, bool):
            number = float(value)
            if not math.isfinite(number):
                refuse(f"the constant {value!r} is not finite", "use finite numbers only")
            return self.const(number)
        if isinstance(value, complex):
            refuse(
                f"this calculates with the complex number {value!r}, and states are real",
                "split it into real and imaginary parts, y[0] + i*y[1]",
            )
        return refuse(
            f"this calculates with {_described(value)} as if it were one number",
            "write the formula in components, such as q[0]*p[1] - q[1]*p[0]",
        )

    def add(self, a: Node, b: Node) -> Node:
        """Return ``a + b``."""
        if a.op == "const":
            if b.op == "const":
                return self.node(a.data + b.data)
            if a.data == 0.0:
                return b
        elif b.op == "const" and b.data == 0.0:
            return a
        if b.op == "neg":
            return self.sub(a, b.args[0])
        if a.op == "neg":
            return self.sub(b, a.args[0])
        return self._intern("add", (a, b))

    def sub(self, a: Node, b: Node) -> Node:
        """Return ``a - b``."""
        if b.op == "const":
            if a.op == "const":
                return self.node(a.data - b.data)
            if b.data == 0.0:
                return a
        elif a.op == "const" and a.data == 0.0:
            return self.neg(b)
        if b.op == "neg":
            return self.add(a, b.args[0])
        return self._intern("sub", (a, b))

    def neg(self, a: Node) -> Node:
        """Return ``-a``."""
        if a.op == "const":
            return self.const(-a.data)
        if a.op == "neg":
            return a.args[0]
        return self._intern("neg", (a,))

    def mul(self, a: Node, b: Node) -> Node:
        """Return ``a*b``."""
        if b.op == "const" and a.op != "const":
            a, b = b, a  # a product does not depend on the order of its two factors
        if a.op == "const":
            if b.op == "const":
                return self.node(a.data * b.data)
            if a.data == 1.0:
                return b
            if a.data == -1.0:
                return self.neg(b)
            if b.op == "mul" and b.args[0].op == "const":
                inner = b.args[0].data
                if is_power_of_two(a.data) or is_power_of_two(inner):
                    return self.mul(self.node(a.data * inner), b.args[1])
        if a.op == "neg":
            return self.neg(self.mul(a.args[0], b))
        if b.op == "neg":
            return self.neg(self.mul(a, b.args[0]))
        return self._intern("mul", (a, b))

    def div(self, a: Node, b: Node) -> Node:
        """Return ``a/b``."""
        if b.op == "const":
            if b.data == 0.0:
                refuse("this divides by the constant 0", "divide by a number that is not zero")
            if a.op == "const" and Fraction(a.data) / Fraction(b.data) == Fraction(a.data / b.data):
                # Folded only where exact: 1/3 stays a division, which double-double evaluates further.
                return self.node(a.data / b.data)
            if is_power_of_two(b.data):
                return self.mul(self.const(1.0 / b.data), a)
        if a.op == "neg":
            return self.neg(self.div(a.args[0], b))
        if b.op == "neg":
            return self.neg(self.div(a, b.args[0]))
        return self._intern("div", (a, b))

    def power(self, base: Node, twice: int) -> Node:
        """Return ``base**(twice/2)``."""
        if twice < 0:
            return self.div(self.const(1.0), self.power(base, -twice))
        whole = self.int_power(base, twice // 2)
        if twice % 2 == 0:
            return whole
        return self.mul(whole, self.call("sqrt", base))

    def int_power(self, base: Node, n: int) -> Node:
        """Return ``base**n`` for ``n >= 0``: 1, the base, a product, or one node."""
        if n == 0:
            return self.const(1.0)
        if n == 1:
            return base
        if n == 2:
            return self.mul(base, base)
        if base.op == "const":
            return self.node(self.expanded(base, n))
        return self._intern("pow", (base,), n)

    def expanded(self, base: Node, n: int) -> Node:
        """Return ``base**n``, ``n >= 1``, as products by binary powering."""
        if n == 1:
            return base
        half = self.expanded(base, n // 2)
        square = self.mul(half, half)
        return self.mul(square, base) if n % 2 else square

    def call(self, name: str, *args: Node) -> Node:
        """Return the elementary function ``name`` of its arguments."""
        numbers = [arg.data for arg in args if arg.op == "const"]
        if len(numbers) == len(args):
            try:
                return self.node(FUNCTIONS[name].value(*numbers))
            except (ValueError, OverflowError):
                low, high = FUNCTIONS[name].domain
                refuse(
                    f"{name}({', '.join(map(repr, numbers))}) is not defined",
                    f"keep to the function's domain, from {low:.6g} to {high:.6g}",
                )
        return self._intern(name, args)

    def where(self, condition: Node, a: Node, b: Node) -> Node:
        """Return ``a`` where ``condition`` is above 0, else ``b``."""
        if condition.op == "const":
            return a if condition.data > 0.0 else b
        return a if a is b else self._intern("where", (condition, a, b))

    def table(self, x: Node, table: Table) -> Node:
        """Return a piecewise polynomial of ``x``."""
        if x.op == "const":
            return self.node(float(table.at(x.data)))
        return self._intern("table", (x,), table)

    def apply(self, node: Node, args: tuple[Node, ...]) -> Node:
        """Return the operation of ``node`` on other arguments."""
        match node.op:
            case op if op in ARITHMETIC or op == "where":
                return getattr(self, op)(*args)
            case "pow":
                return self.int_power(args[0], node.data)
            case "sum":
                return self.sum(args[0], node.data)
            case "table":
                return self.table(args[0], node.data)
            case op if op == "const" or op in READS:
                return node
            case _:
                return self.call(node.op, *args)


def _key(op: str, args: tuple[Node, ...], data: Any, loop: Loop | None) -> Hashable:
    """Return what an operation is found by: the same for all that have the same value."""
    match op:
        case "const":
            return op, repr(data)  # which tells 0.0 from -0.0; they compare equal
        case "symbol" | "index":
            return op, data, None if loop is None else loop.id
        case "entry" | "element":
            return op, data[0].id, data[1], None if loop is None else loop.id
        case "add" | "mul":
            a, b = args
            return (op, a.id, b.id) if a.id <= b.id else (op, b.id, a.id)
        case "sub" | "div":
            return op, args[0].id, args[1].id
        case "pow" | "table":
            return op, args[0].id, data
        case "sum":
            return op, args[0].id, data.id
    return op, *[arg.id for arg in args]


def reachable(
    roots: Iterable[Node],
    within: Loop | None = None,
    arguments: Callable[[Node], Iterable[Node]] = attrgetter("args"),
) -> list[Node]:
    """Return all nodes that ``roots`` depend on, arguments first; of a loop, those inside it only."""
    seen: dict[int, Node] = {}
    stack = list(roots)
    while stack:
        node = stack.pop()
        if node.id not in seen and (within is None or node.loop is within):
            seen[node.id] = node
            stack.extend(arguments(node))
    return [seen[key] for key in sorted(seen)]
