"""SciPy's initial value solvers, with compiled vector fields."""

from integrators.peers.scipy.methods import DOP853, Radau

__all__ = ["DOP853", "Radau"]
