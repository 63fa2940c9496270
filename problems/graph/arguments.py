"""What a user's function is called with: ``t, q, p, y, par, m``, by name."""

import inspect
import math
import numbers
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from problems import limits
from problems.errors import InputError, shown, unknown
from problems.graph import sums
from problems.graph.each import (
    Constants,
    Each,
    components,
    constants,
    dot,
    each,
    flat_index,
    place_of,
    scatter,
)
from problems.graph.functions import OF_ONE_ARGUMENT
from problems.graph.nodes import PAR, Condition, Graph, Node, P, Q, T
from problems.graph.source_line import line_of_function, line_of_traceback, refuse
from problems.graph.tables import Table

# Where each parameter lies in the flat vector `par`: offset, and shape.
Layout = Mapping[str, tuple[int, tuple[int, ...]]]


class Vector:
    """Symbols side by side; read like a tuple, by integers or by the indices of a declared sum."""

    __slots__ = ("_graph", "_name", "_offset", "_size", "_space")

    def __init__(self, graph: Graph, name: str, space: str, offset: int, size: int) -> None:
        self._graph = graph
        self._name = name
        self._space = space
        self._offset = offset
        self._size = size

    def __repr__(self) -> str:
        return f"<{self._name}: {self._size} symbols>"

    def __len__(self) -> int:
        return self._size

    def __iter__(self) -> Iterator[Node]:
        return (self._at(i) for i in range(self._size))

    def _flags(self, low: int, high: int) -> int:
        if self._space == "par":
            return PAR
        if self._graph.dof is None or high < self._graph.dof:
            return Q
        if low >= self._graph.dof:
            return P
        return refuse(
            f"{self._name}[...] in m.sum runs over positions and momenta at once", "use q[i] and p[i]"
        )

    def _at(self, i: int) -> Node:
        place = self._offset + i
        return self._graph.symbol(self._space, place, flags=self._flags(place, place))

    def __getitem__(self, i: Any) -> Any:
        if isinstance(i, slice):
            return Slice(self, range(self._size)[i])
        place, loop = place_of(i, self._size, self._name)
        if loop is None:
            return self._at(place)
        places = place.shifted(self._offset).values(loop)
        flags = self._flags(int(places.min()), int(places.max()))
        return self._graph.symbol(self._space, place.shifted(self._offset), flags=flags, loop=loop)

    def __setitem__(self, i: Any, value: Any) -> NoReturn:
        refuse(
            f"this changes its argument {self._name}",
            f"build new values instead, such as x = list({self._name})",
        )

    def _whole(self, *_: Any, **__: Any) -> NoReturn:
        refuse(
            f"this calculates with the whole vector {self._name}",
            f"write it in components, such as {self._name}[0]*{self._name}[0], or with m.sum",
        )

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = _whole
    __pow__ = __neg__ = __matmul__ = __rmatmul__ = __abs__ = __array__ = __array_ufunc__ = _whole
    __float__ = __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = _whole  # type: ignore[assignment]
    __hash__ = object.__hash__
    __iadd__ = __isub__ = __imul__ = __itruediv__ = _whole


class Slice(list[Node]):
    """A part of a vector: a list that loops may read as well."""

    def __init__(self, whole: Vector, places: range):
        super().__init__(whole[k] for k in places)
        self._whole, self._places = whole, places

    def __getitem__(self, i: Any) -> Any:
        if not isinstance(i, sums.Index):
            return super().__getitem__(i)
        if place_of(i, len(self), "this slice")[1] is None:
            return super().__getitem__(i.affine.offset)
        return self._whole[i * self._places.step + self._places.start]

    @property
    def vector(self) -> "Slice":
        """What loops read."""
        return self


class Matrix:
    """A parameter of several dimensions, read by as many indices: ``par.K[i, j]``."""

    def __init__(self, flat: Vector, shape: tuple[int, ...]):
        self._flat, self.shape = flat, shape

    def __repr__(self) -> str:
        return f"{self._flat!r:.40} of shape {self.shape}"

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, indices: Any) -> Node:
        return self._flat[flat_index(indices, self.shape, "this parameter")]

    def __array_ufunc__(self, *_: Any, **__: Any) -> NoReturn:
        refuse("this calculates with a whole parameter", "write it in components, or with m.dot")


def further(graph: Graph, name: str, offset: int, shape: tuple[int, ...]) -> Any:
    """Return numbers that lie behind the parameters, as one symbol, shape (), or as a vector, (n,)."""
    if not shape:
        return graph.symbol("par", offset, flags=PAR)
    return Vector(graph, name, "par", offset, *shape)


def is_list(value: Any) -> bool:
    """Whether a function returned several numbers."""
    return isinstance(value, list | tuple | Vector | Each)


