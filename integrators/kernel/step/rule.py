"""The numbers of the rules: what ends the fixed-point iteration, sizes of blocks, parts of the interval.

`integrators.kernel.step.stopping` has the rule of the iteration, of which `is_rounding` is the part that all
iterations share: the implicit solver's, and those of the plugins too.
"""

from math import log2

TOLERANCE = 1e-16  # a change of the stages, relative to their block, at which the iteration has converged
# Adaptive steps iterate without a test until the change should be so many times as large, and from
# where it is at most so many times as large.
UNTESTED, TRUSTED = 1e3, 1e5
# With a projection of the energy they iterate to this part of the tolerance, and trust no larger change than
# `MOST_TRUSTED`. With .1 the positions on the nine problems of `automatic` are .7 digits worse at 1e-3 and .4
# at 1e-6, for a time between 7 % more and 1 % less; without the second bound the iteration ends far too early
# on four of the nine at tolerances of 1e-2 and 1e-1.
PART_OF_TOLERANCE, MOST_TRUSTED = 0.01, 0.01
ROUNDING = 1e-15  # below it, the first change that does not decrease ends the iteration
STAGNATION = 1e-13  # above it, a change that stops decreasing is a failure
# Changes that do not decrease, to end it between ROUNDING and STAGNATION. Where the iteration's matrix is
# far from normal the changes fall in waves: two end it early (a drift of 2.4e-16 per step, period annulus,
# s = 2, h = 1; with five 3e-18).
STAGNATION_LIMIT = 5


def is_rounding(change, repeated, most):  # compiled too
    """Whether rounding accounts for a change that does not decrease; ``repeated``: not for the first time.

    Then it may be as large as ``most``.

    The change is relative to the size of its block, small blocks raised to a part of the largest.
    """
    return (change < ROUNDING) | (repeated & (change < most))


# Once a change is small, the rate at which it has decreased tells that of what follows, if it is fast. One
# fast decrease may be a part of a wave (Penning trap, s = 2, h = .2: an error of 5e-15 in one step); so the
# average rate, from a first change as large as the state to 1e-15, must promise next to nothing.
FAST_RATE = 0.15
LEAST = 3e-17  # smaller changes are rounding
TOTAL_DECREASE = 1e15
# What may be left of a change when the step is solved. On the outer Solar System 3e-17, and values at the
# stages before the last change, let the energy drift by 7e-20 per step (Gauss(8), h = 1 year): in 1e6 years
# more than rounding adds; with 1e-18 nothing is seen of it. But with 1e-18 an oscillator's energy falls by
# 2.1e-19 of itself in each step of length 0.5 (HBVM(8, 4), 48 initial conditions, +- 0.1e-19); with 3e-19 it
# rises by 0.3e-19, for one iteration in thirty more, and with 1e-19 nothing is seen, for one in twelve.
# Adaptive steps are longer and fewer. With 3e-17 they take one iteration in ten less than with 1e-18, and the
# energy of 48 outer Solar Systems moves as little in 3e4 steps (rms 4.3e-14 and 4.1e-14), as that of Kepler's
# and Henon and Heiles' problems does in 1e5 to 3e5. With 3e-16 these lose 1e-18 in each step, with 3e-15 3 to
# 8e-18. At loose tolerances it is seen: a pendulum's energy grows by 2.3e-18 in each step of HBVM(12, 6) at
# 1e-8, and not with 3e-19, which excites fast oscillations at rest, though.
LOG_RESIDUAL, LOG_RESIDUAL_VARYING = log2(3e-19), log2(3e-17)
# Iterations after which a start is given up: for one without extrapolation, or, if it was one, for a shorter
# step or the implicit solver. In lanes all the others wait; there a trajectory that has had twice as many
# leaves, and is computed alone.
MOST_ITERATIONS, MOST_IN_LANES = 200, 40
FARTHEST = 2.0  # previous steps: their polynomial is extrapolated no farther
FIRST_RATE = log2(0.01)  # contraction (binary logarithm) before any is measured

# --- sizes of blocks, which changes are relative to -------------------------------------------------

FLOOR = 1e-3  # of the largest size in its group: where rounding of the field may hide a small component
# Of the same, where steps vary: a smaller block is judged as if it had this size, as its errors are. A block
# that is 0 at first grows by one power of t in each iteration, far from the others by many. It is a scale of
# errors, far above rounding.
LEAST_BLOCK = 1e-6
SMALLEST, LARGE = 1e-280, 1e280  # a block smaller than that has no size to divide by, and counts as so large

# --- parts of the interval, from a trajectory's start to the farthest time asked for -----------------

# The longest step of a field that depends on the time, and of any field that has the same value at all nodes
# of a step: what is to come cannot be seen from what has been. Sixteen nodes are then a 168th of the interval
# apart at most, eight an 87th.
LONGEST = 2.0**-4
# Of the time: a first step, and one after a breakpoint, is tried with this length at least.
RESTART = 2.0**-40
# The first step where the field at the start tells no time scale. Some six steps, each at most twice as long
# as the one before, lead from it to the longest one.
FIRST_AT_REST = 2.0**-10
# A step that is cut to less than this may be one from rest, which no cutting makes good enough.
SHORTEST_PART = 1e-15
SCALE_LASTS = 8  # steps that are good enough without it after which a block's expected size is forgotten
