"""How a product of the kernel is done, where that is not told by a number of columns, and its tables."""

WIDE, THROUGH = 0, 1
"""A matrix of more columns than the field takes stages at a time, and by way of coefficients."""

FEW_ROWS = 4
"""Components of a stage up to which whole iterations are compiled with the field."""

PER_OCTAVE = 32
"""Ratios of two steps for which there are tables, from one power of two to the next."""
