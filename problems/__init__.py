"""Hamiltonian and other systems: every integrator receives the same vector field from one definition."""

from problems.bodies import nbody
from problems.errors import InputError, MissingLibraryError, UnknownNameError
from problems.problem import Problem
from problems.registry import load, names
from problems.symbolic import from_sympy
from problems.systems.base import Bodies, System
from problems.systems.constrained import Constrained
from problems.systems.hamiltonian import Hamiltonian
from problems.systems.lagrangian import Lagrangian
from problems.systems.opaque import Opaque
from problems.systems.poisson import Poisson
from problems.systems.vector_field import VectorField

__all__ = [
    "Bodies",
    "Constrained",
    "Hamiltonian",
    "InputError",
    "Lagrangian",
    "MissingLibraryError",
    "Opaque",
    "Poisson",
    "Problem",
    "System",
    "UnknownNameError",
    "VectorField",
    "from_sympy",
    "load",
    "names",
    "nbody",
]
