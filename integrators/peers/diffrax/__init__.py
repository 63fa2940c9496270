"""diffrax's solvers behind the stepper protocol."""
