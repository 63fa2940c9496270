"""Gauss collocation in double-double arithmetic: 32 digits."""
