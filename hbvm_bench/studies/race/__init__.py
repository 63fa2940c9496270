"""The race: which integrator is the fastest at the same accuracy."""
