"""Arithmetic on lanes: vectors of doubles as numba values, their functions, loads and sums."""
