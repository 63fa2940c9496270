"""Gravitating bodies: problems of them, orbital elements, additional forces, mergers."""

from problems.bodies.forces import J2, Migration, PostNewtonian, RadiationPressure, Tides, Zonal
from problems.bodies.mergers import Merged, contacts, merge
from problems.bodies.nbody import nbody
from problems.bodies.orbits import Elements, Orbit
from problems.bodies.states import bodies_of, elements, starts
from problems.bodies.units import Units

__all__ = [
    "J2",
    "Elements",
    "Merged",
    "Migration",
    "Orbit",
    "PostNewtonian",
    "RadiationPressure",
    "Tides",
    "Units",
    "Zonal",
    "bodies_of",
    "contacts",
    "elements",
    "merge",
    "nbody",
    "starts",
]
