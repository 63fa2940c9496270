"""The stopping rule of the fixed-point iteration, for one trajectory and for a row of them.

`integrators.kernel.step.iterate` applies it to a trajectory, `integrators.kernel.ensemble.steps` to lanes.
"""

from math import log2

from integrators.kernel.native.jit import compiled
from integrators.kernel.simd.operations import binary_log, greatest, least, where
from integrators.kernel.step import rule
from integrators.kernel.step.rule import (
    FAST_RATE,
    LEAST,
    ROUNDING,
    STAGNATION,
    STAGNATION_LIMIT,
    TOTAL_DECREASE,
)

LOG_TRUSTED, LOG_FAST_RATE = log2(1e-11), log2(FAST_RATE)
LOG_NEGLIGIBLE, LOG_TOTAL_DECREASE = log2(3.0 * LEAST), log2(TOTAL_DECREASE)
# Contraction, as far as it is believed. A slower one would ask for up to 40 evaluations more, which change
# nothing: the stages are doubles, and do not move any more when their changes are below rounding. The energy
# of oscillators with contractions of .4 to .8, 35 to 95 iterations a step,
# drifts by 2e-18 to 7e-17 in each step, and as much, in another direction, with 60 evaluations more.
FASTEST, SLOWEST = -10.0, -1.0
MOST_EXTRA = 16.0  # evaluations without a test after the last one, at most
MOST_UNTESTED = 12.0  # iterations in a row without a test before it, at most
LEAST_RATE, MOST_RATE = log2(1e-4), log2(0.9)
LOG_RATE_AT_ZERO = log2(0.7)  # to the logarithm of the contraction, where the last change was nothing
MOST_TIMES, TRIAL = 3.0, 4.0  # times as many iterations as aimed at are too many, if a trial says so

is_rounding = compiled(rule.is_rounding)


@compiled
def judge(change, last, best, stalled, rate, tried, tolerance, resolution):
    """Apply the rule to the change of an iteration, which is relative to the size of its block.

    The iteration has converged when the change is at most the tolerance, or when it is small and decreases
    so fast that the residual is known. It may be over when the change has stopped decreasing; see
    `stagnates`.

    Parameters
    ----------
    change, last : float
        This change and the one before; infinite: not known.
    best : float
        The smallest one before this.
    stalled : float
        Changes in a row that were not smaller than `best`.
    rate : float
        Binary logarithm of the contraction, as it was last measured.
    tried : float
        Iterations of this start.
    tolerance : float
    resolution : float
        The smallest change that can be told from none.

    Returns
    -------
    best, stalled, rate : float
        With this change.
    converged : bool
    residual : float
        What is left of it then.
    """
    size = binary_log(greatest(change, LEAST))
    latest = size - binary_log(last)
    # From 1 on, a change is no part of a size: a block was 0, or there was no change before.
    follows = last < 1.0
    # If it is rounding, it decreases that fast at least.
    measured = follows & ((change > ROUNDING) | (latest < rate))
    decreasing = change < best
    small = change <= tolerance
    fast = follows & (latest <= LOG_FAST_RATE) & (size <= LOG_TRUSTED)
    known = decreasing & fast & (tried * (size - LOG_NEGLIGIBLE) <= LOG_TOTAL_DECREASE)
    return (
        where(decreasing, change, best),
        where(decreasing, 0.0, stalled + 1.0),
        where(measured, least(greatest(latest, FASTEST), SLOWEST), rate),
        small | known,
        greatest(change, resolution),
    )


@compiled
def untested_next(untested, tests, stalled, last):
    """Return how many iterations of the next step need no test, by those of a fixed step that is solved.

    Two tests tell how the changes fall; more mean that the first came early. It came late where nothing was
    left to fall: then further changes are rounding, however many were looked at.

    Parameters
    ----------
    untested, tests, stalled : int
        Iterations of this step without a test before the first one, tests, and those that did not decrease.
    last : float
        The last change.
    """
    late = stalled == 0 and tests <= 2 and last <= ROUNDING
    return max(untested + tests - stalled - (3 if late else 2), 0)


@compiled
def untested(change, rate, log_trusted):
    """Return how many iterations of an adaptive step need no test until its change may be trusted.

    Parameters
    ----------
    change, rate, log_trusted : float
        Binary logarithms of the present change, of the contraction and of the change to be trusted.
    """
    return least(greatest((log_trusted - change) / rate - 1.0, 0.0), MOST_UNTESTED)


@compiled
def rate_since(first, change, tries):
    """Return the binary logarithm of the contraction over so many iterations, from that of two changes."""
    return least(greatest((change - first) / tries, LEAST_RATE), MOST_RATE)


@compiled
def rate_at_zero(rate):
    """Return what the contraction counts as where nothing is left of the change."""
    return greatest(rate + LOG_RATE_AT_ZERO, LEAST_RATE)


@compiled
def takes_too_long(change, rate, tries, log_residual, target):
    """Whether a shorter step is cheaper than to iterate on, after a trial; ``target``: so many iterations."""
    return (tries >= TRIAL) & (tries + (log_residual - change) / rate > MOST_TIMES * target)


@compiled
def stagnates(change, stalled, most):
    """Whether an iteration is over whose changes have ``stalled`` so often, and are of this size now."""
    return (stalled > 0.0) & is_rounding(change, stalled >= STAGNATION_LIMIT, most)


@compiled
def residual_at_end(converged, residual, best):
    """Return what is left of the changes of an iteration that is over, in which the smallest was ``best``.

    0 where another iteration must not be made: beside the others the block is nothing, and may be growing.
    """
    return where(converged, residual, where(best <= STAGNATION, best, 0.0))


@compiled
def further(change, rate, log_residual):
    """Return how many more evaluations, at the newest stages, leave next to nothing of a change.

    What is left of it acts on the energy in the same direction in every step; see `LOG_RESIDUAL`.
    """
    return least(greatest((log_residual - binary_log(change)) / rate, 0.0), MOST_EXTRA)
