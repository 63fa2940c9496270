"""What every search for events has in common: what has happened, and how it ended."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from integrators.events.event import Event
from integrators.protocol import Actions, Array, Events, MethodBase, Status, offers
from integrators.solution import Occurrences
from problems.errors import InputError
from problems.problem import Problem

Failure = tuple[Status, str, Exception | None]


class Hits:
    """What has happened, in the order of integration, up to the occurrence that ends it.

    Parameters
    ----------
    events : mapping of str to Event
        What is looked for.
    sign : {1.0, -1.0}
        The direction of time.
    dim : int
        Length of the state.

    Attributes
    ----------
    names : list of str
        Of the events.
    counts : list of int
        How often each has happened.
    terminal : str or None
        The event that has ended the integration.
    stop : float
        When.
    """

    def __init__(self, events: Mapping[str, Event], sign: float, dim: int):
        self.names, self.sign, self._dim = list(events), sign, dim
        self._limits = [event.last for event in events.values()]
        self._acts = [event.then is not None for event in events.values()]
        self._pieces: list[tuple[Array, Array, Array, NDArray[np.int64], NDArray[np.int64]]] = []
        self.counts = [0] * len(self.names)
        self.terminal: str | None = None
        self.stop = float("nan")

    def take(
        self, t: Array, y: Array, after: Array, event: NDArray[np.int64], direction: NDArray[np.int64]
    ) -> None:
        """Take what has happened since the last time; what was after a terminal event has not.

        States are those before and ``after`` an event's action, the same where it has none.
        """
        order = np.argsort(self.sign * t, kind="stable")
        if self.terminal is not None:
            return
        for i, limit in enumerate(self._limits):
            here = np.flatnonzero(event[order] == i)
            left = limit - self.counts[i]
            if limit and here.size >= left:
                order, self.terminal = order[: here[left - 1] + 1], self.names[i]
        for i in range(len(self._limits)):
            self.counts[i] += int(np.count_nonzero(event[order] == i))
        if self.terminal is not None:
            self.stop = float(t[order[-1]])
        if order.size:
            self._pieces.append((t[order], y[order], after[order], event[order], direction[order]))

    @property
    def reason(self) -> str:
        """Why the integration has ended, as a sentence."""
        return f"the event {self.terminal!r} ended the integration at t = {self.stop!r}."

    def last(self) -> tuple[float, Array]:
        """Return when the last of all has happened, and the state after it."""
        t, y, after, event, _ = self._pieces[-1]
        return float(t[-1]), (after if self._acts[event[-1]] else y)[-1].copy()

    def occurrences(self) -> dict[str, Occurrences]:
        """Return what has happened, by the events' names."""
        t, y, after, event, direction = self._joined()
        result = {}
        for i, name in enumerate(self.names):
            own = event == i
            after_ = after[own] if self._acts[i] else None
            result[name] = Occurrences(t[own], y[own], direction[own], after_)
        return result

    def _joined(self) -> tuple[Array, Array, Array, NDArray[np.int64], NDArray[np.int64]]:
        none, nowhere = np.empty(0, dtype=np.int64), np.empty((0, self._dim))
        pieces = [*self._pieces, (np.empty(0), nowhere, nowhere, none, none)]
        t, y, after, event, direction = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
        return t, y, after, event, direction

    def save(self) -> dict[str, Any]:
        """Return everything, for `load`."""
        joined = self._joined()
        self._pieces = [joined]
        return {"pieces": joined, "counts": list(self.counts), "terminal": self.terminal, "stop": self.stop}

    def load(self, kept: Mapping[str, Any]) -> None:
        """Go on from what `save` returned."""
        self._pieces, self.counts = [kept["pieces"]], list(kept["counts"])
        self.terminal, self.stop = kept["terminal"], kept["stop"]


class Finder(Protocol):
    """A search for events in the steps of one trajectory, at work.

    Attributes
    ----------
    trouble : tuple or None
        Why nothing is looked for any more: status, reason, and what a function of the user raised.
    """

    trouble: Failure | None

    @property
    def hits(self) -> Hits:
        """What has happened."""
        ...

    @property
    def unknown(self) -> Sequence[str]:
        """The events whose functions were finite nowhere."""
        ...

    def work(self) -> dict[str, int]:
        """Return what the search has cost."""
        ...

    def save(self) -> Any:
        """Return what the rest of the search depends on; the trajectory has its own checkpoint."""
        ...

    def load(self, kept: Any) -> None:
        """Go on from where `save` was called."""
        ...


@dataclass(frozen=True)
class Ending:
    """How a trajectory ended whose events were looked for.

    Attributes
    ----------
    status, reason, stop
        How, why and when.
    error : Exception or None
        What an event's function raised.
    """

    status: Status
    reason: str
    stop: float
    error: Exception | None = None

    @classmethod
    def from_search(cls, search: Finder, status: Status, reason: str, start: float, stop: float) -> "Ending":
        """Return how it ended, from how the steps did, between two times."""
        if search.hits.terminal is not None:
            return cls(Status.EVENT, search.hits.reason, search.hits.stop)
        if status.failed:
            return cls(status, reason, stop)
        if search.trouble is not None:
            status, reason, error = search.trouble
            return cls(status, reason, stop, error)
        if search.unknown:
            return cls(
                Status.NOT_FINITE,
                f"the event function {', '.join(search.unknown)} was finite at none of the states between "
                f"t = {start!r} and t = {stop!r}, so nothing is known of the event.",
                stop,
            )
        return cls(status, reason, stop)

    def count(self, times: Array, search: Finder) -> int:
        """Return how many of the times were reached."""
        if self.status is not Status.EVENT:
            return times.size
        return int(np.count_nonzero(search.hits.sign * (times - self.stop) <= 0.0))


def started_with_events(
    program: Any, method: MethodBase, problem: Problem, events: Mapping[str, Event]
) -> Callable[..., Any]:
    """Return what starts a trajectory that looks for events: ``start(y0, par, t0, end)``.

    Raises
    ------
    problems.errors.InputError
        If the method cannot find events, or a function cannot be used.
    """
    acting = [name for name, event in events.items() if event.then is not None]
    if acting and not (offers(program, Actions) and program.acts):
        why, instead = _refused_action(program, method)
        raise InputError(
            f"the event {acting[0]!r} changes the state, which {method!r} does not offer{why}; "
            f"use {instead}, or leave out then=."
        )
    if not offers(program, Events):
        raise InputError(
            f"{method!r} cannot find events: it does not offer the states inside its steps that "
            "finding them takes; use HBVM, Gauss, LineIntegral or Taylor."
        )
    return program.with_events(problem, events)


def _refused_action(program: Any, method: MethodBase) -> tuple[str, str]:
    """Return why events cannot change the state, and what to use instead."""
    adaptive = "HBVM or Gauss with an adaptive step size (tol=)"
    if offers(program, Actions):
        conserved = ", ".join(method.conserved(program.system))
        return (
            f" for {program.system.name}: it conserves {conserved or 'invariants'}, and the event may not",
            "Gauss(s=4, tol=1e-12)",
        )
    if getattr(method, "tol", None) is None and getattr(method, "h", None) is not None:
        return ", as the event would shorten a step of its fixed length", adaptive
    return "", adaptive
