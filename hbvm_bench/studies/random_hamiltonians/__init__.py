"""Random Hamiltonians: how often an integrator reports success and is wrong."""
