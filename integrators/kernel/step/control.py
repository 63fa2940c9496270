"""How the length of a step follows from estimated errors: what all steps of varying length share."""

from math import log

from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.operations import binary_log

SAFETY, SHRINK = 0.9, 0.2  # of the length from one step to the next
RECOIL = 0.7  # of what would have met the tolerance, after a step whose error was too large (logarithms)
TRUST = 0.2  # of a trend to longer steps
# Part of the way to a longer step, and how much may be missing there: smooth steps are not rejected and start
# well (logarithms).
CAUTION, HELD = 0.5, 0.25
LOG_SHRINK = log(SHRINK / SAFETY)
LOG_2 = log(2.0)
# Fast modes at rest show neither in the error nor in the first iterations. Where the iteration failed, steps
# stay this much shorter at first, and then approach that length again by this factor a step.
RETREAT, APPROACH = 0.5, 1.02
SHORTEST = 2.0**-48  # of the time: a shorter step cannot be told from none
CLOSE = 2.0**-50  # times whose relative difference is at most this are the same
INFINITY = float("inf")
TINY = 1e-300  # an estimated error of 0 counts as this


@compiled
def log_factor(aim, estimate, behind, change):
    """Return the logarithm of the next step's length relative to this one's, from estimated errors.

    The length that would have met the tolerance, corrected by how it changed over
    the last step, which foresees an approach (K. Gustafsson, "Control-theoretic
    techniques for stepsize selection in implicit Runge-Kutta methods", ACM TOMS 20
    (1994) 496-517). A step whose error is too large is shortened by less than that:
    its end, where most of the error comes from, is then not reached any more.

    Parameters
    ----------
    aim, estimate, behind : float
        Logarithms of the tolerance, of the estimated error of this step, and of that of
        the step before (infinite: unknown), each divided by the order of the error.
    change : float
        Logarithm of this step's length relative to that of the step before.
    """
    factor = aim - estimate
    if factor < 0.0:
        return RECOIL * factor
    factor = max(CAUTION * factor, factor - HELD)
    if behind < INFINITY:
        trend = change + behind - estimate
        factor += trend if trend < 0.0 else TRUST * trend
    return factor


@compiled
def log_size(x):
    """Return the logarithm of a number > 0, too small by up to 0.06: enough where an order divides it."""
    return LOG_2 * binary_log(x)


@compiled
def log_ratio(x):
    """Return the logarithm of a number near 1: within 6e-4 between 0.83 and 1.2, 0.03 between 0.5 and 2."""
    return 2.0 * (x - 1.0) / (x + 1.0)


@compiled
def bounded(factor, grow):
    """Return the factor of a step's length that belongs to a logarithm, within its bounds."""
    if not factor > LOG_SHRINK:  # a NaN too
        return SHRINK
    root = 1.0 + 0.125 * factor  # exp(factor) is its eighth power: within 1 % for lengths up to 1.4 times
    fourth = (root * root) * (root * root)
    return max(SHRINK, min(grow, SAFETY * (fourth * fourth)))
