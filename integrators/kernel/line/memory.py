"""The memory of a trajectory of a line integral method, by name."""

import numpy as np
from numpy.typing import NDArray

from integrators.kernel.native.memory import Array, Integer, Memory, Real, Table

# Which equations the coefficients satisfy.
INVARIANTS, POISSON = range(2)

# How a call ended, besides `integrators.kernel.context`: a quantity to be kept is no invariant.
NOT_KEPT = 7


class Trajectory(Memory):
    """A trajectory: the method, the system, the state, and room for the solution of a step.

    Steps of one length h: the time is t0 + n h. Steps of varying length, which have a
    tolerance: the time is t0 + time_low.
    """

    # --- of the method and the system ---
    mode = Integer()  # INVARIANTS, POISSON
    field = Integer()  # address of the function behind a row of `stages`
    values = Integer()  # address of the function behind the invariants
    k = Integer()
    s = Integer()
    dim = Integer()
    invariants = Integer()  # how many
    row = Integer()  # numbers per stage: field and gradients, dim (1 + n); or grad H and B, dim (1 + dim)
    width = Integer()  # columns of Legendre coefficients: dim (1 + n)
    after = Integer()  # s + 1
    rows = Integer()  # of sums
    blocks = Integer()
    par = Array()
    nodes = Table("k")
    nodes_low = Table("k")
    weights = Table("k")
    weights_low = Table("k")
    integrals = Table("k", "s")
    basis = Table("k", "s")
    projection = Table("after", "k")  # the last row is 0 for k = s
    metric = Table("dim")  # the diagonal of W
    active = Table("invariants", of=int)  # 0 for an invariant that follows from others
    order = Table("dim", of=int)  # the order in which components are summed up
    ends = Table("dim", of=int)  # 1 where a partial sum of that order ends
    block = Table("dim", of=int)
    group = Table("blocks", of=int)

    # --- the state ---
    y = Table("dim")
    e = Table("dim")  # what y has lost to rounding
    next_y = Table("dim")
    next_e = Table("dim")
    previous = Table("s", "dim")  # coefficients of the last step
    reference = Table("invariants")  # what the invariants are to be
    t0 = Real()
    time_low = Real()
    n = Integer()
    h = Real()
    length = Real()  # of the last step; 0: unknown
    solved = Integer()
    tolerance = Real()  # 0: steps of one length
    next_length = Real()  # length of the next step to be tried
    length_after = Real()  # of the one after the step that is solved
    error_behind = Real()  # estimated error of the last step ...
    error_ahead = Real()  # ... and of the one that is solved
    length_limit = Real()  # no step is longer
    accepted = Integer()

    # --- room for the solution of a step ---
    rho = Table("s", "dim")  # coefficients of the polynomial's derivative
    new = Table("s", "dim")
    stages = Table("k", "row")
    legendre = Table("s", "width")  # Legendre coefficients of the columns of `stages`
    rest = Table("row")
    stage = Table("dim")
    sums = Table("rows", "dim")
    gram = Table("invariants", "invariants")
    lower = Table("invariants", "invariants")
    pivots = Table("invariants")
    right = Table("invariants")
    alpha = Table("invariants")
    missing = Table("invariants")  # what rounding has taken from the invariants
    size = Table("blocks")
    moved = Table("blocks")
    largest = Table("blocks")
    slope = Table("blocks")
    time = Array(1)
    last = Real()  # change of an iteration
    defect = Real()  # of the invariant that is none
    culprit = Integer()  # which that is
    made = Integer()  # samples

    # --- counters ---
    steps = Integer()
    iterations = Integer()
    evaluations = Integer()
    partial = Integer()
    restarts = Integer()
    rejections = Integer()
    lost = Integer()  # times that an invariant had moved by more than rounding accounts for

    def read(self) -> NDArray[np.float64]:
        """Return a copy of the state."""
        return self.y.copy()
