"""Compiled code: made, kept, loaded and called."""
