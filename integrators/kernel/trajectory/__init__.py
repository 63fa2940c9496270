"""Whole trajectories: the lengths of adaptive steps, what ends a step, and states at the times asked for."""
