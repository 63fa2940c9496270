"""What a tolerance asks of the steps: the order of estimated errors, and all that follows from it.

The error of a step of length h is estimated by ``h |gamma_m|^2 / |gamma_0|``, where gamma_m, the Legendre
coefficient of the field of degree m, is of the size of h^m: an error of order 2m + 1. The quadrature's error
with k nodes is estimated in the same way by the last coefficient that they see, of degree k - 1.

Whoever chooses steps takes the order from here: one trajectory and trajectories in lanes
(`integrators.kernel.step.control` has what the next length follows from), tangent vectors, and the plugins
for SciPy, REBOUND and diffrax.
"""

from math import log

MARGIN = 0.9
"""Part of the length allowed that steps aim at, besides `integrators.kernel.step.control.SAFETY`.

Errors of order 25 and more vary strongly from step to step, and a rejected step costs as
much as one that is taken: with 1 a fifth of the steps are rejected and all problems of the
race take 5 to 20 % longer.
"""


def degree_of_error(k: int, s: int) -> int:
    """Return the degree of the coefficient that estimates the error of a step of HBVM(k, s)."""
    return s if k > s else s - 1  # P_s vanishes at the nodes of the rule with s nodes


def error_order(degree):  # compiled too
    """Return the order of the error that is estimated by the coefficient of a degree."""
    return 2.0 * degree + 1.0


def left_out(part, gamma, mean):  # compiled too
    """Return ``part (gamma / mean)``: with h and for part = gamma, the estimated error of a step.

    Parameters
    ----------
    part : float or array
        gamma, or components of it.
    gamma, mean : float
        Sizes of the coefficient that is left out, and of the field, in the same norm.
    """
    return part * (gamma / mean)


def aim(tol: float, degree: int) -> float:
    """Return what steps aim at: the logarithm of the tolerance divided by the order, and of `MARGIN`."""
    return log(tol) / error_order(degree) + log(MARGIN)


def decay(tol: float, degree: int) -> float:
    """Return the factor from one coefficient of a smooth field to the next, the error being the tolerance."""
    return tol ** (0.5 / degree)
