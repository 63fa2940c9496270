"""The memory of an implicit solver, as Python makes it and compiled code sees it.

It is an array of integers: the choices and sizes of `HEAD`, then the addresses
of the arrays of `Memory`, in order. The step itself is in the trajectory's own
context (`integrators.kernel.layout`).
"""

from typing import Any, NamedTuple

# The choices and sizes at the head.
METHOD, ROWS, STAGES, DEGREE, PAIRS, ENTRIES, WHOLE, JACOBIAN, FACTORS, HEAD = range(10)

# How the corrections are computed.
NEWTON, BLENDED = range(2)

# What is asked of a function at FACTORS, int64(what, pair), that keeps the factors elsewhere.
FACTORIZE, SOLVE = range(2)

# Numbers in Memory.count ...
(
    FACTORED,  # 1: the factors are those of `Memory.entries` and of the step FACTORED_H
    LINEARIZED,  # 1: `Memory.entries` are those at `Memory.point`
    STALE,  # 1: take a new Jacobian at the next step
    PREDICT,  # 1: the extrapolated start is nearer than the constant one
    SINCE,  # steps since the Jacobian was taken
    TRIED, CORRECTIONS, JACOBIANS, FACTORIZATIONS, RESCUES, COUNTS,
) = range(11)  # fmt: skip

# ... and in Memory.real.
(
    FACTORED_H,
    CHANGE,  # of the last correction
    RATE,  # by which corrections have contracted with this Jacobian; 1 where that is not known
    CONTRACTION,  # by which one fixed-point iteration contracts, an estimate ...
    CONTRACTION_H,  # ... of a step of this length, and ...
    RADIUS,  # ... in which this is the part of X_s: its spectral radius, squared in the second-order form
    REALS,
) = range(7)


class Memory(NamedTuple):
    """The arrays of an implicit solver: degree s, R rows, p pairs of eigenvalues of X_s.

    D components: R, and 2 R in the second-order form, whose unknowns are the
    coefficients of q' and then those of p'. A stage table takes coefficients to
    stages, in the packing of `integrators.kernel.tables`; its first columns are the
    low parts of the next.
    """

    stage_table: Any
    projection: Any  # the field's values -> coefficients, packed
    basis: Any  # coefficients -> the polynomial at the nodes, packed
    weights: Any  # of the stages in a mean, one per lane of stage memory
    integrals: Any  # (k, s), the stage table
    reach: Any  # (k, s), the same; in the second-order form times X_s
    moments: Any  # (s, k), the projection
    left_re: Any  # (p, s), rows of the inverse of the eigenvectors' matrix
    left_im: Any
    right_re: Any  # (s, p), eigenvectors, twice where a conjugate belongs to them
    right_im: Any
    eigen_re: Any  # (p,)
    eigen_im: Any
    x: Any  # (s, s), X_s
    inverse: Any  # (s, s), X_s^{-1}
    rows: Any  # (ENTRIES,), integers: where the Jacobian's entries are
    columns: Any  # (ENTRIES,)
    count: Any  # (COUNTS,), integers
    real: Any  # (REALS,)
    point: Any  # (R,)
    gamma: Any  # (s, D), the unknowns
    increment: Any  # (D,), h gamma_0, what the step adds to the state
    predicted: Any  # (s, D)
    residual: Any  # (s, D)
    correction: Any  # (s, D)
    factor: Any  # (R,), h, or h^2 q'/p in the second-order form
    slope_strict: Any  # (R,), 1 / size of a row's block in h q', second-order form
    slope_floored: Any  # (R,), small blocks raised
    entries: Any  # (ENTRIES,)
    lu_re: Any  # (p R, R), the factors, unless they are elsewhere
    lu_im: Any
    pivots: Any  # (p R,), integers
    whole_re: Any  # (s R, s R), the matrix with a Jacobian for each stage; none if that is too large
    whole_im: Any
    whole_pivots: Any  # (s R,), integers
    whole_x: Any  # (s R,)
    whole_y: Any
    b_re: Any  # (R,), right-hand side and solution of a system
    b_im: Any
    v_re: Any  # (D,), a vector of the first-order form
    v_im: Any
    packed: Any  # coefficients in the packing of stage memory
    trial: Any  # one block of stages, its times, and the field there
