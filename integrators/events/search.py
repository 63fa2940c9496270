"""Follow a trajectory and find the events on it."""

import copy
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from integrators.events import roots
from integrators.events.event import Event
from integrators.events.function import EventFunction
from integrators.events.step import Step, Unresolved
from integrators.protocol import Array, MethodBase, Program, Stats, Status, Stepper, UserError
from integrators.solution import Occurrences
from problems import Problem
from problems.errors import InputError

FIRST, MOST = 8, 256  # steps looked at together
NUMBERS = 1_000_000  # held at once, at most
DEGREES = (8, 24, 64)  # of g along a step: the least, where s is not known, the most to begin with
CLOSE = 64  # units in the last place: nothing happens in a time as short
SAME = 1e-5  # of a step: two touches as close are one
COUNTERS = ("steps", "evaluations", "iterations")
Look = Callable[[float, Callable[[], int], Callable[[], dict[str, Any]]], None]
_LASTING = (
    "_t", "_taken", "_length", "_count", "_finite", "_touched", "_hits", "_terminal", "_failed", "_looked",
    "_zero",
)  # fmt: skip


@dataclass(frozen=True)
class Hit:
    """An event that happened."""

    t: float
    y: Array
    event: int
    direction: int


@dataclass
class Found:
    """What a search found.

    Attributes
    ----------
    events : dict of str to Occurrences
        By the events' names.
    t_stop : float
        Where the search ended.
    status : Status
        How: ``EVENT`` at a terminal one, ``FINISHED``, or a failure of the method; ``NOT_FINITE``
        also where one of the functions was finite nowhere, ``STALLED`` where one varies too
        fast to be followed.
    reason : str
        One sentence, unless it is ``FINISHED``.
    stats : Stats
        Counters of the work done.
    error : Exception or None
        What a function of the user raised.
    """

    events: dict[str, Occurrences]
    t_stop: float
    status: Status
    reason: str
    stats: Stats
    error: Exception | None = None


