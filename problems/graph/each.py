"""Arrays of values: one formula for all components, sums of pair terms, products with matrices.

They are what a vector field of many components returns, and what further loops read. Each is filled by loops
that stay loops in the generated code; see `problems.graph.loops.Stage`.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from problems import limits
from problems.errors import shown
from problems.graph.loops import Affine, Loop, Summands
from problems.graph.nodes import Graph, Node
from problems.graph.source_line import refuse, users_line
from problems.graph.sums import Index, Ragged, declare, listed, rows_of, scope


class Each:
    """Values side by side that loops calculate; read like a tuple, by integers or by indices of loops."""

    def __init__(
        self, graph: Graph, size: int, loops: Summands, terms: tuple[tuple[int, Node], ...] = ()
    ) -> None:
        self._graph, self._size = graph, size
        self.loops, self.terms = loops, terms

    def __repr__(self) -> str:
        return f"<{self._size} values>"

    def __len__(self) -> int:
        return self._size

    def __iter__(self) -> Iterator[Node]:
        return (self[i] for i in range(self._size))

    def __getitem__(self, i: Any) -> Any:
        if isinstance(i, slice):
            return [self[k] for k in range(self._size)[i]]
        place, loop = place_of(i, self._size, "this array")
        return self._graph.element(self._graph.stage(self._size, self.loops, self.terms), place, loop)

    def _whole(self, *_: Any, **__: Any) -> NoReturn:
        refuse(
            "this calculates with all values of m.each, m.scatter or m.dot at once",
            "write it inside the term, as in m.each(lambda i: a[i] + m.sin(y[i]), range(n))",
        )

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = _whole
    __pow__ = __neg__ = __matmul__ = __rmatmul__ = __abs__ = __array__ = __array_ufunc__ = _whole
    __float__ = __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = _whole  # type: ignore[assignment]
    __hash__ = object.__hash__


def place_of(i: Any, size: int, name: str) -> tuple[Any, Loop | None]:
    """Return where an index points to in so many values, a `Place`, and the loop that it varies in."""
    if isinstance(i, Index):
        places = i.affine.values(i.loop)
        for place in (int(places.min()), int(places.max())):
            if not 0 <= place < size:
                refuse(f"{name}[{place}] does not exist", f"{name} has the indices 0 to {size - 1}")
        if not any(i.affine.coefficients):
            return i.affine.offset, None
        return i.affine, i.loop
    if isinstance(i, Node):
        refuse(f"{name}[...] is indexed by a symbol", "use integers, or the indices of a loop")
    try:
        k = i.__index__()
    except AttributeError:
        refuse(f"{name}[{i!r}] is not an index", "use integers")
    if not -size <= k < size:
        refuse(f"{name}[{k}] does not exist", f"{name} has the indices 0 to {size - 1}")
    return k % size, None


class Constants:
    """An array of numbers that loops may read: ``m.array(K)[i, j]``."""

    def __init__(self, graph: Graph, values: NDArray[np.float64]) -> None:
        self._graph, self.values = graph, values
        self.shape = values.shape

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, indices: Any) -> Node:
        place, loop = place_of(flat_index(indices, self.shape, "this array"), self.values.size, "this array")
        return self._graph.entry(self._graph.constants(self.values.ravel()), place, loop)


def flat_index(indices: Any, shape: Sequence[int], name: str) -> Any:
    """Return the place in the flat list of ``name[i, j, ...]``, row by row."""
    given = indices if isinstance(indices, tuple) else (indices,)
    if len(given) != len(shape):
        refuse(
            f"{name} has {len(shape)} dimensions and not {len(given)}", f"index it by {len(shape)} integers"
        )
    place: Any = 0
    for i, size in zip(given, shape, strict=True):
        inside, loop = place_of(i, size, name)
        place = place * size + (i if loop is not None else inside)
    return place


def constants(graph: Graph, values: Any) -> Constants:
    """Return an array of finite numbers that loops may read."""
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.array(np.nan)
    if array.size == 0 or not np.isfinite(array).all():
        refuse(f"m.array takes {shown(values)}", "give an array of finite numbers")
    return Constants(graph, array)


def each(graph: Graph, term: Callable[..., Any], index: Iterable[Any]) -> Each:
    """Return ``[term(i) for i in index]``, as one loop; of terms that are lists, one list after the other.

    Parameters
    ----------
    graph : Graph
        The graph being traced.
    term : callable
        Called once, with symbolic integers; returns a number, or as many for each term.
    index : iterable
        Integers, or tuples of them; some of a tuple may be lists of integers that `m.sum` runs over, as in
        ``enumerate(neighbours)``.

    Raises
    ------
    problems.errors.InputError
        For anything else, or inside of another loop.
    """
    if not callable(term):
        refuse("the first argument of m.each is not a function", "write m.each(lambda i: -y[i], range(n))")
    if graph.scopes:
        refuse(
            "an m.each stands inside the term of a loop", "make it before, and read its values by an index"
        )
    rows, ragged = _columns(index)
    if len(rows) == 0:
        return Each(graph, 0, ())
    width = rows.shape[1]
    loop = graph.loop(rows)
    if loop.count is None:
        loop = graph.loop(np.hstack([rows, np.arange(len(rows))[:, np.newaxis]]))
    count = loop.count
    assert count is not None
    indices = iter(listed(graph, loop.rows, range(width)))
    given = [Ragged(loop, lists) if lists is not None else next(indices) for lists in ragged]
    with scope(graph, loop):
        values = term(*given)
        components = list(values) if isinstance(values, list | tuple) else [values]
        nodes = [graph.lifted_to(graph.node(value), loop) for value in components]
    n = len(nodes)
    entries = tuple((count.times(n).shifted(k), node) for k, node in enumerate(nodes))
    return Each(graph, n * len(rows), ((loop, entries),))


def _columns(index: Iterable[Any]) -> tuple[NDArray[np.int64], list[list[NDArray[np.int64]] | None]]:
    """Return the integers of an index list as rows, and for each of its columns the lists, or ``None``."""
    if isinstance(index, range | np.ndarray):
        rows = rows_of(index, "m.each")
        return rows, [None] * rows.shape[1]
    rows_given = list(index)
    first = rows_given[0] if rows_given else ()
    if not isinstance(first, tuple) or not any(_is_list(value) for value in first):
        rows = rows_of(rows_given, "m.each")
        return rows, [None] * rows.shape[1]
    columns: list[list[NDArray[np.int64]] | None] = []
    plain: list[tuple[int, ...]] = []
    for row in rows_given:
        if not isinstance(row, tuple) or [_is_list(v) for v in row] != [_is_list(v) for v in first]:
            refuse(
                "the index of m.each has tuples of different kinds", "give each as many integers and lists"
            )
        plain.append(tuple(v for v in row if not _is_list(v)))
    if not plain[0]:
        refuse("the index of m.each has lists only", "number them, as enumerate does")
    for place, value in enumerate(first):
        columns.append([rows_of(row[place], "m.sum") for row in rows_given] if _is_list(value) else None)
    for lists in columns:
        widths = {each.shape[1] for each in lists or () if len(each)} or {1}
        if len(widths) > 1:
            refuse("the lists in the index of m.each have tuples of different lengths", "make them equal")
        for k, each in enumerate(lists or ()):
            if len(each) == 0 and lists is not None:
                lists[k] = np.zeros((0, *widths), dtype=np.int64)
    return rows_of(plain, "m.each"), columns


def _is_list(value: Any) -> bool:
    return isinstance(value, list | tuple | range | np.ndarray) and np.ndim(value) > 0  # type: ignore[arg-type]


def scatter(graph: Graph, term: Callable[..., Any], index: Iterable[Any], n: int) -> Each:
    """Return n sums, to which each term adds at the places that it names: ``{i: force, j: -force}``.

    Parameters
    ----------
    graph : Graph
        The graph being traced.
    term : callable
        Called once, with symbolic integers; returns a dictionary from indices to numbers.
    index : iterable of int, or of tuples of int
        The terms, in the order in which they are added.
    n : int
        Number of sums.
    """
    if not callable(term) or graph.scopes:
        refuse("m.scatter is not called with a function, outside of other loops", _PAIRS)
    rows = rows_of(index, "m.scatter")
    if len(rows) == 0:
        return Each(graph, n, ())
    indices = listed(graph, rows)
    loop = indices[0].loop
    with scope(graph, loop):
        values = term(*indices)
        if not isinstance(values, Mapping) or not values:
            refuse("the term of m.scatter returns no dictionary", _PAIRS)
        entries = []
        for key, value in values.items():
            place, _ = place_of(key, n, "the list of sums")
            affine = place if isinstance(place, Affine) else Affine((0,) * loop.width, place)
            entries.append((affine, graph.lifted_to(graph.node(value), loop)))
    return Each(graph, n, ((loop, tuple(entries)),))


_PAIRS = "write m.scatter(lambda i, j: {i: force, j: -force}, pairs, n)"


def dot(graph: Graph, matrix: Any, vector: Any) -> Any:
    """Return a matrix times a vector: its rows are summed up in the order of the columns.

    Parameters
    ----------
    graph : Graph
        The graph being traced.
    matrix
        Constants, dense or sparse (SciPy's), a parameter of two dimensions, or a vector: then one number.
    vector
        Values that loops may read, or a list of numbers.
    """
    vector = readable(graph, vector)
    if not hasattr(matrix, "shape"):
        left = readable(graph, matrix)
        _fits(len(left), vector)
        return declare(graph, lambda j: left[j] * vector[j], range(len(vector)))
    if graph.scopes:
        refuse(
            "m.dot with a matrix stands inside the term of a loop", "use m.sum, with the indices of m.array"
        )
    rows, columns = matrix.shape if len(matrix.shape) == 2 else (0, -1)
    _fits(columns, vector)
    if hasattr(matrix, "tocsr"):
        sparse = matrix.tocsr().sorted_indices()
        limits.check(f"{users_line()}: this", "TERMS", sparse.nnz)
        values = constants(graph, sparse.data if sparse.nnz else [0.0])
        i = np.repeat(np.arange(rows), np.diff(sparse.indptr))
        index = np.stack([i, sparse.indices, np.arange(sparse.nnz)], axis=1)
        return scatter(graph, lambda i, j, k: {i: values[k] * vector[j]}, index, rows)
    values = constants(graph, matrix) if isinstance(matrix, np.ndarray) else matrix  # a parameter
    limits.check(f"{users_line()}: this", "TERMS", rows * columns)
    index = np.indices((rows, columns)).reshape(2, -1).T
    return scatter(graph, lambda i, j: {i: values[i, j] * vector[j]}, index, rows)


def _fits(columns: int, vector: Any) -> None:
    if columns != len(vector):
        refuse(
            f"m.dot takes {columns} columns and a vector of {len(vector)} numbers",
            "give a matrix with as many columns",
        )


def readable(graph: Graph, values: Any) -> Any:
    """Return values that loops may read by an index."""
    if hasattr(values, "vector"):  # of a slice
        return values.vector
    if isinstance(values, list | tuple):
        return Each(graph, len(values), (), tuple((i, graph.node(value)) for i, value in enumerate(values)))
    if isinstance(values, np.ndarray):
        return constants(graph, values)
    if not hasattr(values, "__len__"):
        refuse(f"m.dot takes {shown(values)}", "give a matrix and a vector")
    return values


def components(value: Any) -> Iterator[tuple[int, Any]]:
    """Yield what a list is made of, numbers and arrays of them, with the place where each begins."""
    at = 0
    for part in [value] if isinstance(value, Each) else value:
        yield at, part
        at += len(part) if isinstance(part, Each) else 1


def length(value: Any) -> int:
    """Return how many numbers a list is, those of arrays in it too."""
    return sum(len(part) if isinstance(part, Each) else 1 for _, part in components(value))
