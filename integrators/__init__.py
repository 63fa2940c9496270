"""HBVM and Gauss integrators, and the established libraries behind one stepper protocol."""
