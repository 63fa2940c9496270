"""heyoka's own search for events, as a `integrators.events.finder.Finder`."""

from collections.abc import Callable, Mapping, Sequence
from itertools import compress
from typing import Any

import numpy as np

from integrators.events.event import Event
from integrators.events.finder import EventLog
from integrators.peers import load
from integrators.protocol import Array
from problems import targets
from problems.problem import Problem

CLOSE = 64  # units in the last place: an event so near the start is none


class Recorder:
    """What heyoka calls when an event has happened; copies of an integrator share it."""

    def __init__(self, event: int):
        self._event = event
        self.record: Callable[[Any, float, int, int], None] | None = None

    def __call__(self, integrator: Any, t: float, direction: int) -> None:
        if self.record is not None:
            self.record(integrator, t, self._event, direction)

    def __deepcopy__(self, memo: Any) -> "Recorder":
        return self

    def __getstate__(self) -> dict[str, Any]:
        return {"_event": self._event, "record": None}


def heyoka_events(problem: Problem, events: Mapping[str, Event]) -> list[Any]:
    """Return events for an integrator of the problem's system, none of which ends a step.

    Raises
    ------
    problems.errors.InputError
        For a function that cannot be traced.
    """
    hy, result = load("heyoka"), []
    for i, (name, event) in enumerate(events.items()):
        traced = problem.system.trace(event.g, f"event {name!r}")
        result.append(hy.nt_event(targets.heyoka_of(problem.system, traced), Recorder(i)))
    return result


class TaylorSearch:
    """Keeps what heyoka finds in the steps of a trajectory.

    Parameters
    ----------
    events : mapping of str to Event
        What is looked for.
    y, t, end : ndarray, float, float
        The start, and the time up to which is looked.
    present : callable
        Returns the time up to which the trajectory is wanted; the library may be ahead.
    """

    trouble = None
    unknown: tuple[str, ...] = ()

    def __init__(self, events: Mapping[str, Event], y: Array, t: float, end: float, present: Any):
        self._events, self._start, self._end, self._present = list(events.values()), t, end, present
        self._hits = EventLog(events, 1.0 if end >= t else -1.0, y.size)
        self._y0 = y.copy()
        self._ahead: list[tuple[float, Array, int, int]] = []
        self._counts = [0] * len(events)
        self._finished: float | None = None
        self.terminates = any(event.last for event in self._events)
        """Whether one of them is terminal."""
        self.over: float | None = None
        """When a terminal event has happened, which may be ahead of the present."""

    def watch(self, integrator: Any) -> None:
        """Hear of the events of an integrator."""
        for event in integrator.nt_events:
            event.callback.record = self._record

    def _record(self, integrator: Any, t: float, event: int, direction: int) -> None:
        sign, wanted = self._hits.sign, self._events[event].direction
        way = int(direction * sign)
        near = abs(t - self._start) <= CLOSE * np.spacing(max(abs(t), abs(self._start)))
        if near or sign * (t - self._end) > 0.0 or wanted not in (0, way):
            return
        integrator.update_d_output(t)
        self._note(t, integrator.d_output.copy(), event, way)

    def _note(self, t: float, y: Array, event: int, way: int) -> None:
        self._ahead.append((t, y, event, way))
        self._counts[event] += 1
        if self.over is None and self._counts[event] == self._events[event].last:
            self.over = t

    def resume(self, counts: Sequence[int], directions: Sequence[int], *, again: bool) -> None:
        """Go on where events have happened before; see `integrators.events.finder.Finder`."""
        self._counts, self._hits.counts = list(counts), list(counts)
        for i, (event, direction) in enumerate(zip(self._events, directions, strict=True)):
            if again and direction and event.direction in (0, -direction):
                self._note(self._start, self._y0, i, -direction)

    def take_back(self, t: float) -> None:
        """Forget what happened after a time, from which a step is taken again."""
        kept = len(self._ahead)
        while kept and self._hits.sign * (self._ahead[kept - 1][0] - t) > 0.0:
            kept -= 1
        for hit in self._ahead[kept:]:
            self._counts[hit[2]] -= 1
            self.over = None
        del self._ahead[kept:]

    def finish(self, end: float) -> None:
        """Let all count that has happened up to a time, also ahead of the present."""
        self._finished = end

    @property
    def hits(self) -> EventLog:
        """What has happened up to the present."""
        now, self._ahead = self._ahead, []
        known = self._present() if self._finished is None else self._finished
        ahead = [self._hits.sign * (hit[0] - known) > 0.0 for hit in now]
        self._ahead = list(compress(now, ahead))
        now = list(compress(now, [not is_ahead for is_ahead in ahead]))
        if now:
            t, y, event, direction = (np.array(column) for column in zip(*now, strict=True))
            self._hits.take(t, y, y, event, direction)
        return self._hits

    def work(self) -> dict[str, int]:
        """Return nothing: heyoka does not count it."""
        return {}

    def save(self) -> Any:
        """Return what the rest of the search depends on."""
        return {"hits": self.hits.save(), "ahead": list(self._ahead), "counts": list(self._counts)}

    def load(self, kept: Any) -> None:
        """Go on from where `save` was called."""
        self._hits.load(kept["hits"])
        self._ahead, self._counts = list(kept["ahead"]), list(kept["counts"])
        self._finished = None