class Parameters:
    """The parameters as attributes: scalars are symbols, sequences are vectors of symbols."""

    __slots__ = ("_graph", "_layout")

    def __init__(self, graph: Graph, layout: Layout) -> None:
        object.__setattr__(self, "_graph", graph)
        object.__setattr__(self, "_layout", layout)

    def as_node(self) -> NoReturn:
        """Refuse to be a number: a third argument is not the derivative or a parameter itself."""
        refuse(
            "this calculates with par, which holds all parameters, as if it were one number",
            f"write par.{next(iter(self._layout), 'NAME')}",
        )

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        if name not in self._layout:
            refuse(
                str(unknown("parameter", name, self._layout)).rstrip("."),
                f"declare it: parameters={{{name!r}: value}}",
            )
        offset, shape = self._layout[name]
        if not shape:
            return self._graph.symbol("par", offset, flags=PAR)
        vector = Vector(self._graph, f"par.{name}", "par", offset, math.prod(shape))
        return vector if len(shape) == 1 else Matrix(vector, shape)

    def __getitem__(self, name: Any) -> Any:
        if not isinstance(name, str):
            refuse(f"par[{name!r}] is not a parameter", "write par.name")
        return getattr(self, name)

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        refuse(f"this changes the parameter {name}", "parameters are read only inside the function")


class Mathematics:
    """The functions that a traced function may use; ``m`` in its arguments."""

    pi = math.pi

    def __init__(self, graph: Graph) -> None:
        self._graph = graph

    def sum(self, term: Any, index: Iterable[Any] | None = None) -> Any:
        """Return the sum of ``term(i)`` over ``index``, as one declared sum."""
        if index is None:
            refuse("m.sum needs a term and an index list", "write m.sum(lambda i: q[i]**2, range(n))")
        return sums.declare(self._graph, term, index)

    def each(self, term: Any, index: Iterable[Any] | None = None) -> Each:
        """Return the array of ``term(i)`` for the i of ``index``, as one loop."""
        if index is None:
            refuse("m.each needs a term and an index list", "write m.each(lambda i: -y[i], range(n))")
        return each(self._graph, term, index)

    def scatter(self, term: Any, index: Iterable[Any], n: int) -> Each:
        """Return n sums, to which ``term(i, j)`` adds at the places it names: ``{i: force, j: -force}``."""
        return scatter(self._graph, term, index, n)

    def dot(self, matrix: Any, vector: Any) -> Any:
        """Return a matrix times a vector; of two vectors, their scalar product."""
        return dot(self._graph, matrix, vector)

    def array(self, values: Any) -> Constants:
        """Return an array of numbers that loops may read: ``K = m.array(K); K[i, j]``."""
        return constants(self._graph, values)

    def atan2(self, y: Any, x: Any) -> Node:
        """Return the angle of the point (x, y), from -pi to pi."""
        return self._graph.call("atan2", self._graph.node(y), self._graph.node(x))

    def hypot(self, x: Any, y: Any) -> Node:
        """Return ``m.sqrt(x*x + y*y)``."""
        x, y = self._graph.node(x), self._graph.node(y)
        return self._graph.call("sqrt", x * x + y * y)

    def min(self, first: Any, *others: Any) -> Node:
        """Return the smallest of numbers; of equal ones the first, and its derivative."""
        least = self._graph.node(first)
        for other in map(self._graph.node, self._several("min", others)):
            least = self._graph.where(least - other, other, least)
        return least

    def max(self, first: Any, *others: Any) -> Node:
        """Return the largest of numbers; of equal ones the first, and its derivative."""
        largest = self._graph.node(first)
        for other in map(self._graph.node, self._several("max", others)):
            largest = self._graph.where(other - largest, other, largest)
        return largest

    @staticmethod
    def _several(name: str, others: tuple[Any, ...]) -> tuple[Any, ...]:
        if not others:
            refuse(f"m.{name} has one argument", f"give the numbers one by one, as in m.{name}(q[0], q[1])")
        return others

    def where(self, condition: Any, a: Any, b: Any) -> Node:
        """Return ``a`` where a comparison such as ``q[0] > 1`` holds, else ``b``; ``& | ~`` join them."""
        a, b = self._graph.node(a), self._graph.node(b)
        if isinstance(condition, bool):
            return a if condition else b
        if not isinstance(condition, Condition):
            refuse(
                f"m.where chooses by {shown(condition)}", "compare with < or >, as in m.where(q[0] > 1, a, b)"
            )
        return condition.choose(a, b)

    def table(self, x: Any, xs: Any, ys: Any, *, kind: str = "cubic", extrapolate: bool = False) -> Node:
        """Return the interpolant of points, at ``x``.

        ``kind``: ``"cubic"``, SciPy's ``CubicSpline(xs, ys)``; ``"linear"``; ``"previous"``, the value of the
        last point that is not beyond ``x``. An integration beyond the points of a table of the time is
        refused, unless ``extrapolate``.

        ``m.table((x, y), (xs, ys), zs)``, with zs of shape (len(xs), len(ys)), is the same in two dimensions:
        the sum over the points of the shorter side of their own interpolant times that of the values there,
        2*min(len(xs), len(ys)) tables.
        """
        if isinstance(x, tuple | list):
            return self._table_of_two(x, xs, ys, {"kind": kind, "extrapolate": extrapolate})
        if kind not in _PIECES:
            known = str(unknown("kind of m.table", kind, _PIECES)).rstrip(".")
            refuse(known, "leave it out for a cubic spline")
        try:
            xs, ys = (np.asarray(values, dtype=np.float64) for values in (xs, ys))
            if xs.ndim != 1 or ys.ndim != 1:
                raise ValueError("they are no flat lists")
            finite = xs.size == ys.size and bool(np.isfinite([xs, ys]).all())
            if not finite or xs.size < 2 or (np.diff(xs) <= 0).any():
                raise ValueError("they are no finite numbers over ascending ones")
            rows = tuple(map(tuple, _PIECES[kind](xs, ys).tolist()))
        except (TypeError, ValueError) as error:
            refuse(
                f"m.table cannot use these points ({error})",
                "give as many finite ys as ascending xs, flat lists",
            )
        return self._graph.table(self._graph.node(x), Table(tuple(xs.tolist()), rows, bool(extrapolate)))

    def _table_of_two(self, arguments: Any, points: Any, values: Any, options: dict[str, Any]) -> Node:
        try:
            (x, y), (xs, ys), zs = arguments, points, np.asarray(values, dtype=np.float64)
            if zs.shape != (len(xs), len(ys)):
                raise ValueError(f"the values have the shape {zs.shape}")
        except (TypeError, ValueError) as error:
            refuse(
                f"m.table cannot use this grid ({error})",
                "write m.table((x, y), (xs, ys), zs) with zs of shape (len(xs), len(ys))",
            )
        if len(xs) < len(ys):
            x, y, xs, ys, zs = y, x, ys, xs, zs.T
        products = (
            self.table(y, ys, own, **options) * self.table(x, xs, column, **options)
            for own, column in zip(np.eye(len(ys)), zs.T, strict=True)
        )
        return sum(products, start=self._graph.const(0.0))

    def __getattr__(self, name: str) -> Callable[[Any], Node]:
        if name.startswith("__"):
            raise AttributeError(name)
        if name not in OF_ONE_ARGUMENT:
            known = [f"m.{function}" for function in (*OF_ONE_ARGUMENT, *OTHERS)]
            refuse(str(unknown("function", f"m.{name}", known)).rstrip("."), "write it with these functions")

        def function(x: Any) -> Node:
            return self._graph.call(name, self._graph.node(x))

        function.__qualname__ = f"m.{name}"  # as Python's messages call it
        return function


