"""Whether a formula leaves the range of doubles on its way, where neither its arguments nor its result do."""

import numpy as np
from numpy.typing import NDArray

from problems.systems.base import System
from problems.targets import numpy as numpy_function

Array = NDArray[np.float64]

EXTREME = 1e75  # fourth powers of larger numbers, and of those below its inverse, are at the end of the range
# A component that is wrong by such a part is: rounding errs by more only where terms cancel,
LOST, CANCELLED = 1e-8, 1e-12  # and then, beside the largest component of its kind, by less than that.


def leaves_range(system: System, t: float, y: Array, par: Array) -> bool:
    """Whether the field is wrong at a state since what it is calculated from under- or overflows.

    It is compared with its value in numbers of a longer range, where the machine has them, and only if some
    of the numbers given are extreme.

    Parameters
    ----------
    system : System
        Traced; of another, nothing is known.
    t : float
        Time.
    y, par : ndarray, shapes (dim,) and (n_par,)
        State and parameters.
    """
    sizes = np.abs(np.concatenate([y, par]))
    extreme = (sizes > EXTREME) | ((sizes > 0.0) & (sizes < 1.0 / EXTREME))
    if not system.traced or not extreme.any() or np.finfo(np.longdouble).maxexp <= np.finfo(float).maxexp:
        return False
    field = numpy_function(system, "field")
    there = field(t, y.astype(np.longdouble), par.astype(np.longdouble))
    apart = np.abs(field(t, y, par) - there)
    beside = np.repeat(np.abs(there).reshape(2, -1).max(axis=1), system.dof) if system.dof else 0.0
    return not bool(np.all(apart <= LOST * np.abs(there) + CANCELLED * beside))
