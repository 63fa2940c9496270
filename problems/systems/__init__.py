"""What is integrated: Hamiltonian and Poisson systems, any first-order system, foreign code."""