class Search:
    """A search for events from a problem's start to a time.

    The walker takes the own steps and samples their polynomials; the probe goes back to
    the steps in which something may happen, and makes partial steps from there.

    Parameters
    ----------
    problem, method, program
        What is integrated, how, and the compiled method.
    events : dict of str to Event
        What to look for.
    end : float
        Where the integration is to end.

    Raises
    ------
    problems.errors.InputError
        If the method has no states between its steps, or a function cannot be used.
    """

    def __init__(
        self, problem: Problem, method: MethodBase, program: Program, events: dict[str, Event], end: float
    ):
        self._method = method
        self._names = list(events)
        self._events = list(events.values())
        self._functions = [EventFunction(name, event.g, problem) for name, event in events.items()]
        self._walker = program.start(problem.y0, problem.par, problem.t0)
        self._probe = program.start(problem.y0, problem.par, problem.t0)
        self._start, self._t, self._end = problem.t0, problem.t0, float(end)
        self._sign = 1.0 if end > problem.t0 else -1.0
        s = getattr(method, "s", None)
        least, usual, most = DEGREES
        self._degree = min(max(2 * s, least), most) if isinstance(s, int) else usual
        h = getattr(method, "h", None)
        self._h = None if h is None or getattr(method, "tol", None) is not None else self._sign * h
        self._taken = 0  # own steps of one length
        self._length = 0.0  # about that of an own step, where they vary
        self._count = FIRST
        self._most = max(1, min(MOST, NUMBERS // ((self._degree + 1) * problem.system.dim)))
        self._finite = [False] * len(self._events)
        self._touched = [np.nan] * len(self._events)  # where each was last seen to touch zero
        self._hits: list[Hit] = []
        self._terminal: str | None = None
        self._failed = False  # one of the steppers
        self._looked = problem.t0
        self._zero = self._rests(problem)
        self._before: dict[str, int] = dict.fromkeys(
            COUNTERS, 0
        )  # counts of the work that another process did

    def run(self, look: Look) -> Found:
        """Search to the end, the first terminal event, a failure of the method, or Ctrl-C."""
        raised: UserError | Unresolved | KeyboardInterrupt | None = None
        try:
            while self._t != self._end and self._terminal is None and not self._failed:
                self._go_on()
                self._count = min(4 * self._count, self._most)
                look(self._t, lambda: self._walker.stats.steps, self.save)
        except (UserError, Unresolved, KeyboardInterrupt) as error:
            raised = error
        stop = self._hits[-1].t if self._terminal is not None else self._t
        status, reason, error = self._outcome(stop, raised)
        work = {name: self._before[name] + count for name, count in self._work().items()}
        return Found(
            events={name: self._occurrences(i) for i, name in enumerate(self._names)},
            t_stop=stop,
            status=status,
            reason=reason,
            stats=replace(self._walker.stats, **work),
            error=error,
        )

    def save(self) -> dict[str, Any]:
        """Return all that the rest of the search depends on."""
        lasting = {name: copy.copy(getattr(self, name)) for name in _LASTING}
        work = {name: self._before[name] + count for name, count in self._work().items()}
        return {"search": {"walker": self._walker.checkpoint(), "work": work, "lasting": lasting}}

    def load(self, kept: Mapping[str, Any]) -> None:
        """Go on from where `save` was called."""
        self._walker.restore(kept["walker"])
        self._before = kept["work"]
        for name, value in kept["lasting"].items():
            setattr(self, name, copy.copy(value))

    def _work(self) -> dict[str, int]:
        steppers = (self._walker, self._probe)
        return {name: sum(getattr(stepper.stats, name) or 0 for stepper in steppers) for name in COUNTERS}

    def _go_on(self) -> None:
        """Take some steps, and look for events in them."""
        before = self._walker.checkpoint()
        ends, last = self._whole() if self._h is not None else self._varying()
        for t, y in self._sampled(before, ends, last):
            if self._terminal is None and t.size:
                self._looked = float(t[0, 0])
                self._look(before, t, y)

    def _outcome(
        self, stop: float, raised: "UserError | Unresolved | KeyboardInterrupt | None"
    ) -> tuple[Status, str, Exception | None]:
        """Return status, reason and, if there is one, the user's error."""
        if self._terminal is not None:
            return Status.EVENT, f"the event {self._terminal!r} ended the integration at t = {stop!r}.", None
        known = f"are known up to t = {self._looked!r} only."
        if isinstance(raised, UserError):
            return Status.USER_ERROR, f"{raised}: events {known}", raised.error
        if isinstance(raised, KeyboardInterrupt):
            return Status.INTERRUPTED, f"Ctrl-C was pressed while events were looked for; they {known}", None
        if raised is not None:
            return Status.STALLED, f"{raised} Events {known}", None
        for stepper in (self._walker, self._probe):
            if self._failed and stepper.status.failed:
                return stepper.status, stepper.reason, getattr(stepper, "error", None)
        unknown = [name for name, known in zip(self._names, self._finite, strict=True) if not known]
        if unknown:
            reason = (
                f"the event function {', '.join(unknown)} was finite at none of the states between "
                f"t = {self._start!r} and t = {stop!r}, so nothing is known of the event."
            )
            return Status.NOT_FINITE, reason, None
        return Status.FINISHED, "", None

    def _occurrences(self, event: int) -> Occurrences:
        hits = [hit for hit in self._hits if hit.event == event]
        dim = self._walker.y.size
        return Occurrences(
            t=np.array([hit.t for hit in hits]),
            y=np.array([hit.y for hit in hits]).reshape(len(hits), dim),
            direction=np.array([hit.direction for hit in hits], dtype=np.int64),
        )

    def _rests(self, problem: Problem) -> list[bool]:
        """Return which functions start at zero: a start is no event."""
        t, y = np.array([problem.t0]), problem.y0[np.newaxis]
        return [
            bool(abs(float(g(t, y)[0])) <= g.noise(problem.t0, problem.y0.copy())) for g in self._functions
        ]

    def _ask(self, stepper: Stepper, times: Array, sample: str) -> tuple[Array, Array]:
        """Return the samples that could be made, or refuse a method that has none.

        Places within a step that is about as short as rounding of time are one and the same time.
        """
        new = np.append(True, np.diff(times) != 0.0)
        try:
            made = stepper.advance(times[new], sample=sample)
        except InputError as error:
            raise InputError(
                f"{self._method!r} cannot find events: it does not offer the states inside its steps that "
                f"finding them takes (sample={sample!r}); use HBVM, Gauss or LineIntegral."
            ) from error
        place = np.cumsum(new) - 1
        place = place[place < made.t.size]
        return (made.t, made.y) if new.all() else (made.t[place], made.y[place])

    def _whole(self) -> tuple[Array, bool]:
        """Return the ends of the next own steps of one length, from the present on, and whether all."""
        assert self._h is not None
        ends = self._start + self._h * np.arange(self._taken, self._taken + self._count + 1)
        ends = ends[self._sign * (self._end - ends) >= 0.0]
        self._taken += ends.size - 1
        return ends, ends.size <= self._count

    def _varying(self) -> tuple[Array, bool]:
        """Take the next own steps; return as `_whole` does."""
        if self._length == 0.0:
            before = self._walker.checkpoint()
            self._walker.step()
            self._length = abs(self._walker.t - self._t) or abs(self._end - self._t)
            self._walker.restore(before)
        ends, last = np.array([self._t]), False
        while ends.size == 1:
            goal = self._t + self._sign * self._count * self._length
            last = self._sign * (goal - self._end) >= 0.0
            times, _ = self._ask(self._walker, np.array([self._end if last else goal]), "steps")
            ends = np.append(ends, times)
            if last or self._walker.status.failed:
                break
            self._length *= 2.0
        self._failed = self._walker.status.failed
        if ends.size > 1:
            self._length = abs(float(ends[-1] - ends[-2]))
        return ends, last

    def _sampled(self, before: Any, ends: Array, last: bool) -> Iterator[tuple[Array, Array]]:
        """Yield times (n, degree + 1) and states of the whole steps, then of the part up to the end."""
        x, degree = roots.nodes(self._degree), self._degree
        if ends.size > 1:
            stepper = self._walker
            if self._h is None:
                stepper = self._probe
                stepper.restore(before)
            grid = ends[:-1, None] + x * np.diff(ends)[:, None]
            grid[:, -1] = ends[1:]
            times, states = self._ask(stepper, np.append(grid[:, :-1].ravel(), ends[-1]), "dense")
            done = max(times.size - 1, 0) // degree
            self._failed = self._failed or stepper.status.failed
            parts = states[: done * degree].reshape(done, degree, -1)
            ahead = states[degree : done * degree + 1 : degree]
            yield grid[:done], np.concatenate([parts, ahead[:, np.newaxis]], axis=1)
            self._t = float(ends[done])
        if last and abs(self._end - self._t) <= CLOSE * float(np.spacing(abs(self._end))):
            self._t = self._end
        if last and not self._failed and self._t != self._end and self._terminal is None:
            now = self._walker.y
            grid = self._t + x * (self._end - self._t)
            grid[-1] = self._end
            times, states = self._ask(self._walker, grid[1:], "side")
            self._failed = self._walker.status.failed
            y = np.full((1, degree + 1, now.size), np.nan)
            y[0, 0] = now
            y[0, 1 : times.size + 1] = states
            yield grid[np.newaxis], y
            self._t = self._walker.t if self._failed else self._end

    def _look(self, before: Any, t: Array, y: Array) -> None:
        """Find the events in steps whose samples are given; ``before`` is where the first of them begins."""
        hits: list[Hit] = []
        for i, g in enumerate(self._functions):
            values = g(t.ravel(), y.reshape(t.size, -1)).reshape(t.shape)
            if self._zero[i]:
                values[0, 0] = 0.0
            self._zero[i] = False
            self._finite[i] = self._finite[i] or bool(np.isfinite(values).any())
            places, fine, unresolved = roots.refined(values)
            near = before  # the probe goes on from the step that it was last sent to
            for row in np.flatnonzero(np.logical_or(roots.suspects(fine), unresolved)):
                step = Step(self._probe, near, t[row], y[row], g)
                for at, state, direction in step.events(places, fine[row], bool(unresolved[row])):
                    # A touch at the end of a step is seen from both sides.
                    again = direction == 0 and abs(at - self._touched[i]) < SAME * abs(t[row, -1] - t[row, 0])
                    self._touched[i] = at if direction == 0 else self._touched[i]
                    if self._events[i].direction in (0, direction) and not again:
                        hits.append(Hit(at, state, i, direction))
                near = near if step.here is None else step.here
        self._take(sorted(hits, key=lambda hit: self._sign * hit.t))

    def _take(self, hits: Sequence[Hit]) -> None:
        """Keep what happened, up to a terminal event."""
        for hit in hits:
            self._hits.append(hit)
            last = self._events[hit.event].last
            if last and sum(kept.event == hit.event for kept in self._hits) == last:
                self._terminal = self._names[hit.event]
                return


def search(
    problem: Problem, method: MethodBase, program: Program, events: dict[str, Event], end: float,
    look: Look = lambda t, steps, kept: None, kept: Mapping[str, Any] | None = None,
) -> Found:  # fmt: skip
    """Search for events from the problem's start to a time; see `Search`.

    ``look`` is called after every few steps with the time, the steps made, and a function that returns what
    the rest of the search depends on: ``{"search": kept}``, with which it goes on in another process.
    """
    try:
        searching = Search(problem, method, program, events, end)
        if kept is not None:
            searching.load(kept)
        return searching.run(look)
    except UserError as raised:  # at the start
        raise raised.error from None
