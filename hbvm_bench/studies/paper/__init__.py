"""The original paper's experiments, run again: ``hbvm-bench paper``.

L. Brugnano, F. Iavernaro, T. Susca, "Numerical comparisons between Gauss-Legendre
methods and Hamiltonian BVMs defined over Gauss points".

The modules of ``experiments`` compute. Here, each ``*_part`` lists what is computed, what the paper claims
beside the results, and what is shown; ``*_figures`` and ``sitnikov_beyond`` draw it.
"""
