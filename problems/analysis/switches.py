"""The times at which a traced vector field switches: they may depend on parameters."""

from collections.abc import Sequence
from functools import cached_property
from itertools import product
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from problems.analysis.isolation import MOST, TimeFunction, TooMany
from problems.analysis.structure import WITHOUT_END, has_kink
from problems.evaluate.doubles import DOUBLES
from problems.graph.fold import Fold
from problems.graph.nodes import PAR, STATE, Affine, Node, T, reachable
from problems.systems.base import System

Pieces = list[tuple[Any, Any]]
"""What a node may be as a function of time: slope and offset of each of its affine pieces.

Numbers, or arrays of one number per term inside a declared sum.
"""

SHORTER, SHORTENED = 2.0**-6, 4  # an interval with too many switches, and how often
MOST_PIECES = 16  # of a node: nested choices beyond that are not solved for


class Switches:
    """The times at which conditions, absolute values and tables of a traced field switch.

    Those of anything affine in time, with parameters at will, are solved for: ``m.where(t > par.c, ...)``,
    ``m.abs(2*t - par.c)``, ``m.table(t/par.T, xs, ys)``; also where absolute values and choices of such
    terms are compared, as in ``m.where(m.abs(t - 3) < par.w, ...)``. Those of other functions of the time,
    as ``m.where(m.cos(w*t) > par.c, ...)``, are isolated, see `problems.analysis.isolation`.

    Parameters
    ----------
    system : System
        Of one that is not traced nothing is known.

    Attributes
    ----------
    any : bool
        Whether there may be such times.
    """

    def __init__(self, system: System):
        nodes = reachable(system.field.roots) if system.field is not None else []
        self._nodes = [
            node
            for node in nodes
            if (has_kink(node) or node.op == "table") and node.args[0].flags & (T | STATE) == T
        ]
        self.any = bool(self._nodes)
        self._functions: dict[tuple[int, int], TimeFunction] = {}

    @cached_property
    def _fixed(self) -> NDArray[np.float64] | None:
        """The times, where they are a few that no parameter moves."""
        if any(node.args[0].flags & PAR for node in self._nodes):
            return None
        return self._few(np.empty(0))

    def times(
        self, par: NDArray[np.float64], near: float, far: float
    ) -> tuple[NDArray[np.float64], dict[float, float], float, float]:
        """Return the times at which the field switches with these parameters, ascending.

        Parameters
        ----------
        par : ndarray, shape (n_par,)
            Parameters.
        near, far : float
            The interval that is asked for; either may be the larger.

        Returns
        -------
        times : ndarray, shape (n,)
            Finite, and at least those of the interval.
        resolutions : dict of float to float
            Of those that were isolated: how far from the time rounding may have the field switch.
        near, far : float
            Where they are all known: less than asked for where there are too many, everywhere where they
            are a few.
        """
        few = self._few(par) if self._fixed is None else self._fixed
        if few is not None:
            sign = np.copysign(1.0, far - near)
            return few, {}, -sign * np.inf, sign * np.inf
        reach = far - near
        for _ in range(SHORTENED):
            try:
                return *self._isolated(par, near, near + reach, exhaust=False), near, near + reach
            except TooMany:
                reach *= SHORTER
        return *self._isolated(par, near, far, exhaust=True), near, far

    def moved(self, before: NDArray[np.float64], after: NDArray[np.float64]) -> bool:
        """Whether the times differ with other parameters, or may."""
        if self._fixed is not None or np.array_equal(before, after):
            return False
        old, new = self._few(before), self._few(after)
        if old is None or new is None:
            return any(node.args[0].flags & PAR for node in self._nodes)
        return not np.array_equal(old, new)

    def _few(self, par: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return all of the times where they are known as a list."""
        pieces = _Evaluation(par).of
        crossings = [np.empty(0)]
        for node in self._nodes:
            found = None if node.op in WITHOUT_END else pieces(node.args[0])
            if found is None:
                return None
            crossings.append(_crossings(found, _levels(node)))
        return _sorted(crossings)

    def _isolated(
        self, par: NDArray[np.float64], near: float, far: float, *, exhaust: bool
    ) -> tuple[NDArray[np.float64], dict[float, float]]:
        """Return the times in an interval, and their resolutions."""
        resolutions: dict[float, float] = {}
        low, high = min(near, far), max(near, far)
        pieces = _Evaluation(par).of
        known = np.array([low, high])
        for node in self._nodes:  # what is chosen inside a condition comes before it
            affine = pieces(node.args[0])
            if affine is None:
                found = []
                for i in range(len(node.data.knots) if node.op == "table" else 1):
                    zeros, near_them = self._function(node, i).zeros(par, known, exhaust=exhaust)
                    resolutions.update(zip(zeros.tolist(), near_them.tolist(), strict=True))
                    found.append(zeros)
            elif node.op in WITHOUT_END:
                found = [_repeated(piece, low, high, 0.5 * (node.op == "round")) for piece in affine]
            else:
                found = [_crossings(affine, _levels(node))]
            times = _sorted(found)
            known = np.union1d(known, times[(times > low) & (times < high)])
        return known[1:-1], resolutions

    def _function(self, node: Node, i: int) -> TimeFunction:
        """Return a function that changes its sign where a node switches: at its knot i, if it has some."""
        place = (node.id, i)
        if place not in self._functions:
            x = node.args[0]
            if node.op in WITHOUT_END:
                x = x.graph.call("cos" if node.op == "round" else "sin", pi * x)
            self._functions[place] = TimeFunction(x - node.data.knots[i] if node.op == "table" else x)
        return self._functions[place]


def _levels(node: Node) -> NDArray[np.float64]:
    """Return the arguments at which a node switches."""
    return np.array(node.data.knots if node.op == "table" else [0.0])


def _crossings(pieces: Pieces, levels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the times at which pieces have certain values."""
    found = []
    for slope, offset in pieces:
        slope, offset = np.broadcast_arrays(np.atleast_1d(slope), offset)
        with np.errstate(all="ignore"):
            found.append(((levels[:, None] - offset) / slope).ravel())
    return np.concatenate(found)


def _repeated(piece: tuple[Any, Any], low: float, high: float, shift: float) -> NDArray[np.float64]:
    """Return the times in an interval at which a piece is a whole number plus ``shift``."""
    found = [np.empty(0)]
    for slope, offset in zip(*map(np.ravel, np.broadcast_arrays(*piece)), strict=True):
        ends = np.sort([slope * low + offset - shift, slope * high + offset - shift])
        if not slope or not np.isfinite(ends).all():
            continue
        if ends[1] - ends[0] > MOST:
            raise TooMany
        found.append((np.arange(np.floor(ends[0]), np.ceil(ends[1]) + 1.0) + shift - offset) / slope)
    return np.concatenate(found)


def _sorted(times: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    joined = np.concatenate(times)
    return np.unique(joined[np.isfinite(joined)]) + 0.0  # no negative zero


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
