"""The bench: which integrator keeps what, at what cost."""
