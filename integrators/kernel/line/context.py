"""The memory of a trajectory along which a line integral is kept: a `Context` and what it needs besides."""

from integrators.kernel.context import Context
from integrators.kernel.native.memory import Array, Integer, Pointer, Real

# Whose line integrals vanish: those of several invariants, or that of a Poisson system's energy.
INVARIANTS, POISSON = range(2)


class LineContext(Context):
    """A trajectory of a line integral.

    The function behind `Context.field` writes rows for a block of stages, `every` of them at most: the field,
    dim rows, and the entries of the gradients that are not identically 0, invariant by invariant; or grad H
    and B, dim (1 + dim).
    """

    mode = Integer()  # INVARIANTS, POISSON
    invariants = Integer()  # how many
    every = Integer()  # rows that it writes
    measure = Pointer()  # what writes the gradients and then the invariants themselves
    gradients = Array("calls", "every", "lanes", lasting=True)  # in the layout of stage memory
    remainders = Array("calls", "every", "lanes")  # what their first s coefficients leave of the rows
    legendre = Array("coefficient_groups", "every", 8, lasting=True)  # these coefficients
    coefficient_groups = Integer()  # of 8
    onto = Array()  # values -> coefficients
    back = Array()  # coefficients -> values at the stages
    metric = Array("rows")  # the diagonal of W
    # 0 for an invariant that follows from others
    active = Array("invariants", kind=int, lasting=True)
    on_manifold = Array("invariants", kind=int)  # 1 for an invariant of the solutions on a manifold only
    derived = Array("invariants", kind=int)  # 1 for an invariant that needs no check
    entries = Integer()  # of the gradients
    sized = Integer()  # 1 where rows with the sizes of the field's terms follow them
    column = Array(kind=int)  # of each entry, its component of the state
    # The entries of each component, by the invariants: where they begin, their rows and their invariants
    column_first = Array(kind=int)
    column_row = Array(kind=int)
    column_owner = Array(kind=int)
    # Pairs of invariants (a, b), b <= a, that share components: where their products begin, and their rows
    pairs = Integer()
    pair_first = Array(kind=int)
    diagonal = Array(kind=int)  # the pair (a, a)
    row_a = Array(kind=int)
    row_b = Array(kind=int)
    ends = Array(kind=int)  # 1 where a partial sum of the products ends
    # The factors: the invariants in the order of elimination, and of each row of L the columns before it. The
    # pairs that its entries are of in the matrix; -1: none
    turn = Array(kind=int)
    lower_first = Array(kind=int)
    lower_column = Array(kind=int)
    lower_pair = Array(kind=int)
    lower_entries = Integer()
    gram = Array("pairs")
    lower = Array("lower_entries")
    lower_row = Array("invariants")  # one of its rows, with the zeros
    pivots = Array("invariants")
    right = Array("invariants")
    alpha = Array("invariants", lasting=True)
    reference = Array("invariants", lasting=True)  # what the invariants are to be
    # What the step ahead is to take back of what rounding took from them
    owed = Array("invariants", lasting=True)
    largest = Array("invariants", lasting=True)  # terms so far, of which rounding is a part
    lost = Array("invariants", lasting=True)  # what was more than rounding, added up,
    first_loss = Array("invariants", lasting=True)  # and the time when it was seen first
    culprit = Integer()  # the invariant that is none,
    change_rate = Real()  # and its rate of change beside the terms of that
