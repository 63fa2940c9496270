"""Where things are: the slots of a context, the block of memory a trajectory is integrated in.

A context is 128 words of eight bytes, integers and doubles side by side: the
addresses of all tables and arrays, and the state of the nonlinear solver.
Compiled functions take its address and nothing else, so their signature does
not change with what they do, and a batch is a row of contexts.

Stage memory is a structure of arrays: BLOCKS blocks of PADDED rows of LANES
doubles; row d of a block holds component d of the block's stages, side by
side, as the vector field wants it.
"""

# What is integrated, and how.
FIELD = 0  # address of void(t, stages, par, values) on one block of LANES stages
PAR = 1
ROWS = 2  # components of a stage: dof in second-order form, dim in first-order form
PADDED = 3  # ROWS rounded up to a multiple of 8
LANES = 4  # stages per call of the field: 8 or 16
BLOCKS = 5  # calls of the field per evaluation
CHUNKS = 6  # groups of 8 stages that carry weight
ROUTE = 7  # 8, 16: one matrix of so many columns; WIDE: a larger one; THROUGH: by Legendre coefficients
SECOND = 8  # 1: second-order form
UNIT = 9  # 1: the row's factor is in the matrix
STAGES = 10  # k, for the counters
DEGREE = 11  # s

# Tables.
RAW_MATRIX = 12  # the field's values -> stages (THROUGH: coefficients -> stages), for a step of 1
MATRIX = 13  # the same for the step H
EXTRAPOLATION = 14  # the previous step's values -> stages
MATRIX_SIZE = 15  # in vectors of 8
PROJECTION = 16  # the field's values -> coefficients
COEFFICIENT_CHUNKS = 17  # groups of 8 coefficients
FIRST_COEFFICIENT = 18  # where gamma_0 is among them
MODE_PROJECTION = 19  # the field's values -> the coefficients that are extrapolated
MODE_CHUNKS = 20
MODES = 21
BASIS = 22  # room for a table made on the way
NODES = 23
NODES_LOW = 24
WEIGHTS = 25
WEIGHTS_LOW = 26
POSITION_WEIGHTS = 27
POSITION_WEIGHTS_LOW = 28
VELOCITY = 29  # q' = VELOCITY * p, by row
ROW_FACTOR = 30  # h * VELOCITY by row; 1 in first-order form
STEP_FACTOR = 31  # the same in blocks [kh kh kh kh 0 0 0 0]
KICK_FACTOR = 32  # and in blocks [1 1 1 1 kh kh kh kh]

# Stage memory.
Q = 33
OTHER_Q = 34  # the stages before the last product, where changes are measured
F = 35
BASE = 36  # what a stage has besides the state and the forces
SUM = 37
COEFFICIENTS = 38
TIMES = 39

# State and what belongs to a row.
STATE = 40  # second-order form: blocks [p p p p q q q q]; first-order form: y
ERROR = 41  # what STATE lacks, in the same places
NEXT_STATE = 42
NEXT_ERROR = 43
ROW_STATE = 44
ROW_ERROR = 45
ROW_DRIFT = 46  # h q'
ROW_DRIFT_LOW = 47
STRICT = 48  # 1 / size of the row's block
FLOORED = 49  # 1 / size of the row's block, small ones raised to a part of the largest in the group
SIZE = 50
LARGEST = 51
BLOCK = 52  # integers: block of each row
GROUP = 53  # integers: group of each block
BLOCK_COUNT = 54
GROUP_COUNT = 55

# The state of a trajectory besides the arrays above, and of its nonlinear solver.
H = 56  # double
T0 = 57  # double
N = 58  # steps since T0
LENGTH = 59  # double: length of the step that F belongs to; 0: none
SOLVED = 60  # 1: F solves the step ahead; BY_INCREMENT: so do the increments at INCREMENT
AGE = 61  # steps until sizes are taken anew
FREE = 62  # iterations without a test
TESTS = 63
TRIED = 64  # iterations of this start
PREDICTED = 65  # 1: the start was extrapolated
STALLED = 66
BEST = 67  # double
LAST = 68  # double
TOLERANCE = 69  # double
OUTCOME = 70
UNTESTED = 71  # iterations left before the first test, in a batch
ALIVE = 72  # 1: takes part in a batch
MADE = 73  # samples made
STRATEGY = 79  # which nonlinear solver is used; see below
SOLVER = 80  # address of the implicit solver, int64(context, memory, started); 0: not there yet
SOLVER_MEMORY = 81
IMPLICIT = 82  # 1: the implicit solver is at work
SLOW = 83  # steps in a row at which the fixed-point iteration was slow
HELD = 84  # steps for which the implicit solver stays at work when it takes over
LEFT = 85  # steps of these that are left
WANTED = 86  # 1: the implicit solver should be at work, and is not there
INCREMENT = 89  # what the implicit solver has found that the step adds to q, p or to y

