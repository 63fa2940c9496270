"""Tables whose data end before the integration does, or before the states that it reaches."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from problems.analysis.switches import affine_pieces
from problems.errors import InputError
from problems.evaluate.doubles import DOUBLES
from problems.evaluate.evaluator import Evaluator
from problems.graph.nodes import STATE, Node, T, reachable
from problems.systems.base import System

Beyond = tuple[float, float, float, float]
"""A time, the argument of a table there, and the ends of its data."""

_ROUNDING = 2.0**-48  # of the largest knot: so far an argument that is calculated may be beyond the last one


def check_tables(system: System, par: NDArray[np.float64], t0: float, t1: float) -> None:
    """Refuse an integration to times at which a table of the time has no data.

    Only arguments that are affine in time are looked at, such as ``t/par.T``; those that come back, as with
    ``m.floor``, stay inside by themselves.

    Raises
    ------
    problems.errors.InputError
        With the interval of the table and that of its argument.
    """
    kept = vars(system)
    if (tables := kept.get("_tables_of_time")) is None:
        tables = kept["_tables_of_time"] = _tables_of_time(system)
    for node in tables:
        pieces = affine_pieces(node.args[0], par)
        if pieces is None or len(pieces) != 1:
            continue
        slope, offset = pieces[0]
        reached = [slope * t0 + offset, slope * t1 + offset]
        low, high = float(np.min(reached)), float(np.max(reached))
        first, last = node.data.knots[0], node.data.knots[-1]
        room = _ROUNDING * max(abs(first), abs(last))
        if low < first - room or high > last + room:
            raise InputError(
                f"m.table has data from {first!r} to {last!r}, and from t = {t0!r} to {t1!r} its argument is "
                f"{low!r} to {high!r}; end earlier, give more points, or m.table(..., extrapolate=True)."
            )


def _tables_of_time(system: System) -> list[Node]:
    """Return the tables of a system's field that end, and whose arguments depend on the time alone."""
    nodes = reachable(system.field.roots) if system.field is not None else []
    return [node for node in nodes if _ends(node) and node.args[0].flags & (T | STATE) == T]


def states_beyond(
    system: System, par: NDArray[np.float64], t: NDArray[np.float64], y: NDArray[np.float64]
) -> list[Beyond | None]:
    """Return at which states a table has no data; ``None`` for the others.

    Parameters
    ----------
    system : System
        Whose field is looked at.
    par : ndarray, shape (n_par,) or (n_par, n)
        Parameters.
    t, y : ndarray, shapes (n,), (n, dim)
        Times and states; those that are not finite are not looked at.

    Returns
    -------
    list of tuple
        For each state its time, the argument there, and the ends of the data.
    """
    n = len(t)
    if system.field is None or not any(_ends(node) for node in reachable(system.field.roots)):
        return [None] * n
    looks = _Looks(DOUBLES, t[np.newaxis], y.T, par if par.ndim == 2 else par[:, np.newaxis], n)
    looks.outputs(system.field)
    finite = np.logical_and.reduce(np.isfinite(y), axis=1)
    return [(float(t[i]), *looks.found[i]) if finite[i] and i in looks.found else None for i in range(n)]


def _ends(node: Node) -> bool:
    return node.op == "table" and not node.data.extrapolate


class _Looks(Evaluator):
    """Evaluates a field and records the arguments at which tables have no data, by the state's number."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.found: dict[int, tuple[float, float, float]] = {}

    def visit_operation(self, node: Node, *args: Any) -> Any:
        if _ends(node):
            first, last = node.data.knots[0], node.data.knots[-1]
            room = _ROUNDING * max(abs(first), abs(last))
            x = np.asarray(args[0], dtype=np.float64)
            outside = np.asarray((x < first - room) | (x > last + room))
            if outside.any():
                x, outside = (np.broadcast_to(a, (*x.shape[:-1], self._n)) for a in (x, outside))
                for *term, i in np.argwhere(outside).tolist():
                    self.found.setdefault(i, (float(x[(*term, i)]), first, last))
        return super().visit_operation(node, *args)
