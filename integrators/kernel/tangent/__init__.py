"""Tangent vectors that follow a trajectory: the derivatives of its steps, solved with their stages."""
