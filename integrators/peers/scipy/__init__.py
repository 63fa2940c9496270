"""SciPy's initial value solvers, with compiled vector fields."""

from integrators.peers.scipy.methods import BDF, DOP853, LSODA, RTOL_FLOOR, Radau

__all__ = ["BDF", "DOP853", "LSODA", "RTOL_FLOOR", "Radau"]
