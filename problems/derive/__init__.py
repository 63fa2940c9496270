"""Derivatives of a graph: gradients, products with vectors, Jacobians."""
