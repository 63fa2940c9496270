"""The benchmark: what each integrator conserves, and at what cost."""
