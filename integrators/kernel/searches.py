"""Searches for events that leave their memory to the next trajectory of a program."""

from collections.abc import Mapping, Sequence

import numpy as np

from integrators.events.event import Event
from integrators.events.finder import EventLog
from integrators.kernel.context import DONE
from integrators.kernel.engines import look
from integrators.kernel.inside.functions import Action, EventFunction
from integrators.kernel.inside.memory import START
from integrators.kernel.inside.search import KernelSearch, room_for
from integrators.kernel.spare import Pair, Searched, Spare
from integrators.protocol import UserError

FRESH = ("happened", "due", "due_directions")  # all else is set at the start, or before it is read


class LastingSearch(KernelSearch):
    """A search in the memory of the one before, where a pair has it from the same functions.

    Parameters
    ----------
    events, functions, actions, end
        As of `KernelSearch`.
    pair : Pair
        The memory of the trajectory, which keeps that of the search.
    """

    _left: tuple[Spare, Pair] | None = None

    def __init__(
        self, events: Mapping[str, Event], functions: Sequence[EventFunction], actions: Mapping[str, Action],
        pair: Pair, end: float,
    ):  # fmt: skip
        before = pair.searched
        if before is not None and before.functions is functions:
            self._take_over(before, events, functions, actions, pair, end)
            return
        super().__init__(events, functions, actions, (pair.own, pair.partial), end)
        pair.searched = Searched(functions, self._memory)

    def _take_over(
        self, before: Searched, events: Mapping[str, Event], functions: Sequence[EventFunction],
        actions: Mapping[str, Action], pair: Pair, end: float,
    ) -> None:  # fmt: skip
        """Do what `KernelSearch` does at its start, but for what the memory has."""
        self._functions, self._actions, self._memory = functions, actions, before.memory
        self._context, self._dim, self.trouble = pair.own, pair.own.shape.dim, None
        memory, numbers = self._memory, pair.own.events
        memory.last, memory.sign = end, 1.0 if end >= pair.own.t0 else -1.0
        memory.hits = memory.evaluations = memory.iterations = memory.partial_steps = 0
        for name in FRESH:
            getattr(memory, name)[:] = 0
        self._hits = EventLog(events, memory.sign, self._dim, memory.parameters)
        self._make_room(room_for(max(self._dim, memory.parameters)))
        if self._look(START) != DONE:
            error = self._error
            raise UserError(error) from error
        numbers.code, numbers.memory = look.code(), memory
        numbers.act, numbers.acted = int(bool(actions)), -memory.sign * np.inf

    def give_when_over(self, spare: Spare, pair: Pair) -> None:
        """Leave the memory to others when nobody refers to this search: its trajectory is over."""
        self._left = spare, pair

    def __del__(self) -> None:
        if self._left is not None:
            spare, pair = self._left
            spare.give(pair)
