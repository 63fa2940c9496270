"""One operation of a traced function: what the function sees as a number, and what it refuses to be."""

import numbers
from typing import TYPE_CHECKING, Any, NoReturn

from problems.trace.lines import refuse

if TYPE_CHECKING:
    from problems.trace.graph import Graph

T, Q, P, PAR = 1, 2, 4, 8  # what a node depends on: time, positions, momenta, parameters
STATE = Q | P
FUNCTIONS = ("sqrt", "sin", "cos", "tan", "exp", "log", "abs", "sign")


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
        ``"neg"``, ``"pow"``, ``"sum"`` or one of `FUNCTIONS`.
    args : tuple of Node
        The arguments, in the user's order.
    data : Any
        The value of a constant; (space, index) of a symbol; the affine index of
        ``"index"``; the exponent of ``"pow"``; the loop of ``"sum"``.
    flags : int
        What the node depends on, of `T`, `Q`, `P`, `PAR`.
    loop : Any
        The declared sum's loop inside which the node lives, or ``None``.
    """

    __slots__ = ("args", "data", "flags", "graph", "id", "loop", "op")

    def __init__(
        self, graph: "Graph", op: str, args: "tuple[Node, ...]", data: Any, flags: int, loop: Any
    ) -> None:
        self.graph = graph
        self.id = len(graph.nodes)
        self.op = op
        self.args = args
        self.data = data
        self.flags = flags
        self.loop = loop

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
            refuse("a symbol stands in an exponent", "write x**y as m.exp(y*m.log(x))")
        if not isinstance(exponent, numbers.Real) or isinstance(exponent, bool):
            refuse(f"the exponent {exponent!r} is not a number", "give an integer or half an integer")
        twice = 2 * float(exponent)
        if not twice.is_integer() or abs(twice) > 2000:
            refuse(
                f"the exponent {exponent!r} is not an integer or half an integer (up to 1000)",
                "write x**a as m.exp(a*m.log(x))",
            )
        return self.graph.power(self, int(twice))

    def __rpow__(self, base: Any) -> NoReturn:
        refuse("a symbol stands in an exponent", "write a**x as m.exp(x*m.log(a))")

    # What a traced function cannot do. Comparisons refuse by themselves: `==` falling
    # back to identity would take one branch in silence.
    def _branch(self, *_: Any) -> NoReturn:
        refuse(
            "this compares or branches on a symbol",
            "the function is run once, on symbols, so write one formula for all states "
            "(m.abs(x) for the absolute value)",
        )

    __bool__ = __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = _branch  # type: ignore[assignment]

    def __hash__(self) -> int:
        return hash((id(self.graph), self.id))

    def _number(self, *_: Any) -> NoReturn:
        refuse(
            "this needs the value of a symbol",
            "declare the argument m and use m.sqrt, m.sin, m.cos, m.tan, m.exp, m.log, m.abs",
        )

    __float__ = __int__ = __complex__ = __index__ = __round__ = __trunc__ = __floor__ = __ceil__ = _number

    def _whole(self, *_: Any) -> NoReturn:
        refuse("this takes // or % of a symbol", "write a smooth formula: m.sin and m.cos are periodic")

    __floordiv__ = __rfloordiv__ = __mod__ = __rmod__ = __divmod__ = __rdivmod__ = _whole

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
        better = {"absolute": "abs"}.get(name, name)
        remedy = f"use m.{better}" if better in FUNCTIONS else "write it with + - * / and the functions of m"
        return refuse(f"this applies numpy's {name} to a symbol", f"declare the argument m and {remedy}")
