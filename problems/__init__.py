"""Hamiltonian and other systems, written down once and given to every engine alike."""

from problems.errors import InputError, MissingLibraryError, UnknownNameError
from problems.foreign import Foreign
from problems.hamiltonian import Bodies, Hamiltonian, System, VectorField
from problems.poisson import Poisson
from problems.problem import Problem
from problems.registry import load, names

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
