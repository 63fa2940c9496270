"""What the implicit solver keeps in memory, by name; see `integrators.kernel.native.memory`."""

from integrators.kernel.native.memory import Array, Integer, Memory, Pointer, Real, Table

NEWTON, BLENDED = range(2)
"""How corrections are computed."""

FACTORIZE, SOLVE = range(2)
"""What is asked of the function at `Corrections.factors`."""


class Corrections(Memory):
    """The memory of a solver for the steps of one context: degree s, R rows, p pairs of eigenvalues of X_s.

    There are R unknowns of each degree, and in the second-order form 2 R, in two blocks: the
    coefficients of q' and then those of p'; see `integrators.kernel.implicit.stages`. Tables are packed as
    in `integrators.kernel.tables`. The rows of tangent vectors along a trajectory are ``copies`` of its rows,
    for which its Jacobian holds; the trajectory's stages follow theirs.
    """

    method = Integer()  # how corrections are computed: NEWTON, BLENDED
    source = Pointer()  # the Jacobian, void(t, y, par, entries); 0 for differences
    factors = Pointer()  # what keeps the factors, int64(operation, pair); 0: they are here
    rows = Integer()
    copies = Integer()
    unknowns = Integer()  # rows of a copy
    first = Integer()  # row of the stages at which the Jacobian's state begins
    trajectory = Pointer()  # the solver's memory that the Jacobian is taken from; 0: of none
    pulls = Pointer()  # relative derivatives of velocities, by row; 0: none
    padded = Integer()
    k = Integer()
    s = Integer()
    dim = Integer()
    parts = Integer()  # blocks of coefficients: 2 in the second-order form
    groups = Integer()  # of eight coefficients
    block = Integer()  # doubles in a block
    pair_groups = Integer()  # of eight pairs of eigenvalues
    wide = Integer()  # doubles that such a group's vectors take, in all groups
    entry_count = Integer()
    grouped = Integer()  # columns of the entries by differences; 0 where they are not
    group_count = Integer()  # of columns, differences of which are taken together
    group_ends = Integer()  # one more
    column_ends = Integer()  # one more than columns
    grouped_entries = Integer()
    factored = Integer()  # 1: the factors are those of the entries and of `factored_h`
    lu_size = Integer()
    lu_rows = Integer()
    whole = Integer()  # s R, rows of a matrix with a Jacobian for each stage; 0 if that is too large
    whole_size = Integer()
    trial_size = Integer()

    # --- of the method ---
    stage_table = Array()  # coefficients to stages, the low parts of its first columns before it
    projection = Array()  # values -> coefficients
    basis = Array()  # coefficients -> the polynomial at the nodes
    weights = Array()  # of the stages in a mean, one per lane of stage memory
    integrals = Table("k", "s")  # the stage table
    force_integrals = Table("k", "s")  # the same; in the second-order form times X_s
    moments = Table("s", "k")  # the projection
    left = Array()  # rows of the inverse of the eigenvectors' matrix, eight real parts, eight imaginary ones
    right = Array()  # eigenvectors, in the same way, twice where a conjugate belongs to them
    eigen = Array()  # eigenvalues: eight real parts, eight imaginary ones
    powers = Array()  # the same; in the second-order form their squares
    x = Table("s", "s")  # X_s
    derivatives = Array()  # X_s, packed
    inverse = Array()  # rho X_s^{-1}, of blended iteration
    radius = Real()  # part of X_s in a fixed-point iteration's contraction: its spectral radius, or squared

    # --- the unknowns ---
    gamma = Array("parts", "block")
    increment = Table("dim", lasting=True)  # h gamma_0, what the step adds to the state
    predicted = Array("parts", "block")
    residual = Array("parts", "block")
    correction = Array("parts", "block")
    moving = Array("parts", "block", 2)  # coefficients in front of the stage table
    factor = Table("rows")  # h, or h^2 q'/p in the second-order form
    slope_weights = Table("rows")  # 1 / size of a row's block in h q', second-order form
    floored_slope_weights = Table("rows")  # small blocks raised
    predict = Integer(lasting=True)  # 1: the extrapolated start is nearer than the constant one
    change = Real(lasting=True)  # of the last correction
    # By which corrections have contracted with this Jacobian; 1 where that is not known
    rate = Real(lasting=True)
    contraction = Real(lasting=True)  # by which one fixed-point iteration contracts, an estimate ...
    contraction_h = Real(lasting=True)  # ... of a step of this length

    # --- the Jacobian and the factors ---
    entry_rows = Table("entry_count", kind=int)
    entry_columns = Table("entry_count", kind=int)
    entries = Table("entry_count", lasting=True)
    columns = Table("grouped", kind=int)  # group by group
    column_groups = Table("grouped", kind=int)  # of each column
    column_starts = Table("group_ends", kind=int)  # of each group in `columns`
    column_entries = Table("grouped_entries", kind=int)  # column by column, as in `columns`
    entry_starts = Table("column_ends", kind=int)  # of each of `columns` in `column_entries`
    state = Table("unknowns")  # where the Jacobian is taken
    lu = Array("lu_size")  # factors of eight matrices at a time; see `integrators.kernel.implicit.linear`
    pivots = Array("lu_rows", kind=int)
    begins = Array("lu_rows", kind=int)
    ends = Array("lu_rows", kind=int)
    whole_matrix = Array("whole_size")
    whole_x = Array("whole")
    linearized = Integer(lasting=True)  # 1: the entries are those at `state`
    stale = Integer(lasting=True)  # 1: take a new Jacobian at the next step
    since = Integer(lasting=True)  # steps since the Jacobian was taken
    factored_h = Real(lasting=True)  # length of the step that the factors are for

    # --- room ---
    slopes = Table("unknowns")
    next_slopes = Table("unknowns")
    v = Array("parts", "wide")  # vectors of the first-order form, one for each pair
    b = Array(16, "padded")  # right-hand sides and solutions of eight systems
    trial = Array("trial_size")  # one block of stages, its times, and the field there

    # --- counters ---
    tried = Integer()
    corrections = Integer()
    jacobians = Integer()
    factorizations = Integer()
    full_newton = Integer()
