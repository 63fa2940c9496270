"""Trusted solutions: stored ones, and how they are made."""
