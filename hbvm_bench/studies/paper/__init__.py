"""The seed paper's experiments, run again: ``hbvm-bench paper``.

L. Brugnano, F. Iavernaro, T. Susca, "Numerical comparisons between Gauss-Legendre
methods and Hamiltonian BVMs defined over Gauss points".

One module computes an experiment, one draws it, one says what the paper claims and
what came out: ``sitnikov*`` (with ``axis_motion``), ``henon_heiles*``,
``period_annulus*``, ``properties*``; ``others`` runs the established libraries.
"""
