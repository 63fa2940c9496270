"""Events of many trajectories."""

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

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
    stop = threading.Event()

    def member(i: int) -> Member:
        return _single(start, starts[i], par[i], own_times(times, i), t0, stop)

    if threads == 1 or len(starts) == 1:
        return [member(i) for i in range(len(starts))]
    with ThreadPoolExecutor(threads) as pool:
        try:
            return list(pool.map(member, range(len(starts))))
        except BaseException:
            stop.set()  # the others come back at once
            raise


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
    y, steps = np.full((1, times.size, y0.size), np.nan), np.zeros(1, dtype=np.int64)
    end = float(times[-1])
    try:
        stepper = start(y0, par, t0, end)
    except UserError as raised:
        reason = f"{raised} at the start, t = {t0!r}."
        return Trajectories(times, y, [Status.USER_ERROR], [reason], np.array([t0]), steps), {}
    if offers(stepper, Interruptible):
        stepper.stop = stop
    if offers(stepper, Destination):
        stepper.destination = end
    samples = stepper.advance(times)
    ending = ending_of(stepper, samples, t0, end)
    n = ending.count(samples.t, stepper.search)
    y[0, :n], steps[0] = samples.y[:n], stepper.stats.steps
    result = Trajectories(times, y, [ending.status], [ending.reason], np.array([ending.stop]), steps)
    result.extra[0] = telling(stepper.stats)
    return result, stepper.search.hits.occurrences()
