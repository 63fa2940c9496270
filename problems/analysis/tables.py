"""Tables of the time that end before the integration does."""

import numpy as np
from numpy.typing import NDArray

from problems.analysis.switches import affine_pieces
from problems.derive.function import function_of
from problems.errors import InputError
from problems.evaluate.pairs import evaluate
from problems.graph.nodes import STATE, T, reachable
from problems.systems.base import System

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
    nodes = reachable(system.field.roots) if system.field is not None else []
    tables = [
        node
        for node in nodes
        if node.op == "table" and not node.data.extrapolate and node.args[0].flags & (T | STATE) == T
    ]
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


def states_beyond(
    system: System, par: NDArray[np.float64], t: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[float, float, float, float] | None:
    """Return the first of some states at which a table of the state has no data.

    Parameters
    ----------
    system : System
        Whose field is looked at; tables inside of loops are not.
    par : ndarray, shape (n_par,) or (n_par, n)
        Parameters.
    t, y : ndarray, shapes (n,), (n, dim)
        Times and states.

    Returns
    -------
    tuple of float or None
        Its time, the argument there, and the ends of the data.
    """
    nodes = reachable(system.field.roots) if system.field is not None else []
    tables = [
        node
        for node in nodes
        if node.op == "table"
        and not node.data.extrapolate
        and node.args[0].flags & STATE
        and node.args[0].loop is None
    ]
    if not tables:
        return None
    arguments = function_of(tables[0].graph, [node.args[0] for node in tables])
    found = []
    for node, values in zip(tables, evaluate(arguments, t, np.ascontiguousarray(y.T), par), strict=True):
        first, last = node.data.knots[0], node.data.knots[-1]
        x = values.rounded()
        outside = np.flatnonzero((x < first) | (x > last))
        if outside.size:
            i = int(outside[0])
            found.append((float(t[i]), float(x[i]), first, last))
    return min(found, default=None)
