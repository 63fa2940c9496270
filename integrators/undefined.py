"""Where a field is not a number, for the reason of a run that ended there: the same for every method."""

import math

import numpy as np
from numpy.typing import NDArray

from problems import targets
from problems.errors import InputError
from problems.problem import System

Array = NDArray[np.float64]

PLACES = 64  # at which the field is looked at, up to the end of the step that failed
SHORTEST = 64  # units in the last place of the time: as far it is looked at at least


def where_undefined(system: System, t: float, y: Array, par: Array, h: float = 0.0) -> str:
    """Return which derivative is not a finite number, and at what time; empty where none is found.

    The field is evaluated on the tangent of the trajectory: a method's own stages are not known for all.

    Parameters
    ----------
    system : System
        What was integrated.
    t, y : float, ndarray of shape (dim,)
        The last state that was reached.
    par : ndarray, shape (n_par,)
        Parameters.
    h : float
        The step that failed, with its sign.
    """
    if not (math.isfinite(t) and np.isfinite(y).all()):
        return ""
    field = targets.numpy(system, "field")
    reach = math.copysign(max(abs(h) if math.isfinite(h) else 0.0, SHORTEST * math.ulp(t)), h)
    try:
        slope = field(t, y, par)
        for time in [t, *np.linspace(t, t + reach, PLACES + 1)[1:].tolist()]:
            with np.errstate(all="ignore"):
                state = y if time == t else y + (time - t) * slope
            values = slope if time == t else field(time, state, par)
            if not np.isfinite(values).all():
                return f"{_named(system, int(np.argmin(np.isfinite(values))), values)} at t = {time!r}"
    except InputError as error:  # of a numba function, which cannot say it itself
        return str(error).removesuffix(".")
    except Exception:  # of the user's function, which has been told
        return ""
    return ""


def _named(system: System, i: int, values: Array) -> str:
    """Return which component of the derivative has which value."""
    dof, name = system.dof, f"dy[{i}]/dt"
    if dof is not None:
        name = f"dq[{i}]/dt" if i < dof else f"dp[{i - dof}]/dt"
    return f"{name} is {float(values[i])!r}"
