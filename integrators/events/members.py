"""Events of many trajectories."""

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import numpy as np

from integrators.events.finder import Ending
from integrators.protocol import (
    Array,
    Destination,
    Interruptible,
    Samples,
    Status,
    Trajectories,
    UserError,
    offers,
    telling,
)
from integrators.solution.occurrences import Occurrences

Result = TypeVar("Result")
Member = tuple[Trajectories, dict[str, Occurrences]]


def follow(
    start: Callable[..., Any], starts: Array, par: Array, times: Array, t0: float, threads: int = 1
) -> list[Member]:
    """Integrate trajectories one by one, or as many at once as there are threads, and look for their events.

    Parameters
    ----------
    start : callable
        What `finder.started_with_events` has returned.
    starts, par : ndarray, shapes (n, dim), (n, n_par)
        Starts and parameters.
    times : ndarray, shape (m,) or (n, m)
        Times asked for.
    t0 : float
        Time of the starts.
    threads : int
        How many.

    Returns
    -------
    list
        Of each trajectory (a batch of one), and what has happened in it by the events' names.
    """

    def member(i: int, stop: threading.Event) -> Member:
        return _single(start, starts[i], par[i], own_times(times, i), t0, stop)

    return one_by_one(member, len(starts), threads)


def one_by_one(member: Callable[[int, threading.Event], Result], count: int, threads: int) -> list[Result]:
    """Return ``member(i, stop)`` of each trajectory, of as many at once as there are threads.

    ``stop`` is set where one of them raises, as by Ctrl-C: the others are to come back at once.
    """
    stop = threading.Event()
    if threads == 1 or count == 1:
        return [member(i, stop) for i in range(count)]
    with ThreadPoolExecutor(threads) as pool:
        try:
            return list(pool.map(member, range(count), [stop] * count))
        except BaseException:
            stop.set()
            raise


def begun(
    start: Callable[[], Any], y0: Array, times: Array, t0: float, stop: threading.Event
) -> tuple[Any, Trajectories]:
    """Return a stepper on its way to the last of some times, and what is known of its trajectory.

    There is no stepper where a function of the user raises at the start, which ends the trajectory.
    """
    y, steps = np.full((1, times.size, y0.size), np.nan), np.zeros(1, dtype=np.int64)
    known = Trajectories(times, y, [Status.RUNNING], [""], np.array([t0]), steps)
    try:
        stepper = start()
    except UserError as raised:
        known.status[0], known.reason[0] = Status.USER_ERROR, f"{raised} at the start, t = {t0!r}."
        return None, known
    if offers(stepper, Interruptible):
        stepper.stop = stop
    if offers(stepper, Destination):
        stepper.destination = float(times[-1])
    return stepper, known


def own_times(times: Array, i: int) -> Array:
    """Return the times of trajectory i, of those of all, (m,), or of each, (n, m), with NaN at an end."""
    return times if times.ndim == 1 else times[i][~np.isnan(times[i])]


def ending_of(stepper: Any, samples: Samples, t0: float, end: float) -> Ending:
    """Return how a trajectory ended that has advanced to a time, or failed; look for its last events."""
    status = samples.status
    if status is Status.FINISHED:
        stepper.look_to(end)
    reached = end if status is Status.FINISHED else stepper.t
    return Ending.from_search(stepper.search, status, samples.reason, t0, reached)


def _single(
    start: Callable[..., Any], y0: Array, par: Array, times: Array, t0: float, stop: threading.Event
) -> Member:
    end = float(times[-1])
    stepper, result = begun(lambda: start(y0, par, t0, end), y0, times, t0, stop)
    if stepper is None:
        return result, {}
    samples = stepper.advance(times)
    ending = ending_of(stepper, samples, t0, end)
    n = ending.count(samples.t, stepper.search)
    result.y[0, :n], result.steps[0] = samples.y[:n], stepper.stats.steps
    result.status[0], result.reason[0], result.t_stop[0] = ending.status, ending.reason, ending.stop
    result.extra[0] = telling(stepper.stats)
    return result, stepper.search.hits.occurrences()
