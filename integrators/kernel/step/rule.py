"""The numbers of the rule that ends the fixed-point iteration: of one trajectory, and of those in lanes.

`integrators.kernel.step.iterate` and `integrators.kernel.ensemble.steps` apply it.
"""

TOLERANCE = 1e-16  # a change of the stages, relative to their block, at which the iteration has converged
ROUNDING = 1e-15  # below it, the first change that does not decrease ends the iteration
STAGNATION = 1e-13  # above it, a change that stops decreasing is a failure
# Changes that do not decrease, to end it between ROUNDING and STAGNATION. Where the iteration's matrix is
# far from normal the changes fall in waves: two end it early (a drift of 2.4e-16 per step, period annulus,
# s = 2, h = 1; with five 3e-18).
PATIENCE = 5
# Once a change is small, how fast it has fallen tells how fast the rest will, if that is steep. One steep
# fall may be a part of a wave (Penning trap, s = 2, h = .2: an error of 5e-15 in one step); so the average
# fall, from a first change as large as the state to 1e-15, must promise next to nothing.
STEEP = 0.15
LEAST = 3e-17  # smaller changes are rounding
FALL = 1e15

# --- sizes of blocks, which changes are relative to -------------------------------------------------

FLOOR = 1e-3  # of the largest size in its group: where rounding of the field may hide a small component
# Of the same, where steps vary: a smaller block is judged as if it had this size, as its errors are. A block
# that is 0 at first grows by one power of t in each iteration, far from the others by many.
NOTHING = 1e-6
SMALLEST, LARGE = 1e-200, 1e200  # a block smaller than that has no size to divide by
