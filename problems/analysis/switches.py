"""The times at which a traced vector field switches: they may depend on parameters."""

from collections.abc import Sequence
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from problems.analysis.structure import WITHOUT_END, has_kink
from problems.evaluate.doubles import DOUBLES
from problems.systems.base import System
from problems.trace.fold import Fold
from problems.trace.graph import PAR, STATE, Affine, Node, T, reachable

Pieces = list[tuple[Any, Any]]
"""What a node may be as a function of time: slope and offset of each of its affine pieces.

Numbers, or arrays of one number per term inside a declared sum.
"""

MOST_PIECES = 16  # of a node: nested choices beyond that are not solved for


class Switches:
    """The times at which conditions, absolute values and tables of a traced field switch.

    Solved for are those of anything affine in time, with parameters at will: ``m.where(t > par.c, ...)``,
    ``m.abs(2*t - par.c)``, ``m.table(t/par.T, xs, ys)``; also where absolute values and choices
    of such terms are compared, as in ``m.where(m.abs(t - 3) < par.w, ...)``.

    Parameters
    ----------
    system : System
        Of one that is not traced nothing is known.
    """

    def __init__(self, system: System):
        nodes = reachable(system.field.roots) if system.field is not None else []
        self._nodes = [
            node
            for node in nodes
            if (has_kink(node) or node.op == "table")
            and node.args[0].flags & (T | STATE) == T
            and node.op not in WITHOUT_END  # see `problems.analysis.sides`
        ]

    @cached_property
    def _fixed(self) -> NDArray[np.float64] | None:
        """The times, where no parameter moves them."""
        if any(node.args[0].flags & PAR for node in self._nodes):
            return None
        return self._solved(np.empty(0))

    @property
    def any(self) -> bool:
        """Whether there may be such times."""
        return bool(self._nodes)

    def times(self, par: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the finite times at which the field switches with these parameters, ascending."""
        return self._solved(par) if self._fixed is None else self._fixed

    def _solved(self, par: NDArray[np.float64]) -> NDArray[np.float64]:
        pieces = _Evaluation(par).of
        crossings = [np.empty(0)]
        for node in self._nodes:
            levels = np.array(node.data.knots if node.op == "table" else [0.0])
            for slope, offset in pieces(node.args[0]) or ():
                slope, offset = np.broadcast_arrays(np.atleast_1d(slope), offset)
                with np.errstate(all="ignore"):
                    crossings.append(((levels[:, None] - offset) / slope).ravel())
        times = np.concatenate(crossings)
        return np.unique(times[np.isfinite(times)]) + 0.0  # no negative zero


def depends_on_time_between_switches(system: System) -> bool:
    """Whether the field depends on the time other than by conditions whose switching times are solved for.

    If it does not, as with ``m.where(t > 5, 0, 2)``, it is autonomous from one of those times to the next.
    """
    unknown = np.full(system.n_par, np.nan)
    pending, seen = list((system.energy or system.function("field")).roots), set[int]()
    while pending:
        node = pending.pop()
        if node.id in seen or not node.flags & T:
            continue
        seen.add(node.id)
        if node.op == "symbol":
            return True
        args = node.args
        if node.op in ("where", "sign") and args[0].flags & (T | STATE) == T:
            args = args[1:] if affine_pieces(args[0], unknown) is not None else args
        pending += args
    return False


def affine_pieces(node: Node, par: NDArray[np.float64]) -> Pieces | None:
    """Return a node's affine pieces as a function of time; ``None`` where it is not made of a few."""
    return _Evaluation(par).of(node)


class _Evaluation(Fold[Pieces | None]):
    """The affine pieces of nodes, with given parameters; ``None`` where they are not made of a few."""

    def __init__(self, par: NDArray[np.float64]):
        super().__init__()
        self._par = par

    def visit(self, node: Node, results: Sequence[Pieces | None]) -> Pieces | None:
        with np.errstate(all="ignore"):
            return super().visit(node, results)

    def visit_const(self, node: Node) -> Pieces:
        return [(0.0, node.data)]

    def visit_index(self, node: Node) -> Pieces:
        assert node.loop is not None
        return [(0.0, node.data.values(node.loop).astype(np.float64))]

    def visit_entry(self, node: Node) -> Pieces:
        constants, place = node.data
        return [(0.0, constants.values[place.values(node.loop)])]

    def visit_element(self, node: Node, *_: Pieces | None) -> None:
        return None

    def visit_symbol(self, node: Node) -> Pieces:
        space, place = node.data
        if space == "t":
            return [(1.0, 0.0)]
        if isinstance(place, Affine):
            assert node.loop is not None
            return [(0.0, self._par[place.values(node.loop)])]
        return [(0.0, float(self._par[place]))]

    def visit_where(
        self, node: Node, condition: Pieces | None, a: Pieces | None, b: Pieces | None
    ) -> Pieces | None:
        if a is None or b is None:
            return None
        if node.args[0].flags & T == 0 and condition is not None and np.ndim(condition[0][1]) == 0:
            return a if condition[0][1] > 0.0 else b
        return a + b if len(a) + len(b) <= MOST_PIECES else None

    def visit_operation(self, node: Node, *args: Pieces | None) -> Pieces | None:
        combined = []
        for chosen in product(*(arg or () for arg in args)):
            applied = _applied(node, chosen)
            if applied is None:
                return None
            combined += applied
        return combined if 0 < len(combined) <= MOST_PIECES else None


def _applied(node: Node, args: Sequence[tuple[Any, Any]]) -> Pieces | None:
    """Return the pieces of an operation on one piece of each argument; ``None`` where it is not affine."""
    (a, b), (c, d) = args[0], args[-1]
    moving = [bool(np.any(slope != 0.0)) for slope, _ in args]
    match node.op:
        case "add":
            return [(a + c, b + d)]
        case "sub":
            return [(a - c, b - d)]
        case "neg":
            return [(-a, -b)]
        case "sum":
            return [tuple(np.sum(np.broadcast_to(x, len(node.data))) for x in (a, b))]
        case "mul" if not all(moving):
            return [(a * d + c * b, b * d)]
        case "div" if not moving[1]:
            return [(a / d, b / d)]
        case "abs" if moving[0]:
            return [(a, b), (-a, -b)]
        case "sign" if moving[0]:
            return [(0.0, 1.0), (0.0, -1.0)]
    return None if any(moving) else [(0.0, DOUBLES.value(node, *(value for _, value in args)))]
