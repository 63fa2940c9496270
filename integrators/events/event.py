"""What a user says about an event."""

import operator
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np

from problems.calls import Called
from problems.errors import InputError, shown


@dataclass(frozen=True)
class Event(Called):
    """Where ``g`` vanishes along the trajectory.

    Parameters
    ----------
    g : callable
        A number, from the arguments that it names among ``t, q, p, y, par, m``, as a
        Hamiltonian is written. It is traced once and then runs on whole arrays. What
        cannot be traced (comparisons, NumPy, any other code) is called with numbers
        instead, state by state, which is slow.
    direction : {0, 1, -1}
        1: only where g rises in the order in which states are passed (also backwards in
        time), -1: only where it falls, 0: everywhere, also where g touches zero.
    terminal : bool or int
        True: the integration ends at the first occurrence; a number n: at the n-th.
    name : str, optional
        What it is called in the solution; the function's own name by default.

    Raises
    ------
    problems.errors.InputError
        For values outside these ranges.

    Examples
    --------
    >>> from integrators import Event
    >>> Event(lambda q: q[0], direction=1)
    Event(g=<function ...>, direction=1, terminal=False, name=None)
    """

    g: Callable[..., Any]
    _: KW_ONLY
    direction: int = 0
    terminal: bool | int = False
    name: str | None = None

    def __post_init__(self) -> None:
        if not callable(self.g):
            raise InputError(f"an event needs a function g, not {shown(self.g)}.")
        if _whole(self.direction) not in (-1, 0, 1):
            raise InputError(f"direction={shown(self.direction)} of an event must be 1, -1 or 0 (both).")
        object.__setattr__(self, "direction", _whole(self.direction))
        last = None if isinstance(self.terminal, float) else _whole(self.terminal)
        if last is None or not 0 <= last < 2**63:
            raise InputError(
                f"terminal={shown(self.terminal)} of an event must be True, False, or a count >= 1."
            )
        if self.name is not None and not (isinstance(self.name, str) and self.name):
            raise InputError(f"name={shown(self.name)} of an event must be a text.")

    @property
    def last(self) -> int:
        """The occurrence that ends the integration; 0: none."""
        return int(self.terminal)


def _whole(value: Any) -> int | None:
    """Return a whole number as an int, also one of NumPy's; ``None`` for anything else."""
    try:
        return operator.index(value)
    except TypeError:
        return int(value) if isinstance(value, float | np.bool_) and value in (-1.0, 0.0, 1.0) else None


def named(events: Any) -> dict[str, Event]:
    """Return the events by their names, from one event, one function, or a sequence of them.

    Raises
    ------
    problems.errors.InputError
        For anything else, or two events of one name.
    """
    listed = list(events) if isinstance(events, Sequence) else [events]
    made = [event if isinstance(event, Event) else Event(event) for event in listed]
    found: dict[str, Event] = {}
    for i, event in enumerate(made):
        own = getattr(event.g, "__name__", "<lambda>")
        plain = own if own.isidentifier() else ("event" if len(made) == 1 else f"event_{i}")
        name = event.name or plain
        if name in found:
            raise InputError(f"two events have the name {name!r}; give one of them another with name=.")
        found[name] = event
    return found
