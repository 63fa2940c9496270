"""Gravitating bodies: problems of them, additional forces, mergers."""

from problems.bodies.mergers import Merged, contacts, merge
from problems.bodies.nbody import J2, PostNewtonian, bodies_of, nbody

__all__ = ["J2", "Merged", "PostNewtonian", "bodies_of", "contacts", "merge", "nbody"]
