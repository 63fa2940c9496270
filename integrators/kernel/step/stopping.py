"""The stopping rule of the fixed-point iteration, for one trajectory and for a row of them.

`integrators.kernel.step.iterate` applies it to a trajectory, `integrators.kernel.ensemble.steps` to lanes.
"""

from math import log2

from integrators.kernel.native.jit import for_both_widths
from integrators.kernel.simd.operations import binary_log, greatest, least, where
from integrators.kernel.step.rule import FALL, LEAST, PATIENCE, ROUNDING, STAGNATION, STEEP

LOG_TRUSTED, LOG_STEEP = log2(1e-11), log2(STEEP)
LOG_PROMISE, LOG_FALL = log2(3.0 * LEAST), log2(FALL)
# Contraction, as far as it is believed. A slower one would ask for up to 40 evaluations more, which change
# nothing: the stages are doubles, and do not move any more when their changes are below rounding. The energy
# of oscillators with contractions of .4 to .8, 35 to 95 iterations a step,
# drifts by 2e-18 to 7e-17 in each step, and as much, in another direction, with 60 evaluations more.
FASTEST, SLOWEST = -10.0, -1.0
MOST_EXTRA = 16.0  # evaluations without a test after the last one, at most


@for_both_widths
def judge(change, last, best, stalled, rate, tried, tolerance, resolution):
    """Apply the rule to the change of an iteration, which is relative to the size of its block.

    The iteration has converged when the change is at most the tolerance, or when it is small and falls so
    steeply that the rest is known. It may be over when the change has stopped decreasing; see `stagnates`.

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
    rest : float
        What is left of it then.
    """
    size = binary_log(greatest(change, LEAST))
    fall = size - binary_log(last)
    # From 1 on, a change is no part of a size: a block was 0, or there was no change before.
    follows = last < 1.0
    # If it is rounding, it falls that fast at least.
    measured = follows & ((change > ROUNDING) | (fall < rate))
    falling = change < best
    small = change <= tolerance
    steep = follows & (fall <= LOG_STEEP) & (size <= LOG_TRUSTED)
    known = falling & steep & (tried * (size - LOG_PROMISE) <= LOG_FALL)
    return (
        where(falling, change, best),
        where(falling, 0.0, stalled + 1.0),
        where(measured, least(greatest(fall, FASTEST), SLOWEST), rate),
        small | known,
        greatest(change, resolution),
    )


@for_both_widths
def is_rounding(change, patient):
    """Whether rounding accounts for a change that does not decrease; ``patient``: not for the first time.

    The change is relative to the size of its block, small blocks raised to a part of the largest.
    """
    return change < where(patient, STAGNATION, ROUNDING)


@for_both_widths
def stagnates(change, stalled):
    """Whether an iteration is over whose changes, of this size now, have ``stalled`` so often."""
    return (stalled > 0.0) & is_rounding(change, stalled >= PATIENCE)


@for_both_widths
def left_over(converged, rest, best):
    """Return what is left of the changes of an iteration that is over, in which the smallest was ``best``.

    0 where another iteration must not be made: beside the others the block is nothing, and may be growing.
    """
    return where(converged, rest, where(best <= STAGNATION, best, 0.0))


@for_both_widths
def further(change, rate, log_rest):
    """Return how many more evaluations, at the newest stages, leave next to nothing of a change.

    What is left of it acts on the energy in the same direction in every step; see `LOG_REST`.
    """
    return least(greatest((log_rest - binary_log(change)) / rate, 0.0), MOST_EXTRA)
