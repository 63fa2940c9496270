"""HBVM and Gauss inside other libraries: SciPy, diffrax and REBOUND; derivatives of trajectories for PyTorch.

The modules are named after their hosts, and importing one imports its host;
where that is not installed, the error names the package to install.
"""
