"""The compiled core of our integrators."""
