"""Trajectories in lanes: many starts of one system, one in each lane of the vector unit."""
