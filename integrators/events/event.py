"""The definition of an event."""

import operator
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Annotated, Any

import numpy as np

from problems.checks import CheckedOptions, Must, refusal
from problems.errors import InputError, shown


def _whole(value: Any) -> int | None:
    """Return a whole number as an int, also one of NumPy's; ``None`` for anything else."""
    try:
        return operator.index(value)
    except TypeError:
        return int(value) if isinstance(value, float | np.bool_) and value in (-1.0, 0.0, 1.0) else None


class _Count:
    def checked(self, owner: str, name: str, value: Any) -> bool | int:
        count = _whole(value)
        if isinstance(value, float) or count is None or not 0 <= count < 2**63:
            raise refusal(owner, name, value, "True, False, or a count >= 1")
        return value


class _Direction:
    def checked(self, owner: str, name: str, value: Any) -> int:
        direction = _whole(value)
        if direction not in (-1, 0, 1):
            raise refusal(owner, name, value, "1, -1 or 0 (both)")
        return direction


@dataclass(frozen=True)
class Event(CheckedOptions):
    """An event: a zero of ``g`` along the trajectory.

    Parameters
    ----------
    g : callable
        A function that returns a number; its arguments are among ``t, q, p, y, par, m``, as for a
        Hamiltonian. It is traced once and then evaluated on whole arrays: a number that it takes from outside
        is the one at the first integration; for another number, make another event. A function that cannot
        be traced (comparisons, NumPy, any other code) is called with numbers for each state, which is slow.
    direction : {0, 1, -1}
        1: only zeros at which g increases in the direction of integration (also backwards in time), -1: only
        those at which it decreases, 0: all, also where g touches zero.
    terminal : bool or int
        True: the integration ends at the first occurrence; a number n: at the n-th.
    then : callable, optional
        Action of the event: a function of the same arguments that returns the new state, a list of dim
        numbers (q then p), such as a bounce or a kick. To change parameters it returns a tuple
        ``(state, {"name": value, ...})``, with ``None`` for an unchanged state. It is traced once and
        compiled, or else called with numbers, which takes some 30 µs. The integration continues from the new
        state; fixed steps are counted from there. For `HBVM` and `Gauss`.
    name : str, optional
        Name of the event in the solution; that of the function by default.

    Raises
    ------
    problems.errors.InputError
        For values outside these ranges.

    Notes
    -----
    Attributes ``terminal`` and ``direction`` of ``g``, as SciPy's events have them, are taken over.

    Examples
    --------
    >>> from integrators import Event
    >>> Event(lambda q: q[0], direction=1)
    Event(g=<function ...>, direction=1, terminal=False, then=None, name=None)
    >>> bounce = Event(lambda q: q[0], direction=-1, then=lambda q, p: [q[0], -0.9 * p[0]])
    >>> burnt = Event(lambda t: t - 9.0, then=lambda: (None, {"thrust": 0.0}))
    """

    g: Callable[..., Any]
    _: KW_ONLY
    direction: Annotated[int, _Direction()] = 0
    terminal: Annotated[bool | int, _Count()] = False
    then: Callable[..., Any] | None = None
    name: Annotated[str, Must("a text", lambda name: name)] | None = None

    def __post_init__(self) -> None:
        if not callable(self.g):
            raise InputError(f"an event needs a function g, not {shown(self.g)}.")
        if self.then is not None and not callable(self.then):
            raise InputError(f"then={shown(self.then)} of an event must be a function of the state.")
        self._take_attributes()
        super().__post_init__()

    def _take_attributes(self) -> None:
        """Take ``g.terminal`` and ``g.direction``, as SciPy's events have them."""
        for name, default in (("terminal", False), ("direction", 0)):
            value = getattr(self.g, name, None)
            if value is None:
                continue
            if name == "direction" and isinstance(value, float | int):
                value = (value > 0) - (value < 0)
            own = getattr(self, name)
            if own != default and own != value:
                raise InputError(
                    f"the event's function has {name}={shown(value)} and the event {name}={shown(own)}; "
                    "give one of them."
                )
            object.__setattr__(self, name, value)

    @property
    def last(self) -> int:
        """The occurrence that ends the integration; 0: none."""
        return int(self.terminal)


def named(events: Any) -> dict[str, Event]:
    """Return the events by their names, from one event, one function, or a sequence of them.

    Raises
    ------
    problems.errors.InputError
        For anything else, or two events of one name.
    """
    listed = list(events) if isinstance(events, Sequence) else [events]
    events_ = [event if isinstance(event, Event) else Event(event) for event in listed]
    by_name: dict[str, Event] = {}
    for i, event in enumerate(events_):
        own = getattr(event.g, "__name__", "<lambda>")
        plain = own if own.isidentifier() else ("event" if len(events_) == 1 else f"event_{i}")
        name = event.name or plain
        if name in by_name:
            raise InputError(f"two events have the name {name!r}; give one of them another with name=.")
        by_name[name] = event
    return by_name
