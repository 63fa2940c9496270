"""How the length of a step follows from estimated errors: what all steps of varying length share."""

from math import exp, log

from integrators.kernel.native.jit import compiled

SAFETY, SHRINK = 0.9, 0.2  # of the length from one step to the next
RECOIL = 0.7  # of what would have met the tolerance, after a step whose error was too large (logarithms)
TRUST = 0.2  # of a trend to longer steps
LOG_SHRINK = log(SHRINK / SAFETY)
# Fast modes at rest show neither in the error nor in the first iterations. Where the iteration failed, steps
# stay this much shorter at first, and then approach that length again by this factor a step.
RETREAT, APPROACH = 0.5, 1.02
SHORTEST = 2.0**-48  # of the time: a shorter step cannot be told from none
NOTHING = 1e-6  # of the largest size in its group: a smaller block may have any error up to this
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
    if behind < INFINITY:
        trend = change + behind - estimate
        factor += trend if trend < 0.0 else TRUST * trend
    return factor


@compiled
def bounded(factor, grow):
    """Return the factor of a step's length that belongs to a logarithm, within its bounds."""
    if not factor > LOG_SHRINK:  # a NaN too
        return SHRINK
    return max(SHRINK, min(grow, SAFETY * exp(factor)))
