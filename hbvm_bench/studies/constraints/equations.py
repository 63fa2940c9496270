"""The compiled functions of a system with constraints that methods with equations of their own take."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from problems import Constrained, targets
from problems.problem import Problem, System


class Equations(NamedTuple):
    """The functions, ``f(t, y, par, out)`` compiled with numba.

    Attributes
    ----------
    scale, force : callable
        c and f of ``q' = c p, p' = f - G' lambda``.
    constraints, entries : callable
        g, and the entries of G that are not identically 0,
    rows, columns : ndarray of int
        their constraints and coordinates.
    dof, n : int
        Number of coordinates, and of constraints.
    """

    scale: Any
    force: Any
    constraints: Any
    entries: Any
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    dof: int
    n: int

    @classmethod
    def of(cls, system: System) -> "Equations":
        """Return those of a `Constrained` system."""
        assert isinstance(system, Constrained)
        assert system.dof is not None
        slopes = system.slopes("constraints")
        return cls(
            targets.numba(system.free, "velocity_scale"),
            targets.numba(system.free, "force"),
            targets.numba(system, system.invariants["constraints"]),
            targets.numba(system, slopes.function),
            slopes.rows,
            slopes.columns,
            system.dof,
            slopes.shape[0],
        )


def refusal(problem: Problem) -> str | None:
    """Return why there are no such equations for a problem; ``None`` if there are."""
    system = problem.system
    fits = isinstance(system, Constrained) and system.free.separable and "energy" in system.invariants
    return None if fits else "it needs constraints, momenta p = m q' and no friction."
