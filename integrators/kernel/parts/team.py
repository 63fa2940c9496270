"""Threads that share the work of one trajectory.

A job is done in pieces, and every piece has a number. Whoever is free claims the next one; the thread of the
trajectory takes part, opens a job only when all pieces of the last one are done, and goes on when those of
this one are. A thread that the machine has put aside delays nobody, unless it was at work on a piece. Pieces
write to rows or stages of their own and do not depend on who does them: neither do the results.
"""

from integrators.kernel.native.memory import Array, Integer, Memory, Pointer

BLOCK = 256
"""Rows of a piece are a multiple of these."""

PIECES = 16
"""Of a job at most: twenty steps of 100,000 rows, 8 stages, take 52 ms with 16, 87 with 64, 121 with 400."""

# Jobs.
FIELD, PRODUCT, PRODUCT_OF_TWO, PRODUCT_FOR_ONE, PRODUCT_AND_CHANGE = range(5)
PREPARE, COEFFICIENTS, FINISH = range(5, 8)

# Where the integers of `Team.pieces` are: each has a line of the cache to itself.
NEXT, OPENED, DONE_WITH, CLOSED = 0, 8, 16, 24


class Team(Memory):
    """What the threads of a trajectory know; see the module."""

    code = Pointer()  # of `step.work.work`
    rest = Pointer()  # what lets another thread have the processor, int(); see `threads`
    field = Pointer()  # the field on eight stages of those that lie side by side
    part = Pointer()  # what sets some of its rows, void(times, stages, par, values, first, last); 0: none
    context = Integer()  # address of the trajectory's memory, or of that for its partial steps
    job = Integer()
    table = Array()  # of a product
    first = Integer()  # number of the first piece of the job
    pieces = Array(32, kind=int)  # numbers: the next piece, how many are opened and done; 1: all is over
    most = Integer()  # pieces of a job
    results = Array(8, "most")  # of the pieces
    block = Integer()  # rows of a piece
