"""Hamiltonian and other systems, written down once and given to every engine alike."""