def _cubic(xs: NDArray[np.float64], ys: NDArray[np.float64]) -> NDArray[np.float64]:
    from scipy.interpolate import CubicSpline  # for those who have tables

    return CubicSpline(xs, ys).c.T


_PIECES: dict[str, Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]] = {
    "cubic": _cubic,
    "linear": lambda xs, ys: np.stack([np.diff(ys) / np.diff(xs), ys[:-1]], axis=1),
    "previous": lambda xs, ys: ys[:, np.newaxis],
}
"""Coefficients of a table's pieces, by its kind; see `problems.graph.nodes.Table`."""

OTHERS = ("atan2", "hypot", "min", "max", "where", "table", "sum", "each", "scatter", "dot", "array", "pi")
"""What else a formula finds in m."""


def call(
    function: Callable[..., Any],
    *,
    graph: Graph,
    dim: int,
    layout: Layout,
    label: str,
    second: str = "p",
    more: Mapping[str, Callable[[], Any]] | None = None,
) -> Any:
    """Run a user's function on symbols, with the arguments that it names.

    Parameters
    ----------
    function : callable
        Its arguments are among ``t, q, p, y, par, m`` (``q, p`` where the graph has a ``dof``).
    graph : Graph
        Where the operations are kept.
    dim : int
        Length of the state.
    layout : mapping
        Offset and length of each parameter in ``par``.
    label : str
        What the function is, for messages: ``"H"``, ``"invariant 'L'"``.
    second : {"p", "v"}
        What the second half of the state is called: momenta, or velocities in a Lagrangian.
    more : mapping of str to callable, optional
        Further arguments, and what makes their symbols.

    Raises
    ------
    problems.errors.InputError
        For an unknown argument, or anything that cannot be traced, with the line.
    """
    if not callable(function):
        raise InputError(f"{label} must be a function, not {shown(function)}.")
    if hasattr(function, "py_func"):
        raise InputError(
            f"{label} is compiled by numba, and formulas are traced; give its plain function, "
            f"{getattr(function, '__name__', 'f')}.py_func, or a compiled right-hand side as problems.Opaque."
        )
    offered: dict[str, Callable[[], Any]] = {
        "t": lambda: graph.symbol("t", 0, flags=T),
        "y": lambda: Vector(graph, "y", "y", 0, dim),
        "par": lambda: Parameters(graph, layout),
        "m": lambda: Mathematics(graph),
    }
    if graph.dof is not None:
        dof = graph.dof
        offered["q"] = lambda: Vector(graph, "q", "y", 0, dof)
        offered[second] = lambda: Vector(graph, second, "y", dof, dof)
        if second != "p":
            del offered["y"]
    offered |= more or {}
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        raise InputError(
            f"{label} must be a function whose arguments have names, not {shown(function)}; "
            "put it into one, as in lambda q: abs(q[0])."
        ) from None
    arguments: list[Any] = []
    named: dict[str, Any] = {}
    for parameter in parameters:
        if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
            continue
        if parameter.default is not parameter.empty:
            continue  # bound by the user, as in `lambda q, p, k=k: ...`
        if parameter.name in offered:
            value = offered[parameter.name]()
        else:
            remedy = (
                f"write par.{parameter.name}"
                if parameter.name in layout
                else "name those it needs among " + ", ".join(sorted(offered))
            )
            place = line_of_function(function)
            raise InputError(f"{place}: {label} asks for an argument {parameter.name!r}; {remedy}.")
        if parameter.kind is parameter.POSITIONAL_ONLY:
            arguments.append(value)
        else:
            named[parameter.name] = value
    graph.limit = int(min(limits.limit("OPERATIONS"), 2**62))
    try:
        result = function(*arguments, **named)
        if is_list(result):
            written = sum(not isinstance(part, Each) for _, part in components(result))
            place = f"{line_of_function(function)}: {label}"
            limits.check(place, "OPERATIONS", written, limits.WRITTEN_OUT)
        if not _same(result, function(*arguments, **named)):
            raise InputError(
                f"{line_of_function(function)}: {label} is another formula when it is called again; draw "
                "random numbers and count before, and give the values as parameters."
            )
        return result
    except InputError:
        raise
    except NameError as error:
        name = error.name or "?"
        if name in (*OF_ONE_ARGUMENT, *OTHERS, "math", "np", "numpy"):
            remedy = "declare the argument m and use m.sqrt, m.sin, m.cos, m.exp, m.log, m.abs, m.sum, m.pi"
        elif name in layout:
            remedy = f"declare the argument par and write par.{name}"
        elif name in offered:
            remedy = f"declare the argument {name}"
        else:
            remedy = f"make it a parameter, parameters={{{name!r}: value}}, and write par.{name}"
        raise InputError(
            f"{line_of_traceback(error.__traceback__)}: the name {name!r} is not known here; {remedy}."
        ) from error
    except Exception as error:
        line = line_of_traceback(error.__traceback__) or line_of_function(function)
        if type(error).__module__.partition(".")[0] == "numba":
            raise InputError(
                f"{line_of_function(function)}: {label} calls a function that numba has compiled, and "
                "formulas are traced; call its plain function, as in f.py_func(q, p)."
            ) from error
        raise InputError(f"{line}: {label} failed with {type(error).__name__}: {error}") from error
    finally:
        graph.limit = None


