"""What Python and compiled code know about each other: the arrays of a trajectory, and numbers for choices.

A trajectory is an array of integers: the numbers of `SIZES`, then the addresses of
its arrays, in the order of `ARRAYS`. Compiled code reads them as attributes
(`views.memory`).
"""

# What the entry can do.
RESET, ADVANCE, VARY, WALK = range(4)

# Which equations the coefficients satisfy.
INVARIANTS, POISSON = range(2)

# How a call ended; `NOT_KEPT`: a quantity to be kept is no invariant.
DONE, BUDGET, DIVERGED, NOT_FINITE, NOT_KEPT, UNDERFLOW = range(6)

# How states between steps are made.
SIDE, LAND, DENSE = range(3)

# Places in the array ``count`` ...
(
    N, STEPS, ITERATIONS, EVALUATIONS, PARTIAL, RESTARTS, REJECTIONS, LOST, CULPRIT, MADE, SOLVED, ACCEPTED,
    COUNTS,
) = range(13)  # fmt: skip

# ... and in ``real``. Steps of one length h: the time is T0 + N H. Steps of varying length, which have a
# TOLERANCE: the time is T0 + LOW, the next step's length NEXT, the length after it AFTER, the last two steps'
# estimated errors BEHIND and AHEAD; no step is longer than LIMIT.
T0, H, LENGTH, CHANGE, DEFECT, TOLERANCE, LOW, NEXT, AFTER, BEHIND, AHEAD, LIMIT, REALS = range(13)

SIZES = (
    "mode",
    "field",  # address of the function behind a row of ``stages``
    "values",  # address of the function behind the invariants
    "k",
    "s",
    "dim",
    "n",  # invariants
    "row",  # numbers per stage: dim (1 + n), the field and the gradients; or dim (1 + dim), grad H and B
    "width",  # columns of Legendre coefficients: dim (1 + n)
    "after",  # s + 1
    "rows",  # of sums
    "parameters",
    "blocks",
    "reals",
    "counts",
    "one",
)

ARRAYS: dict[str, tuple[str, ...]] = {
    # Of the method and the system.
    "par": ("parameters",),
    "nodes": ("k",),
    "nodes_low": ("k",),
    "weights": ("k",),
    "weights_low": ("k",),
    "integrals": ("k", "s"),
    "basis": ("k", "s"),
    "projection": ("after", "k"),  # the last row is 0 for k = s
    "metric": ("dim",),  # the diagonal of W
    "active": ("n",),  # 0 for an invariant that follows from others
    "order": ("dim",),  # the order in which components are summed up
    "ends": ("dim",),  # 1 where a partial sum of that order ends
    "block": ("dim",),
    "group": ("blocks",),
    # The state.
    "y": ("dim",),
    "e": ("dim",),  # what y has lost to rounding
    "previous": ("s", "dim"),  # coefficients of the last step
    "reference": ("n",),  # what the invariants are to be
    "real": ("reals",),
    "count": ("counts",),
    # Room for the solution of a step.
    "rho": ("s", "dim"),  # coefficients of the polynomial's derivative
    "new": ("s", "dim"),
    "stages": ("k", "row"),
    "legendre": ("s", "width"),  # Legendre coefficients of the columns of stages
    "rest": ("row",),
    "stage": ("dim",),
    "sums": ("rows", "dim"),
    "gram": ("n", "n"),
    "lower": ("n", "n"),
    "pivots": ("n",),
    "right": ("n",),
    "alpha": ("n",),
    "missing": ("n",),  # what rounding has taken from the invariants
    "size": ("blocks",),
    "change": ("blocks",),
    "largest": ("blocks",),
    "slope": ("blocks",),
    "next_y": ("dim",),
    "next_e": ("dim",),
    "time": ("one",),
}

INTEGERS = ("active", "order", "ends", "block", "group", "count")
