"""Events: where a function of time and state vanishes along a trajectory."""

from integrators.events.event import Event, Occurrences
from integrators.events.section import section

__all__ = ["Event", "Occurrences", "section"]
