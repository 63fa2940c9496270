"""What every search for events has in common: what has happened, and how it ended."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from integrators.events.event import Event
from integrators.protocol import Actions, Array, Events, MethodBase, Status, offers
from integrators.solution.occurrences import Occurrences
from problems.errors import InputError
from problems.problem import Problem

Failure = tuple[Status, str, Exception | None]
_Piece = tuple[Any, ...]  # times, states before and after, events, directions, parameters after
PARTS = 6  # of such a piece


class EventLog:
    """The occurrences of events, in the order of integration, up to the one that ends it.

    Parameters
    ----------
    events : mapping of str to Event
        What is looked for.
    sign : {1.0, -1.0}
        The direction of time.
    dim : int
        Length of the state.
    parameters : int
        Length of the parameter vector.

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

    def __init__(self, events: Mapping[str, Event], sign: float, dim: int, parameters: int = 0):
        self.names, self.sign, self._widths = list(events), sign, (dim, parameters)
        self._limits = [event.last for event in events.values()]
        self._acts = [event.then is not None for event in events.values()]
        self._pieces: list[_Piece] = []
        self.counts = [0] * len(self.names)
        self.terminal: str | None = None
        self.stop = float("nan")

    def take(
        self, t: Array, y: Array, after: Array, event: NDArray[np.int64], direction: NDArray[np.int64],
        par: Array | None = None,
    ) -> None:  # fmt: skip
        """Take what has happened since the last time; what was after a terminal event has not.

        States are those before and ``after`` an event's action, the same where it has none; ``par`` are the
        parameters after it.
        """
        order = np.argsort(self.sign * t, kind="stable")
        if self.terminal is not None:
            return
        for i, limit in enumerate(self._limits):
            if limit:
                here, left = np.flatnonzero(event[order] == i), limit - self.counts[i]
                if here.size >= left:
                    order, self.terminal = order[: here[left - 1] + 1], self.names[i]
        happened = np.bincount(event[order], minlength=len(self.counts)).tolist()
        self.counts = [before + more for before, more in zip(self.counts, happened, strict=True)]
        if self.terminal is not None:
            self.stop = float(t[order[-1]])
        if order.size:
            par = np.empty((t.size, self._widths[1])) if par is None else par
            rows = (t, y, after, event, direction, par)
            self._pieces.append(tuple(row[order] for row in rows))

    @property
    def reason(self) -> str:
        """Why the integration has ended, as a sentence."""
        return ended_by(str(self.terminal), self.stop)

    def last(self) -> tuple[float, Array]:
        """Return when the last of all has happened, and the state after it."""
        t, y, after, event, _, _ = self._pieces[-1]
        return float(t[-1]), (after if self._acts[event[-1]] else y)[-1].copy()

    def occurrences(self) -> dict[str, Occurrences]:
        """Return what has happened, by the events' names."""
        t, y, after, event, direction, par = self._joined()
        result = {}
        for i, name in enumerate(self.names):
            own = event == i
            changes = (after[own], par[own]) if self._acts[i] else ()
            result[name] = Occurrences(t[own], y[own], direction[own], *changes)
        return result

    def _joined(self) -> "_Piece":
        if len(self._pieces) == 1:
            return self._pieces[0]
        none, nowhere, no_par = np.empty(0, dtype=np.int64), *(np.empty((0, n)) for n in self._widths)
        pieces = [*self._pieces, (np.empty(0), nowhere, nowhere, none, none, no_par)]
        return tuple(np.concatenate(parts) for parts in zip(*pieces, strict=True))

    def save(self) -> dict[str, Any]:
        """Return everything, for `load`."""
        joined = self._joined()
        self._pieces = [joined]
        return {"pieces": joined, "counts": list(self.counts), "terminal": self.terminal, "stop": self.stop}

    def load(self, kept: Mapping[str, Any]) -> None:
        """Go on from what `save` returned.

        Raises
        ------
        problems.errors.InputError
            If an earlier version returned it, which knew nothing of parameters that actions change, and
            there are actions.
        """
        pieces = kept["pieces"]
        if len(pieces) == PARTS - 1 and not any(self._acts):
            pieces = (*pieces, np.empty((len(pieces[0]), self._widths[1])))
        if len(pieces) != PARTS:
            raise InputError(
                "this checkpoint is of another version of hbvm-bench, which knows less of events; restore it "
                "with that version, or begin anew."
            )
        self._pieces, self.counts = [pieces], list(kept["counts"])
        self.terminal, self.stop = kept["terminal"], kept["stop"]


def ended_by(name: str, t: float) -> str:
    """Return why an integration has ended that an event ends, as a sentence."""
    return f"the event {name!r} ended the integration at t = {t!r}."


class Finder(Protocol):
    """A search for events in the steps of one trajectory, at work.

    Attributes
    ----------
    trouble : tuple or None
        Why nothing is looked for any more: status, reason, and what a function of the user raised.
    """

    trouble: Failure | None

    @property
    def hits(self) -> EventLog:
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

    def resume(self, counts: Sequence[int], directions: Sequence[int], *, again: bool) -> None:
        """Go on at the start where events have happened before, also at this very time.

        Parameters
        ----------
        counts : sequence of int
            How often each event has happened.
        directions : sequence of int
            How its function has just changed its sign at the start; 0: it has not, or has only touched zero.
        again : bool
            Whether these, at the start, happen again, as on the way back.
        """
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
        why = ": it conserves invariants of the initial state" if offers(program, Actions) else ""
        raise InputError(
            f"the event {acting[0]!r} changes the state, which {method!r} does not offer{why}; "
            "use HBVM or Gauss, or leave out then=."
        )
    if not offers(program, Events):
        raise InputError(
            f"{method!r} cannot find events: it does not offer the states inside its steps that "
            "finding them takes; use HBVM, Gauss, LineIntegral or Taylor."
        )
    return program.with_events(problem, events)
