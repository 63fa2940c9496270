"""Events: where a function of time and state vanishes along a trajectory."""

from integrators.events.event import Event
from integrators.solution.occurrences import Occurrences

__all__ = ["Event", "Occurrences"]
