"""Hamiltonian and other systems, written down once and given to every engine alike."""

from problems.errors import InputError, MissingLibraryError, UnknownNameError
from problems.problem import Problem
from problems.registry import load, names
from problems.systems.hamiltonian import Bodies, Hamiltonian, System, VectorField
from problems.systems.poisson import Poisson
from problems.systems.untraced import Foreign

__all__ = [
    "Bodies",
    "Foreign",
    "Hamiltonian",
    "InputError",
    "MissingLibraryError",
    "Poisson",
    "Problem",
    "System",
    "UnknownNameError",
    "VectorField",
    "load",
    "names",
]
