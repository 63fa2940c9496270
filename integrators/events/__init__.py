"""Events: where a function of time and state vanishes along a trajectory."""

from integrators.events.event import Event
from integrators.events.section import section
from integrators.solution import Occurrences

__all__ = ["Event", "Occurrences", "section"]
