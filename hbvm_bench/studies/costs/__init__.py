"""What a looser tolerance, a larger lattice, a call, a step and a fresh process cost: ``costs``."""
