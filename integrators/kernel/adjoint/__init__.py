"""Gradients of what a trajectory ends with: its steps, recorded and followed backwards."""
