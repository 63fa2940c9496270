"""Trajectories in lanes with tangent vectors: steps of a system that has these among its components.

With fixed steps a Runge-Kutta method commutes with differentiation: on ``y' = f(y)`` together with
``d' = f'(y) d`` its end is its own derivative. So a trajectory and its vectors are one trajectory of a larger
system, whose stages are the vectors' rows and then those of the trajectory, and whose blocks are those of the
trajectory and one for each vector (one for its positions and one for its momenta), with sizes of their own.
"""

import numpy as np

from integrators.kernel.ensemble.prepared import STAGES, Lanes, blocks_of
from integrators.kernel.native.memory import Numbers
from integrators.kernel.tables import Constants
from integrators.kernel.tangent.vectors import OPERATIONS
from problems.graph.nodes import reachable
from problems.systems.base import System

MOST_ROWS = 64
"""Components of a stage, vectors included: beyond, trajectories go one by one."""


class VectorLanes(Lanes):
    """HBVM(k, s) with fixed steps on trajectories in lanes, each with tangent vectors.

    Parameters
    ----------
    system : System
        What is integrated; traced, its field can run on lanes.
    constants : Constants
        The method's, of the second-order form or of the first.
    unit : bool
        As for `Lanes`.
    count : int
        Vectors, n >= 1.
    moves : bool
        Whether they have parts in the parameters; then in second-order form the velocities do not depend on
        these.

    Raises
    ------
    numba.NumbaError
        If parameters that differ from lane to lane keep the field from running on lanes.
    """

    def __init__(self, system: System, constants: Constants, unit: bool, count: int, moves: bool):
        self.count, self._moves = count, moves
        second = constants.second
        self._own = own = system.dof if second and system.dof is not None else system.dim
        self._halves = system.dim // own
        self.rows, self.dim = own * (1 + count), system.dim * (1 + count)
        self.parameters = system.n_par * (1 + count if moves else 1)
        along = system.tangent("force" if second else "field", count, parameters=moves, beside=True)
        first = own * count
        blocks = blocks_of(system, second, own) | {"first": first}
        half = own if second or system.dof is None else system.dof
        vectors = {"first": 0, "groups": first // half, "count": 1, "width": half}
        self._compile(system, constants, along, second, unit, False, blocks, vectors)

    @staticmethod
    def take(system: System, constants: Constants, count: int) -> bool:
        """Whether a trajectory with so many vectors has few enough components and operations."""
        second = constants.second
        rows = (system.dim // 2 if second else system.dim) * (1 + count)
        operations = len(reachable(system.function("force" if second else "field").roots))
        few = rows <= MOST_ROWS and count * operations <= OPERATIONS
        return few and constants.k <= STAGES

    def join(self, y: Numbers, vectors: Numbers) -> Numbers:
        """Return states and vectors, (..., dim) and (..., dim, n), as states of the larger system."""
        members = np.concatenate([np.swapaxes(vectors, -1, -2), y[..., np.newaxis, :]], axis=-2)
        halves = members.reshape(*members.shape[:-1], self._halves, self._own)
        return np.ascontiguousarray(np.swapaxes(halves, -2, -3)).reshape(*y.shape[:-1], self.dim)

    def split(self, states: Numbers) -> tuple[Numbers, Numbers]:
        """Return the states and vectors, (..., dim) and (..., dim, n), that `join` has made one of."""
        shape = states.shape[:-1]
        halves = states.reshape(*shape, self._halves, 1 + self.count, self._own)
        members = np.swapaxes(halves, -2, -3).reshape(*shape, 1 + self.count, self.system.dim)
        vectors = np.swapaxes(members[..., :-1, :], -1, -2)
        return np.ascontiguousarray(members[..., -1, :]), np.ascontiguousarray(vectors)

    def join_parameters(self, par: Numbers, vectors: Numbers) -> Numbers:
        """Return parameters, (n, n_par), and the vectors' parts in them, (n, n_par, k), as its parameters."""
        if not self._moves:
            return par
        return np.concatenate([par[:, np.newaxis], np.swapaxes(vectors, 1, 2)], axis=1).reshape(len(par), -1)

    def velocities(self, par: Numbers) -> Numbers:
        """Return q' = velocity * p of all trajectories and vectors, shape (n, rows)."""
        if not self.second:
            return np.ones((len(par), self.rows))
        own = super().velocities(np.ascontiguousarray(par[:, : self.system.n_par]))
        return np.tile(own, (1, 1 + self.count))
