"""How much of a sum its rounding may be: compiled code has this number too, and nothing else of here."""

ROUNDING = 2.0**-50
"""Part of the sum of its absolute terms, the largest so far, by which rounding may change a value."""
