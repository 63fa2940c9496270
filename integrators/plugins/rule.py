"""The numbers of the stage solvers outside the kernel: SciPy's for Python functions, diffrax's, REBOUND's.

They are the kernel's own where it has them (`integrators.kernel.step.rule`, which says what they were
measured by).
"""

from integrators.kernel.step.rule import FARTHEST, FLOOR, STAGNATION, STAGNATION_LIMIT, is_rounding
from integrators.kernel.step.rule import MOST_ITERATIONS as MAX_ITERATIONS
from integrators.kernel.step.rule import TOLERANCE as CONVERGED

__all__ = [
    "CONVERGED",
    "FARTHEST",
    "FLOOR",
    "MAX_ITERATIONS",
    "MODES",
    "STAGNATION",
    "STAGNATION_LIMIT",
    "is_rounding",
]

MODES = 13  # extrapolated, as `integrators.kernel.tables` at fixed steps: P_j(2) grows like 5.8^j
