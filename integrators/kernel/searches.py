"""Searches for events that leave their memory to the next trajectory of a program."""

from collections.abc import Mapping, Sequence

from integrators.events.event import Event
from integrators.kernel.inside.functions import Action, EventFunction
from integrators.kernel.inside.search import KernelSearch
from integrators.kernel.spare import Pair, Searched, Spare


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
        memory = before.memory if before is not None and before.functions is functions else None
        super().__init__(events, functions, actions, (pair.own, pair.partial), end, memory)
        pair.searched = Searched(functions, self._memory)

    def give_when_over(self, spare: Spare, pair: Pair) -> None:
        """Leave the memory to others when nobody refers to this search: its trajectory is over."""
        self._left = spare, pair

    def __del__(self) -> None:
        if self._left is not None:
            spare, pair = self._left
            spare.give(pair)
