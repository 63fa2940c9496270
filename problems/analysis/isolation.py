"""All times at which a function of the time alone changes its sign, by bisection with interval arithmetic."""

import numpy as np
from numpy.typing import NDArray

from problems.analysis.ranges import RANGES, Range
from problems.analysis.roundoff import ROUNDING
from problems.analysis.sizes import size_in_time
from problems.derive.forward import Slopes
from problems.evaluate.evaluator import Evaluator
from problems.graph.fold import Copy
from problems.graph.nodes import Graph, Node, T, reachable

Array = NDArray[np.float64]

MOST = 1 << 16  # intervals that are looked at side by side
SMALLEST = 2.0**-44  # of the largest time: no shorter interval is divided
ITERATIONS = 200  # of a root finder that bisects where it must


class TooMany(Exception):  # noqa: N818 -- no error: shorter intervals are to be looked at
    """More intervals than `MOST` may have a zero."""


class TimeFunction:
    """A function of the time and of parameters, its derivative in time and the size of its terms.

    Parameters
    ----------
    node : Node
        In a loop, a function for each of its terms.
    """

    def __init__(self, node: Node):
        values = Copy(Graph(node.graph.dof))
        slope = _InTime(values).of(node)
        value = values.of(node)
        self._roots = [value, values.graph.const(0.0) if slope is None else slope]
        self._terms = size_in_time(value)

    def zeros(self, par: Array, pieces: Array, *, exhaust: bool) -> tuple[Array, Array]:
        """Return the times at which the sign changes, of each term of a loop.

        Where an interval stays undecided, as where rounding alone makes the values, only the signs at its
        ends are known.

        Parameters
        ----------
        par : ndarray, shape (n_par,)
            Parameters.
        pieces : ndarray, shape (n,)
            Times, ascending, between which no choice inside the function changes: they are its kinks.
        exhaust : bool
            Whether to go on with what is known at the ends where there are too many intervals.

        Returns
        -------
        times : ndarray, shape (n,)
        resolutions : ndarray, shape (n,)
            How far from each of them rounding may have the sign change: by the terms that are summed and
            the slope. What is added inside the argument of another function is not among them.

        Raises
        ------
        TooMany
            If there are too many intervals, and ``exhaust`` is not set.
        """
        loop = self._roots[0].loop
        terms = range(1 if loop is None else len(loop))
        found = [self._of_term(par, term, pieces, exhaust) for term in terms]
        times, resolutions = (np.concatenate(each) for each in zip(*found, strict=True))
        return times, resolutions

    def _of_term(self, par: Array, term: int, pieces: Array, exhaust: bool) -> tuple[Array, Array]:
        a, b = pieces[:-1], pieces[1:]
        found = []
        with np.errstate(all="ignore"):
            while a.size:
                middle = 0.5 * (a + b)
                value, slope = self._ranges(self._roots, par, term, Range(a, b, middle))
                # At a pole the slope is infinite, and the function may fall while it is positive.
                finite = np.isfinite(slope.low) & np.isfinite(slope.high)
                monotonic = finite & ((slope.low >= 0.0) | (slope.high <= 0.0))
                half = 0.5 * (b - a)
                change = half * np.maximum(np.abs(slope.low), np.abs(slope.high))  # the mean value theorem
                low = np.fmax(value.low, value.middle - change)
                high = np.fmin(value.high, value.middle + change)
                one_sign = (low > 0.0) | (high <= 0.0)
                small = b - a <= SMALLEST * np.maximum(np.abs(a), np.abs(b))
                ends = ~one_sign & (monotonic | small)
                divide = ~one_sign & ~ends
                if 2 * np.count_nonzero(divide) > MOST:
                    if not exhaust:
                        raise TooMany
                    ends, divide = ends | divide, np.zeros_like(divide)
                found.append((a[ends], b[ends]))
                a, b = (
                    np.concatenate([a[divide], middle[divide]]),
                    np.concatenate([middle[divide], b[divide]]),
                )
            return self._solved(par, term, *(np.concatenate(each) for each in zip(*found, strict=True)))

    def _solved(self, par: Array, term: int, a: Array, b: Array) -> tuple[Array, Array]:
        """Return what `zeros` does, of those intervals whose ends have different signs."""
        side = 0.5 * (a + b)

        def value(t: Array, side: Array) -> Array:
            return self._ranges(self._roots, par, term, Range(t, t, side))[0].low

        change = (value(a, side) > 0.0) != (value(b, side) > 0.0)
        a, b, side = a[change], b[change], side[change]
        if not a.size:
            return a, b
        from scipy.optimize.elementwise import (
            find_root,  # few conditions need it, every process would load it
        )

        tolerances = {"xrtol": 2.0**-52, "xatol": 0.0, "fatol": 0.0, "frtol": 0.0}
        times = find_root(value, (a, b), args=(side,), tolerances=tolerances, maxiter=ITERATIONS).x
        roots = [self._roots[1], self._terms]
        slope, terms = (each.low for each in self._ranges(roots, par, term, Range(times, times, side)))
        return times, np.fmin(ROUNDING * np.abs(terms / slope), b - a)

    def _ranges(self, roots: list[Node], par: Array, term: int, t: Range) -> list[Range]:
        evaluator = _Evaluator(RANGES, t[np.newaxis], None, Range.of(par[:, np.newaxis]), t.low.size)
        return [rows[term] for rows in evaluator.rows(roots)]


class _Evaluator(Evaluator):
    def rows(self, roots: list[Node]) -> list[Range]:
        """Return the values of nodes, one row for each term of the loop that they are in."""
        for node in reachable(roots):
            if node.loop is None:
                self.known[node.id] = self.visit(node, [self.known[arg.id] for arg in node.reads])
        loops = [root.loop for root in roots if root.loop is not None]
        if loops:
            return self._inside(roots, loops[0])
        return [self._numbers.rows(self.known[root.id], 1, self._n) for root in roots]


class _InTime(Slopes):
    """Derivatives with respect to the time."""

    def __init__(self, values: Copy):
        super().__init__(values, T)

    def visit_symbol(self, node: Node) -> Node:
        return self.graph.const(1.0)
