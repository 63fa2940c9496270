"""The search for events of one trajectory, as Python sees it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.events.event import Event
from integrators.events.finder import EventLog
from integrators.kernel.context import DONE, Context, Shape
from integrators.kernel.engines import look, steps
from integrators.kernel.inside.functions import Action, EventFunction
from integrators.kernel.inside.memory import (
    FINE,
    FINEST,
    FULL,
    NODES,
    NOTED,
    PART,
    RAISED,
    START,
    TERMINAL,
    UNDEFINED,
    UNRESOLVED,
    UNSOLVABLE,
    WHOLE,
    Search,
)
from integrators.kernel.native.memory import aligned
from integrators.protocol import Array, Status, UserError

LOW = 4  # below this degree of the method's polynomial one term more is looked for; see `series`
LEAST, MOST = 8, 16  # samples in a step to begin with; more where these do not show the function
HITS, NUMBERS = 1024, 1 << 17  # occurrences, and components of their states, that are kept until Python asks
LASTING = ("ends", "touched", "finite", "happened", "recent", "due", "due_directions", "action_state")


@lru_cache(maxsize=1)
def _tables() -> tuple[Array, tuple[Array, ...]]:
    """Return cosines, and tables from samples to coefficients of Chebyshev polynomials.

    The coefficients follow by the discrete cosine transform. Row i of a table is for sample i.
    """
    cosines = np.cos(np.pi * np.arange(FINE * FINEST + 1) / (FINE * FINEST))
    cosines[FINE * FINEST // 2] = 0.0  # a place in the middle is exact
    tables = [aligned(0)] * (FINEST // LEAST + 1)
    degree = LEAST
    while degree <= FINEST:
        half = np.ones(degree + 1)
        half[[0, -1]] = 0.5
        width = 32 * (degree // 32 + 1)
        table = aligned((degree + 1) * width)
        angles = np.outer(np.arange(degree + 1), np.arange(degree + 1)) * (np.pi / degree)
        table_ = 2.0 / degree * half[:, None] * np.cos(angles) * half[None, :]
        table.reshape(degree + 1, width)[:, : degree + 1] = table_
        tables[degree // LEAST] = table
        degree *= 2
    return cosines, tuple(tables)


@dataclass(frozen=True, eq=False)
class Sought:
    """Events that are looked for in the trajectories of a program.

    Attributes
    ----------
    events : mapping of str to Event
        What to look for.
    functions : sequence of EventFunction
        Theirs.
    actions : mapping of str to Action
        Of those that change the state.
    shape : Shape
        Of the trajectories' memory.
    """

    events: Mapping[str, Event]
    functions: Sequence[EventFunction]
    actions: Mapping[str, Action]
    shape: Shape

    def memory(self, contexts: tuple[Context, Context]) -> Search:
        """Return memory for a search with these contexts, without room for what it finds."""
        memory = self._fresh.copy()
        memory.own, memory.partial = contexts
        return memory

    def lent(self, contexts: tuple[Context, Context]) -> "Lent":
        """Return memory for a search with these contexts; that of one that is over, if there is one."""
        try:
            lent = self._over.pop()
        except IndexError:
            memory = self._fresh.copy()
            log = Log.of(memory, room_for(max(memory.dim, memory.parameters)))
            lent = Lent(memory, memory.copy(), log)
        else:
            lent.memory.become(lent.begun)
        lent.memory.own, lent.memory.partial = contexts
        return lent

    def give_back(self, lent: "Lent") -> None:
        """Take the memory of a search that is over, for the next one; that of one is enough."""
        if not self._over:
            self._over.append(lent)

    @cached_property
    def _over(self) -> "list[Lent]":
        return []

    @cached_property
    def _fresh(self) -> Search:
        """What `memory` copies."""
        dim, n_par, s = self.shape.dim, self.shape.parameters, self.shape.constants.s
        degree = 1 << (min(max(2 * s, LEAST), MOST) - 1).bit_length()
        terms = s + 1 if s < LOW else s
        numbers = {
            "count": len(self.events), "dim": dim, "degree": degree, "chunks": degree // 8, "terms": terms,
            "groups": -(-terms // 8), "parameters": n_par, "made_rows": 1 + dim + n_par,
        }  # fmt: skip
        cosines, transforms = _tables()
        memory = Search(numbers, {"cosines": cosines})
        if terms > s:
            x, weights = np.polynomial.legendre.leggauss(NODES)
            polynomial = np.polynomial.legendre.Legendre.basis(s)(x) * (2.0 * s + 1.0) ** 0.5
            memory.gauss[:] = np.append((1.0 + x) / 2.0, polynomial * weights / 2.0)
        memory.steps, memory.transforms, memory.functions = steps, transforms, self.functions
        memory.actions = [self.actions.get(name) for name in self.events]
        memory.directions[:] = [event.direction for event in self.events.values()]
        memory.limits[:] = [event.last for event in self.events.values()]
        return memory


def room_for(numbers: int) -> int:
    """Return how many occurrences of so many numbers are kept until Python asks, to begin with."""
    return max(8, min(HITS, NUMBERS // numbers))


@dataclass(frozen=True, eq=False)
class Log:
    """Occurrences of events in the order in which they were found: room for them, or a part of it."""

    times: Array
    states: Array
    after: Array
    events: NDArray[np.int64]
    directions: NDArray[np.int64]
    par: Array
    members: NDArray[np.int64]

    @classmethod
    def of(cls, memory: Search, room: int) -> "Log":
        """Give a search room for so many, and return it."""
        states, after = np.empty((2, room, memory.dim))
        events, directions, members = np.empty((3, room), np.int64)
        par = np.empty((room, memory.parameters))
        log = cls(np.empty(room), states, after, events, directions, par, members)
        memory.point({f"hit_{name}": array for name, array in vars(log).items()})
        memory.room = room
        return log

    def chosen(self, which: Any) -> "Log":
        """Return a copy of some."""
        return Log(*(array[which].copy() for array in vars(self).values()))

    @classmethod
    def joined(cls, logs: Sequence["Log"]) -> "Log":
        """Return several as one."""
        return cls(*map(np.concatenate, zip(*(vars(log).values() for log in logs), strict=True)))


@dataclass(frozen=True, eq=False)
class Lent:
    """The memory of a search.

    Attributes
    ----------
    memory : Search
        With room for what it finds.
    begun : Search
        What that begins with.
    log : Log
        The room.
    """

    memory: Search
    begun: Search
    log: Log


class KernelSearch:
    """Looks for events in the steps of a trajectory; satisfies `integrators.events.finder.Finder`.

    Parameters
    ----------
    sought : Sought
        The events.
    contexts : pair of Context
        Of the trajectory, and for partial steps; the solver of steps need not be there.
    end : float
        The time up to which is looked.

    Raises
    ------
    UserError
        With what a function raises at the start.
    """

    def __init__(self, sought: Sought, contexts: tuple[Context, Context], end: float):
        self._sought = sought
        self._context, _ = contexts
        self._dim, sign = self._context.shape.dim, 1.0 if end >= self._context.t0 else -1.0
        self._lent = sought.lent(contexts)
        memory, self._log = self._lent.memory, self._lent.log
        self._memory = memory
        memory.last, memory.sign = end, sign
        self._hits = EventLog(sought.events, memory.sign, self._dim, memory.parameters)
        self.trouble: tuple[Status, str, Exception | None] | None = None
        if self._look(START) != DONE:
            error = self._error
            raise UserError(error) from error
        self._context.events.code, self._context.events.memory = look, memory
        self._context.events.act = int(bool(sought.actions))
        self._context.events.acted = -memory.sign * np.inf

    def __del__(self) -> None:
        if hasattr(self, "_lent"):
            self._sought.give_back(self._lent)

    def _look(self, mode: int) -> int:
        self._memory.mode = mode
        outcome = look(self._context, self._memory)
        self._memory.mode = WHOLE
        return outcome

    @property
    def _error(self) -> Exception:
        """What a function has raised; Ctrl-C and the like are raised as they are."""
        raised = self._memory.raised
        if raised > 0:
            error = self._sought.functions[raised - 1].error
        else:
            error = self._sought.actions[self._hits.names[-1 - raised]].error
        if isinstance(error, Exception):
            return error
        assert error is not None
        raise error

    def attend(self) -> bool:
        """Do what a look has come back for; return whether the integration goes on."""
        memory = self._memory
        halted, enough = memory.halted, memory.hits > memory.room // 2
        self.hits  # noqa: B018 -- makes room
        if halted == FULL and not enough:
            self._log = Log.of(memory, 2 * memory.room)
        if halted in (RAISED, UNRESOLVED, UNSOLVABLE, UNDEFINED):
            self._give_up(halted)
            return not self._context.events.act  # what an action would have changed is not known any more
        return halted != TERMINAL

    def _give_up(self, halted: int) -> None:
        """Look for nothing any more, and say why; the trajectory goes on."""
        self._context.events.code = None
        memory = self._memory
        known = f"are known up to t = {memory.known!r} only."
        if halted == RAISED:
            error = self._error
            known = f"events {known}"
            if memory.raised < 0:
                known = f"then of the event {self._hits.names[-1 - memory.raised]!r} at t = {memory.time!r}."
            self.trouble = Status.USER_ERROR, f"{UserError(error)}: {known}", error
            return
        if halted == UNDEFINED:
            name, t = self._hits.names[memory.event], memory.time
            reason = f"then of the event {name!r} returns a number that is not finite at t = {t!r}."
            self.trouble = Status.NOT_FINITE, reason, None
            return
        reason = f"the partial step from t = {memory.known!r} to t = {memory.goal!r} cannot be solved."
        if halted == UNRESOLVED:
            reason = (
                f"the event {self._hits.names[memory.event]!r} varies too fast to be followed between t = "
                f"{memory.start!r} and {memory.end!r}, where {FINEST} samples do not show "
                "how: give the method shorter steps, or the event a smoother function."
            )
        self.trouble = Status.STALLED, f"{reason} Events {known}", None

    @property
    def hits(self) -> EventLog:
        """What has happened."""
        if n := self._memory.hits:
            log = self._log.chosen(slice(n))
            self._hits.take(log.times, log.states, log.after, log.events, log.directions, log.par)
            self._memory.hits = 0
        return self._hits

    def resume(self, counts: Sequence[int], directions: Sequence[int], *, again: bool) -> None:
        """Go on where events have happened before; see `integrators.events.finder.Finder`."""
        self._memory.happened[:] = self._hits.counts[:] = counts
        self._memory.due[:] = (np.array(directions) != 0) * (1 if again else NOTED)
        if self._look(START) != DONE:
            raise UserError(self._error) from self._error

    @property
    def parameters(self) -> Array:
        """The parameters that the last actions have made; shape (n_par,)."""
        return self._memory.new_par.copy()

    def finish(self, end: float) -> None:
        """Look at what there is of the step ahead, which is solved, up to a time."""
        if self._context.events.act:  # the step has been looked at when it was solved
            return
        self._memory.goal = end
        while self._context.events.code and self._look(PART) != DONE and self.attend():
            pass

    @property
    def unknown(self) -> list[str]:
        """The events whose functions were finite nowhere."""
        return [name for name, known in zip(self._hits.names, self._memory.finite, strict=True) if not known]

    def save(self) -> dict[str, Any]:
        """Return what the rest of the search depends on; the trajectory has its own `checkpoint`."""
        arrays = {name: getattr(self._memory, name).copy() for name in LASTING}
        return {
            "arrays": arrays, "known": self._memory.known, "work": self.work(), "hits": self.hits.save(),
            "trouble": self.trouble,
        }  # fmt: skip

    def load(self, kept: Mapping[str, Any]) -> None:
        """Go on from where `save` was called."""
        for name, array in kept["arrays"].items():
            getattr(self._memory, name)[:] = array
        self._memory.known, self._memory.partial_steps = kept["known"], kept["work"]["partial_steps"]
        self._memory.evaluations, self._memory.iterations = (
            kept["work"][name] for name in ("evaluations", "iterations")
        )
        self._hits.load(kept["hits"])
        self.trouble = kept["trouble"]
        if self.trouble is not None:
            self._context.events.code = None

    def work(self) -> dict[str, int]:
        """Return what the search has cost."""
        memory = self._memory
        return {
            "partial_steps": memory.partial_steps, "evaluations": memory.evaluations,
            "iterations": memory.iterations,
        }  # fmt: skip