def _same(first: Any, second: Any) -> bool:
    """Whether two calls returned the same formulas: equal operations are one node."""
    if isinstance(first, Node) or isinstance(second, Node):
        return first is second
    if is_list(first) and is_list(second):
        return len(first) == len(second) and all(map(_same, first, second))
    if isinstance(first, Mapping) and isinstance(second, Mapping):
        return first.keys() == second.keys() and all(_same(first[key], second[key]) for key in first)
    if isinstance(first, numbers.Real) and isinstance(second, numbers.Real):
        return first == second or (first != first and second != second)
    return type(first) is type(second)


def scalar(value: Any, *, graph: Graph, function: Callable[..., Any], label: str) -> Node:
    """Return what a function returned as one node, or raise when it is not one number."""
    if value is None:
        wrong = "nothing; end it with a return statement"
    elif is_list(value) or isinstance(value, dict) or getattr(value, "shape", ()) != ():
        wrong = f"{len(value)} values, not one number; return one scalar, such as the sum of its terms"
    else:
        try:
            node = graph.node(value)
            if node.loop is None:
                return node
            wrong = "a symbol of an m.sum's term; return the sum itself"
        except InputError:
            wrong = f"{value!r}, which is not a number"
    raise InputError(f"{line_of_function(function)}: {label} returns {wrong}.")
