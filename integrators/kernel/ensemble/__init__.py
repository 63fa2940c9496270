"""Trajectories in lanes: many initial conditions of one system, one in each lane of the vector unit."""
