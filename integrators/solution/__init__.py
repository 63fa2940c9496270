"""What an integration returns: one trajectory, or many of one problem, in memory and in files."""

from integrators.solution.ensemble import Solutions, load
from integrators.solution.occurrences import Occurrences
from integrators.solution.record import Solution

__all__ = ["Occurrences", "Solution", "Solutions", "load"]
