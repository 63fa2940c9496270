"""Established integrators of other libraries behind the stepper protocol: heyoka, REBOUND, diffrax, SciPy.

The modules are named after the libraries; each imports its library only when a
method is compiled, so importing a module here costs nothing and needs nothing
installed.
"""
