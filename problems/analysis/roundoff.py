"""How much of a sum its rounding may be: compiled code has these numbers too, and nothing else of here."""

ROUNDING = 2.0**-50
"""Part of the sum of its absolute terms, the largest so far, by which rounding may change a value."""

UNIT = 2.0**-52
"""Distance of the doubles near 1."""
