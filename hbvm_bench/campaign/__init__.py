"""What is asked for: a campaign file, its grids and sweeps, and the identity of each of its cases."""
