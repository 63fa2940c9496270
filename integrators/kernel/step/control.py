"""How the length of a step follows from estimated errors: what all adaptive steps share."""

from math import log

from integrators.kernel import tolerance
from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.operations import binary_log, greatest, least, opposite, size, where

SAFETY, SHRINK = 0.9, 0.2  # of the length from one step to the next
# Of what would have met the tolerance, after a step whose error was too large (logarithms)
SHRINK_EXPONENT = 0.7
TRUST = 0.2  # of a trend to longer steps
# Part of the way to a longer step, and how much may be missing there: smooth steps are not rejected and start
# well (logarithms).
CAUTION, SHORTFALL = 0.5, 0.25
LOG_SHRINK = log(SHRINK / SAFETY)
STEADY = 1.2  # an implicit step that could be longer by less keeps its length, and so the factors
LOG_STEADY = log(STEADY / SAFETY)
LOG_2 = log(2.0)
# Fast modes at rest show neither in the error nor in the first iterations. Where the iteration failed, steps
# stay this much shorter at first, and then approach that length again by this factor a step.
RETREAT, APPROACH = 0.5, 1.02
SHORTEST = 2.0**-48  # of the time: a shorter step cannot be told from none
TIME_TOLERANCE = 2.0**-50  # times whose relative difference is at most this are the same
INFINITY = float("inf")
TINY = 1e-300  # an estimated error of 0 counts as this

error_order = compiled(tolerance.error_order)


@compiled
def log_factor(aim, estimate, previous, change):
    """Return the logarithm of the next step's length relative to this one's, from estimated errors.

    The length that would have met the tolerance, corrected by how it changed over
    the last step, which foresees an approach (K. Gustafsson, "Control-theoretic
    techniques for stepsize selection in implicit Runge-Kutta methods", ACM TOMS 20
    (1994) 496-517). A step whose error is too large is shortened by less than that:
    its end, where most of the error comes from, is then not reached any more.

    Parameters
    ----------
    aim, estimate, previous : float
        Logarithms of the tolerance, of the estimated error of this step, and of that of
        the step before (infinite: none, or unknown), each divided by the order of the error.
    change : float
        Logarithm of this step's length relative to that of the step before.
    """
    factor = aim - estimate
    trend = change + previous - estimate
    trend = where(size(previous) < INFINITY, where(trend < 0.0, trend, TRUST * trend), 0.0)
    return where(
        factor < 0.0, SHRINK_EXPONENT * factor, greatest(CAUTION * factor, factor - SHORTFALL) + trend
    )


@compiled
def is_distinct(h, t):
    """Whether a step of length h from time t can be told from none."""
    return size(h) > SHORTEST * size(t)


@compiled
def is_good(error, allowed, quadrature_error, allowed_quadrature_error):
    """Whether a step is good enough by its estimated errors."""
    return (error <= allowed) & (quadrature_error <= allowed_quadrature_error)


@compiled
def error_power(degree):
    """Return one over the order of the error that is estimated by the coefficient of a degree."""
    return 1.0 / error_order(degree)


@compiled
def log_of_order(error, power):
    """Return the logarithm of an estimated error divided by its order, whose inverse is ``power``.

    The logarithm is too small by up to 0.06: enough where an order divides it. That of 0, nothing beyond
    rounding, is -infinity.
    """
    return where(error > 0.0, power * (LOG_2 * binary_log(error)), -INFINITY)


@compiled
def log_ratio(x):
    """Return the logarithm of a number near 1: within 6e-4 between 0.83 and 1.2, 0.03 between 0.5 and 2."""
    return 2.0 * (x - 1.0) / (x + 1.0)


@compiled
def as_errors_allow(
    error,
    previous_error,
    error_aim,
    quadrature_error,
    previous_quadrature_error,
    quadrature_error_aim,
    limited,
    change,
    error_is_evident,
    quadrature_error_is_evident,
    least_factor,
):
    """Return the logarithm of the next step's length relative to this one's, as the estimates allow.

    Parameters
    ----------
    error, previous_error, error_aim : float
        Of this step, of the step before, and to aim at; see `log_factor`.
    quadrature_error, previous_quadrature_error, quadrature_error_aim : float
        The same for the quadrature's error,
    limited : bool
        if that is limited too.
    change : float
        Logarithm of this step's length relative to that of the step before.
    error_is_evident, quadrature_error_is_evident : bool
        Whether the estimates are of more than rounding explains in any field.
    least_factor : float
        Logarithm of a factor that is doubted if it is smaller: 0, or `LOG_STEADY` for implicit steps, which
        keep their length below that, and with it an estimate that does not depend on the length.

    Returns
    -------
    factor : float
    in_doubt : bool
        Whether the factor is smaller only for an estimate that may be rounding.
    """
    by_error = log_factor(error_aim, error, previous_error, change)
    by_quadrature_error = log_factor(
        quadrature_error_aim, quadrature_error, previous_quadrature_error, change
    )
    factor = where(limited, least(by_quadrature_error, by_error), by_error)
    evident = (error_is_evident & (by_error < least_factor)) | (
        quadrature_error_is_evident & limited & (by_quadrature_error < least_factor)
    )
    return factor, (factor < least_factor) & opposite(evident)


@compiled
def room_for_longer(error, error_aim, quadrature_error, quadrature_error_aim, limited):
    """Return the logarithm of how much longer a step might have been for its estimated errors."""
    room = error_aim - error
    return where(limited, least(quadrature_error_aim - quadrature_error, room), room)


@compiled
def bounded(factor, most_growth):
    """Return the factor of a step's length that belongs to a logarithm, within its bounds."""
    root = 1.0 + 0.125 * factor  # exp(factor) is its eighth power: within 1 % for lengths up to 1.4 times
    fourth = (root * root) * (root * root)
    longer = greatest(least(SAFETY * (fourth * fourth), most_growth), SHRINK)
    return where(factor > LOG_SHRINK, longer, SHRINK)  # a NaN too


@compiled
def as_iterations_allow(factor, target, iterations, length, limit):
    """Return the factor of a step's length that is good enough, made smaller for the sake of the iteration.

    Parameters
    ----------
    factor : float
        What the errors allow.
    target, iterations : float
        Iterations to aim at, at most, and those of this step.
    length, limit : float
        Of this step, by size, and of the next one at most.
    """
    return least(least(factor, greatest(target / iterations, 0.5)), limit / length)