# Counters.
STEPS = 74
ITERATIONS = 75
EVALUATIONS = 76
RESTARTS = 77
PARTIAL = 78
IMPLICIT_STEPS = 87
SWITCHES = 88

# Steps of varying length; see `integrators.kernel.step.vary`.
TIME_LOW = 90  # double: what T0 lacks
ALLOWED_ERROR = 91  # double: the estimated local error of a step, relative, at most
ALLOWED_DEFECT = 92  # double: the same of the quadrature; infinite: any
ERROR_DEGREE = 93  # degree of the Legendre coefficient that the error is estimated by
# b_l P_j(c_l) for ten j: 0 .. 3, the two up to ERROR_DEGREE, the last two, two from the middle; then what
# extrapolates to the start and to the end of the step.
ESTIMATORS = 94
ESTIMATES = 95  # room for these coefficients of the field, row by row, and for the blocks' numbers
NEXT_LENGTH = 96  # double: of the next step to be tried
LENGTH_AFTER = 97  # double: of the one after the step that is solved
LENGTH_BEHIND = 98  # double: of the last step; 0: unknown
ERROR_BEHIND = 99  # double: logarithm of the last step's estimated error, divided by its order ...
ERROR_AHEAD = 100  # double: ... and of that of the step that is solved
DEFECT_BEHIND = 101  # double: the same for the defect
DEFECT_AHEAD = 102  # double
LENGTH_LIMIT = 103  # double: no step is longer
REJECTED = 104  # 1: F is that of a rejected step of length LENGTH, from the present state
REJECTIONS = 105
ERROR_DECAY = 106  # double: of coefficients from one degree to the next, where the error is allowed
DEFECT_DECAY = 107  # double: the same where the defect is
ERROR_AIM = 108  # double: logarithm of the error to aim at, divided by its order
DEFECT_AIM = 109  # double
LOG_RATE = 110  # double: logarithm of the iteration's contraction, as measured
RECURRENCE = (
    111  # by which each mode follows from the two before: pairs a, b for P_{j+1} = a x P_j - b P_{j-1}
)

FUSED = (
    112  # address of whole sweeps, void(context, count, tested); 0: none, see `integrators.kernel.step.fused`
)
LEAST_SLOPE = 114  # double: of a block's field beside the largest in its group, where errors are estimated
CHANGE = 113  # double: the largest change of the last fused sweep

LONGEST = 115  # double: no step of varying length is longer
STOP = 116  # double: no step passes this time; infinite: none
DOUBT = 117  # double: last coefficients that are a smaller part of the low ones fall off well enough
SLOWEST_DECAY = 118  # double: of a smooth field, from the middle coefficients to the last ones
NEGLIGIBLE = 119  # double: part of a block's size that the error at a kink may be
KINKED = 120  # 1: in the step that was estimated the field does not look smooth
KINKS = 121  # places where steps were rejected for that
KINK_END = 122  # double: where the first such step at the last place would have ended
DOUBT_END = 124  # double: where the last step would have ended that failed or looked like one with a kink
KINK_PLACES = 123  # room for KINKS_KEPT pairs: time and length of the last step rejected at each place

CONTEXT = 128

# Numbers in ESTIMATES per block: its size, its largest coefficient, the error's, the defect's, and the
# largest that does not fall off as a smooth field's do.
BLOCK_ROOM = 5
KINKS_KEPT = 64

# Routes of a product that are not a number of columns.
WIDE, THROUGH = 0, 1

BY_INCREMENT = 2

# Strategies. AUTO: fixed point, and the implicit solver where that does not contract.
FIXED_POINT, AUTO, ALWAYS_IMPLICIT = range(3)

# How a step, or an advance, ended.
# SCATTERED: the iteration has converged, but not to the trajectory.
RUNNING, DONE, DIVERGED, NOT_FINITE, BUDGET, UNDERFLOW, SCATTERED = range(7)

# How states between steps are made.
SIDE, LAND, DENSE = range(3)
