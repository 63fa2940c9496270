"""What a stepper refuses: times, states and parameters that it cannot use, and a second thread."""

import functools
import math
import threading
from collections.abc import Callable
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from problems import limits
from problems.errors import InputError, shown
from problems.problem import System
from problems.quantities import plain_numbers

Array = NDArray[np.float64]

CHECKED_IN_PYTHON = 32  # numbers that are looked at one by one
COARSEST = 2.0**-26
"""Of an interval, the largest distance of the doubles next to its times: half of a double's bits are left.

A time, and so the state at it, is known to about that distance. Julian dates pass from 45 minutes on, seconds
since 1970 from 16 s on.
"""

P = ParamSpec("P")
Result = TypeVar("Result")


class Guarded(Protocol):
    """What has a lock of its own."""

    _at_work: threading.RLock  # type: ignore[valid-type]


S = TypeVar("S", bound=Guarded)


def check_times(times: ArrayLike, t: float) -> Array:
    """Return ``times`` as a float64 array, or raise for times no stepper can serve.

    Parameters
    ----------
    times : array_like, shape (n,)
        Requested times; n >= 1, finite, strictly monotone; none behind ``t``
        in the direction of integration.
    t : float
        The stepper's present time.

    Raises
    ------
    problems.errors.InputError
        If the times are empty, not finite, not strictly monotone or behind ``t``.
    """
    grid = plain_numbers("times", times)
    if grid.shape == (1,) and math.isfinite(grid.item()):
        return grid
    grid = grid if grid.ndim else grid[np.newaxis]
    if grid.ndim != 1 or grid.size == 0:
        raise InputError(f"times must be a non-empty one-dimensional array, not of shape {grid.shape}.")
    first, last = grid.item(0), grid.item(-1)
    if last >= t:
        ahead = t <= first and (t < last or grid.size == 1)
        monotone = grid[1:] > grid[:-1]
    else:
        ahead = first <= t
        monotone = grid[1:] < grid[:-1]
    # What is not a number is not monotone, and what is monotone is finite if its ends are.
    if ahead and math.isfinite(first) and math.isfinite(last) and np.logical_and.reduce(monotone):
        return grid
    if not np.isfinite(grid).all():
        raise InputError("times must be finite numbers.")
    needed = "strictly monotone" if ahead else f"strictly monotone and ahead of the present time {t!r}"
    raise InputError(f"times must be {needed}; {_out_of_order(grid, t)}.")


def _out_of_order(grid: Array, t: float) -> str:
    """Return which of the times are not in order, and what to do."""
    low, high = float(grid.min()), float(grid.max())
    if low < t < high:
        return f"{low!r} and {high!r} lie on both sides of it: integrate twice, forwards and backwards"
    steps = np.diff(grid)
    wrong = np.flatnonzero(~(steps > 0.0) if high > t else ~(steps < 0.0))
    if not wrong.size:
        return f"{float(grid[0])!r} is behind it"
    i = int(wrong[0])
    return f"times[{i}] = {float(grid[i])!r} is followed by times[{i + 1}] = {float(grid[i + 1])!r}"


def check_interval(t0: float, end: float) -> None:
    """Refuse an interval so far from 0 that doubles near its times are too coarse for it.

    Steps there would begin and end at other times than are meant, or be shorter than what a time can tell.

    Parameters
    ----------
    t0, end : float
        Where a trajectory starts, and the last time that is asked for.

    Raises
    ------
    problems.errors.InputError
        If the distance of the doubles is more than `COARSEST` of the interval.
    """
    latest = max(t0, end, key=abs)
    apart, length = math.ulp(latest), abs(end - t0)
    if t0 != 0.0 and 0.0 < COARSEST * length < apart:
        raise InputError(
            f"at t = {latest:.6g} doubles are {apart:.3g} apart, too coarse for an interval of {length:.6g}: "
            "count the time from t0, with t0 = 0."
        )


