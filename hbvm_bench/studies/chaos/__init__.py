"""Chaos: ``hbvm-bench chaos``, exponents of known systems, and maps of where motion is chaotic.

``systems`` lists what is known, ``exponents``, ``maps`` and ``orbits`` compute, ``report`` says and
``figures`` draws it.
"""
