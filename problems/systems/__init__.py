"""Dynamical systems: Hamiltonian and Poisson systems, any first-order system, opaque code."""
