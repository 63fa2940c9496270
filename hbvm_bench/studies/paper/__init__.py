"""The seed paper's experiments, run again: ``hbvm-bench paper``.

L. Brugnano, F. Iavernaro, T. Susca, "Numerical comparisons between Gauss-Legendre
methods and Hamiltonian BVMs defined over Gauss points".

One module computes an experiment, one (``*_figures``, ``sitnikov_beyond``) draws it, and one (``*_part``)
lists what is computed, what the paper claims beside what came out, and what is shown: ``sitnikov*`` (with
``axis_motion``), ``henon_heiles*``, ``period_annulus*``, ``properties*``; ``others`` runs the established
libraries.
"""