def check_start(t0: Any) -> float:
    """Return the time of a start, a finite number, or refuse it."""
    if type(t0) is float and math.isfinite(t0):
        return t0
    time = plain_numbers("t0", t0)
    if time.ndim or not np.isfinite(time):
        raise InputError(f"t0={shown(t0)} must be one finite number.")
    return float(time)


def check_parameters(par: ArrayLike | None, system: System) -> Array:
    """Return a parameter vector as a fresh array, the system's own by default, or refuse it.

    Raises
    ------
    problems.errors.InputError
        If it is not made of numbers, or not of the system's length.
    """
    if par is None:
        return system.pack()
    values = plain_numbers("par", par)
    if values.shape != (system.n_par,):
        raise InputError(f"par must have shape ({system.n_par},), not {values.shape}; see system.pack.")
    return values.copy()


def check_batch(Y0: ArrayLike, par: ArrayLike | None, times: Array, system: System) -> tuple[Array, Array]:
    """Return a batch's starts (n, dim) and parameters (n, n_par) as fresh arrays, or refuse them.

    Raises
    ------
    problems.errors.InputError
        If they are of other shapes or not finite, or if n trajectories at so many times take too much memory.
    """
    rows = np.atleast_2d(plain_numbers("Y0", Y0))
    if rows.ndim != 2 or rows.shape[0] == 0:
        raise InputError(f"Y0 must have shape (n, {system.dim}) with n >= 1, not {rows.shape}.")
    n = rows.shape[0]
    limits.check(f"a batch of {n} trajectories", "GIB", 8 * times.size * rows.size / 2**30)
    if rows.shape[1] != system.dim or not np.isfinite(rows).all():
        for row in rows:
            check_state(row, system.dim)
    starts = np.array(rows, order="C")
    given = None if par is None else plain_numbers("par", par)
    if given is None or given.ndim == 1:
        return starts, np.tile(check_parameters(given, system), (n, 1))
    if given.shape != (n, system.n_par):
        raise InputError(
            f"par must have shape ({system.n_par},) or ({n}, {system.n_par}), not {given.shape}."
        )
    return starts, np.array(given, order="C")


def check_state(y0: ArrayLike, dim: int) -> Array:
    """Return ``y0`` as a fresh float64 array of shape (dim,), or refuse it.

    Raises
    ------
    problems.errors.InputError
        If the shape is wrong or an entry is not finite.
    """
    y = plain_numbers("the initial state", y0).copy()
    if y.shape != (dim,):
        raise InputError(f"the initial state must have shape ({dim},), not {y.shape}.")
    if not are_finite(y):
        where = int(np.flatnonzero(~np.isfinite(y))[0])
        raise InputError(f"the initial state must be finite numbers; y0[{where}] is {float(y[where])!r}.")
    return y


def are_finite(y: Array) -> bool:
    """Whether all numbers of a state are finite."""
    # NumPy's functions take four times as long for four numbers
    return all(map(math.isfinite, y.tolist())) if y.size <= CHECKED_IN_PYTHON else bool(np.isfinite(y).all())


def one_thread(method: Callable[Concatenate[S, P], Result]) -> Callable[Concatenate[S, P], Result]:
    """Let a method of a stepper raise `InputError` while another thread is in one of its methods.

    Compiled code and the peers' libraries release the interpreter's lock while they work on a stepper's
    memory: two threads in it at once would give numbers that belong to neither.
    """

    @functools.wraps(method)
    def guarded(stepper: S, *args: P.args, **kwargs: P.kwargs) -> Result:
        if not stepper._at_work.acquire(blocking=False):
            raise InputError(
                f"this {type(stepper).__name__} is at work in another thread; "
                "start one stepper for each thread (one program serves them all)."
            )
        try:
            return method(stepper, *args, **kwargs)
        finally:
            stepper._at_work.release()

    return guarded
