"""The noise of a field, and the sentence that ends a run by it."""

import math
from collections.abc import Callable

import numpy as np

from integrators.protocol import Array, Status

POINTS, DEGREES = 9, (4, 5, 6)
# Distance of the points beside the size of the state: a field in single precision changes from each to the
# next, and differences of such degrees vanish for smooth functions.
APART = 2.0**-20
UNIT, BEYOND_ROUNDING = 2.0**-52, 100.0
MARGIN = 100.0  # times what noise adds in a step is a tolerance that can be had
MOST = 1e-3  # a looser tolerance is no advice


def field_noise(field: Callable[[Array], Array], y: Array) -> Array:
    """Return the standard deviation of the noise of a field near a state, for each component.

    By J. J. More and S. M. Wild, "Estimating computational noise", SIAM J. Sci. Comput. 33 (2011) 1292-1314:
    differences of high degree on a line through the state are those of noise alone, and of degree m they are
    sqrt((2m)!)/m! times as large as that. The least is taken, of some degrees, and of two lines that begin at
    the state in opposite directions: a discontinuity is on one of them.

    Parameters
    ----------
    field : callable
        Returns the derivatives at a state.
    y : array, shape (dim,)

    Returns
    -------
    array, shape (dim,)
        0 where rounding of the state and of the derivatives explains what is found, or the field is not
        finite.
    """
    size = np.abs(y).max()
    away = APART * np.where(y != 0.0, np.abs(y), size)
    found, rounding = np.full(len(y), np.inf), np.zeros(len(y))
    for side in (away, -away):
        differences = np.array([field(y + i * side) for i in range(POINTS)])
        values = np.abs(differences).max(axis=0)
        for degree in range(1, max(DEGREES) + 1):
            differences = np.diff(differences, axis=0)
            if degree == 1:
                steep = np.abs(differences).max(axis=0) / APART
                rounding = np.maximum(rounding, UNIT * np.maximum(values, steep))
            if degree in DEGREES:
                part = math.factorial(degree) ** 2 / math.factorial(2 * degree)
                found = np.minimum(found, np.sqrt(part * np.mean(differences**2, axis=0)))
    return np.where(np.isfinite(found) & (found > BEYOND_ROUNDING * rounding), found, 0.0)


def noisy(t: float, h: float, added: float) -> tuple[Status, str]:
    """Return the status of a run that the noise of the field has ended, and the reason as a sentence.

    Parameters
    ----------
    t, h : float
        Start and length of the step.
    added : float
        What noise adds to the state in it, relative to its size.
    """
    tolerance = 10.0 ** math.ceil(math.log10(MARGIN * added))
    advice = "give a field that is smooth to rounding"
    if tolerance <= MOST:
        advice += f", or tol={tolerance:.0e} or more"
    return Status.NONLINEAR_DIVERGENCE, (
        f"the values of the vector field have noise: in a step of h = {h!r} from t = {t!r} it adds "
        f"{added:.0e} of the state's size; {advice}."
    )
