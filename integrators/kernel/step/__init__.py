"""A step and its parts in compiled code."""
