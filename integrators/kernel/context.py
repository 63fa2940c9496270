"""The memory of a trajectory, by name: every slot with its type, its shape and its meaning.

Compiled functions take the address of a `Context` and nothing else, so their signature
does not change with what they do, and a batch is a row of contexts. There ``ctx.h`` is a
number and ``ctx.stages`` an address; see `integrators.kernel.native.memory`.

Stage memory is a structure of arrays: `calls` blocks of `padded` rows of `lanes`
doubles; row d of a block holds component d of the block's stages, side by side, as
the vector field wants it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from integrators.kernel.native.memory import Array, Integer, Memory, Real
from integrators.kernel.tables import Constants
from problems.analysis.sides import MOST
from problems.problem import System

Numbers = NDArray[np.float64]
Integers = NDArray[np.int64]

# How a step, or an advance, ended.
# SCATTERED: the iteration has converged, but not to the trajectory. NOT_KEPT: a quantity that a line
# integral is to keep is no invariant. HALTED: a search for events has to be attended to before the next step.
# UNSCALED: the step ahead does not become good enough however short it is, and the sizes that the blocks
# will reach may say that it is. UNSEEN: a partial step sees what the step ahead has not. SLIDING: the field
# pushes back to a switching surface from both sides. ACTS: an event in the step changes the state.
# ACCUMULATE: such events come after ever shorter times.
RUNNING, DONE, DIVERGED, NOT_FINITE, BUDGET, UNDERFLOW, SCATTERED, NOT_KEPT, HALTED = range(9)
UNSCALED, UNSEEN, SLIDING, ACTS, ACCUMULATE = range(9, 14)

# How states between steps are made.
SIDE, LAND, DENSE = range(3)

# Which nonlinear solver is used. AUTO: fixed point, and the implicit solver where that does not contract.
FIXED_POINT, AUTO, ALWAYS_IMPLICIT = range(3)
NOT_WANTED, FOR_STEPS, FOR_VECTORS = range(3)

# What solves the step ahead, if anything does: the values, or increments that the implicit solver has found.
UNSOLVED, BY_VALUES, BY_INCREMENT = range(3)

# What whole sweeps do after the last one, if anything; see `Context.fused`.
MEASURE, EVALUATE = 1, 2

# What a line integral does; see `Context.line`.
VALUES, END, ARRIVE = range(3)

# What vectors follow; see `Context.follow`: a solved STEP, a sample at the present STATE, or at the end of a
# solved PART, and the present state's LANDING there.
STEP, STATE, PART_END, LANDING = range(4)

# What the search for events is asked for at the end of a step that such an event ends: to CHANGE the state,
# and to BEGIN_ANEW from there.
CHANGE, BEGIN_ANEW = 1, 2

KINKS_KEPT = 64
MOST_SIDES = 1 + MOST  # rows of what tells the sides of switching surfaces

# What is known of the field where a step ends: NOTHING; the values that its polynomial says, EXTRAPOLATED,
# which are compared with those of the next; that they are right, SEEN. At a START it may jump.
START, NOTHING, EXTRAPOLATED, SEEN = range(-1, 3)

# Where a solved step crosses a switching surface, besides at a node: after the last one; nowhere.
END_ACROSS, NO_SURFACE = -1, -2

# A state on a switching surface: at the end of a step; at the start of the trajectory.
AT_STEP_END, AT_ORIGIN = 1, 2

# Legendre coefficients of the field that a step is judged by: gamma_0 .. gamma_3, that before and that of
# `Context.error_degree`, the last two that k nodes see, two from the middle. Then the field at a step's ends.
GAMMA_0, GAMMA_1, GAMMA_2, GAMMA_3, BEFORE_ERROR, AT_ERROR, BEFORE_LAST, LAST = range(8)
MIDDLE, AFTER_MIDDLE, AT_START, AT_END = range(8, 12)

STAGE = ("calls", "padded", "lanes")  # shape of stage memory


@dataclass(frozen=True, eq=False)
class Shape:
    """What the memory of all trajectories of a program has in common.

    Attributes
    ----------
    rows : int
        Components of a stage.
    second : bool
        Second-order form: a stage holds positions, the state (q, p).
    unit : bool
        Whether the rows' factors are in the matrix.
    field : int
        Address of the vector field.
    fused : int
        Address of whole sweeps; 0: none.
    parameters : int
        Length of the parameter vector.
    block, group : ndarray of int
        Block of each row, group of each block.
    constants : Constants
        The method's.
    """

    rows: int
    second: bool
    unit: bool
    field: int
    fused: int
    parameters: int
    block: Integers
    group: Integers
    constants: Constants

    @property
    def dim(self) -> int:
        """Length of the state."""
        return self.rows * (2 if self.second else 1)

    @cached_property
    def places(self) -> Integers:
        """Where the components of (q, p), or of y, are in `Context.state`."""
        if not self.second:
            return np.arange(self.rows)
        momenta = np.arange(self.rows) // 4 * 8 + np.arange(self.rows) % 4
        return np.concatenate([momenta + 4, momenta])


class Context(Memory):
    """A trajectory: what is integrated and how, tables, stages, the state, and how far it is.

    Parameters
    ----------
    shape : Shape
        Of the program.
    tables : mapping of str to ndarray
        Tables by their slot's name; not copied.
    more : mapping of str to number, optional
        What further slots begin with.
    """

    # --- what is integrated, and how ---
    field = Integer()  # address of void(times, stages, par, values) on one block of stages
    fused = Integer()  # address of whole sweeps, void(context, count, after); 0: none, see `step.fused`
    # address of a line integral, int64(what, context); 0: plain. It makes the VALUES at the stages from the
    # field, the state at a step's END, and learns of every new state at which the trajectory has ARRIVEd.
    line = Integer()
    parameters = Integer()
    par = Array("parameters")
    # address of what writes the gradient of the energy and then the energy itself, called like the field with
    # eight stages; 0: no projection. See `step.projection`.
    energy_code = Integer()
    energy = Real()  # that of the start, which steps end with,
    energy_scale = Real()  # and the inverse of how much of it the components make there
    energy_rows = Integer()  # rows of what it writes: one more than the state has; 0: no projection
    energy_width = Integer()  # components of a block of the state
    energy_places = Array(of=int)  # where the components of (q, p) or y are in `state`
    energy_state = Array("energy_rows", 8)
    energy_found = Array("energy_rows", 8)
    rows = Integer()  # components of a stage: dof in second-order form, dim in first-order form
    padded = Integer()  # `rows` rounded up to a multiple of 8
    lanes = Integer()  # stages per call of the field: 8 or 16
    calls = Integer()  # of the field per evaluation: blocks of stage memory
    chunks = Integer()  # groups of 8 stages that carry weight
    route = Integer()  # 8, 16: one matrix of so many columns; WIDE: a larger one; THROUGH: by coefficients
    second = Integer()  # 1: second-order form
    varying = Integer()  # 1: adaptive steps
    unit = Integer()  # 1: the row's factor is in the matrix
    k = Integer()  # stages, for the counters
    s = Integer()  # degree

    # --- tables ---
    raw_matrix = Array()  # values -> stages (THROUGH: coefficients -> stages), for a step of 1
    matrix = Array(8, "matrix_size")  # the same for the step h
    scaled_by = Real()  # the step that `step.begin.set_step` made it for
    # The previous step's values -> stages. Where steps vary, for a step of 1, for each of `tables.RATIOS`.
    extrapolation = Array()
    two_steps = Integer()  # whether first stages come from two steps
    extrapolation_two = Array()  # the values of the step before that one, and its own -> stages; route 8
    matrix_size = Integer()  # in vectors of 8
    projection = Array()  # values -> coefficients
    groups = Integer()  # of 8 coefficients
    first = Integer()  # where gamma_0 is among them
    mode_projection = Array()  # values -> the coefficients that are extrapolated
    mode_groups = Integer()
    modes = Integer()
    most_groups = Integer()  # the larger of `groups` and `mode_groups`
    recurrence = Array()  # pairs a, b for P_{j+1} = a x P_j - b P_{j-1}
    basis = Array(64, "chunks", "most_groups")  # room for a table made on the way
    nodes = Array()
    nodes_low = Array()
    weights = Array()
    weights_low = Array()
    position_weights = Array()
    position_weights_low = Array()
    velocity = Array("padded")  # q' = velocity * p, by row
    row_factor = Array("padded")  # h * velocity by row; 1 in first-order form
    drift_factor = Array(2, "padded")  # the same in blocks [kh kh kh kh 0 0 0 0]
    kick_factor = Array(2, "padded")  # and in blocks [1 1 1 1 kh kh kh kh]

    # --- stage memory ---
    stages = Array(*STAGE)
    old_stages = Array(*STAGE)  # before the last product, where changes are measured
    values = Array(*STAGE)  # of the field
    older_values = Array(*STAGE)  # of the step before
    base = Array(*STAGE)  # what a stage has besides the state and the forces
    sums = Array(*STAGE)
    coefficients = Array(8, "most_groups", "padded")
    times = Array("calls", "lanes")

    # --- the state, and what belongs to a row ---
    state = Array(2, "padded")  # second-order form: blocks [p p p p q q q q]; first-order form: y
    error = Array(2, "padded")  # what `state` lacks, in the same places
    next_state = Array(2, "padded")
    next_error = Array(2, "padded")
    increment = Array()  # what the implicit solver has found that the step adds to q, p or to y
    row_state = Array("padded")
    row_error = Array("padded")
    row_drift = Array("padded")  # h q'
    row_drift_low = Array("padded")
    strict = Array("padded")  # 1 / size of the row's block
    floored = Array("padded")  # 1 / size of the row's block, small ones raised to a part of the largest
    block_count = Integer()
    group_count = Integer()
    block = Array(of=int)  # of each row
    group = Array(of=int)  # of each block
    size = Array("block_count")
    largest = Array("block_count")  # size in each group
    # How far the stages of a group are from the state, where a block is one component and all steps have one
    # length. The field of a component is a sum over others, and its rounding of the size of the largest's.
    farthest = Array("block_count")

    # --- where it is, and the nonlinear solver ---
    h = Real()
    t0 = Real()
    time_low = Real()  # what `t0` lacks, where steps vary
    n = Integer()  # steps since `t0`
    length = Real()  # of the step that `values` belong to; 0: none
    older_length = Real()  # of the one that `older_values` belong to, right before that; 0: none
    solved = Integer()  # what solves the step ahead: UNSOLVED, BY_VALUES, BY_INCREMENT
    age = Integer()  # steps until sizes are taken anew
    free = Integer()  # iterations without a test
    tests = Integer()
    tried = Integer()  # iterations of this start
    predicted = Integer()  # 1: the start was extrapolated
    stalled = Integer()
    best = Real()  # the smallest change
    last = Real()  # change; see `step.iterate`
    change = Real()  # the largest of the last fused sweep
    tolerance = Real()  # the relative change at which the iteration has converged
    trusted = Real()  # a change from which on adaptive steps iterate without a test,
    log_trusted = Real()  # and the binary logarithm of one before which they do
    log_rest = Real()  # binary logarithm of what may be left of a change when the step is solved
    rate = Real()  # binary logarithm of the iteration's contraction, as measured
    outcome = Integer()
    made = Integer()  # samples
    strategy = Integer()  # FIXED_POINT, AUTO, ALWAYS_IMPLICIT
    solver = Integer()  # address of the implicit solver, int64(context, memory, started); 0: not there yet
    solver_memory = Integer()
    implicit = Integer()  # 1: the implicit solver is at work
    wanted = Integer()  # it should be, and is not there: FOR_STEPS, or only FOR_VECTORS that follow
    slow = Integer()  # steps in a row at which the fixed-point iteration was slow
    held = Integer()  # steps for which the implicit solver stays at work when it takes over
    left = Integer()  # steps of these that are left
    look = Integer()  # address of int64(context, memory), which looks for events in each step; 0: none
    look_memory = Integer()
    acts = Integer()  # 1: some of these change the state; then steps end there, see `step.act`
    seen = Integer()  # 1: the solved step has been looked at
    acting = (
        Integer()
    )  # what an event that ends the solved step asks for: CHANGE, BEGIN_ANEW; 0: none ends it
    act_time = Real()  # when
    length_before = Real()  # of the step before it was ended there
    acted = Real()  # when such an event happened last; infinite: never
    follow = Integer()  # address of int64(what, context, memory), which vectors follow the steps by; 0: none
    follow_memory = Integer()

    # --- counters ---
    steps = Integer()
    iterations = Integer()
    evaluations = Integer()
    restarts = Integer()
    partial = Integer()
    implicit_steps = Integer()
    switches = Integer()
    rejections = Integer()

    # --- adaptive steps; see `step.vary` ---
    allowed_error = Real()  # the estimated local error of a step, relative, at most
    allowed_defect = Real()  # the same of the quadrature; infinite: any
    error_degree = Integer()  # of the Legendre coefficient that the error is estimated by
    estimators = Array()  # b_l P_j(c_l), a row for each of GAMMA_0 .. AT_END
    estimates = Array(8, "rows")  # the coefficients GAMMA_0 .. LAST of the field, row by row
    # Velocity by momentum of a block, and the inverse; 1 in first-order form. Blocks compare as velocities:
    # a light body has small momenta, and is no less important.
    speed = Array("block_count")
    mass = Array("block_count")
    scale = Array("block_count")  # of blocks: their size in the step that is estimated,
    slope = Array("block_count")  # the largest coefficient of their field,
    gamma_error = Array("block_count")  # gamma_s, which the error is estimated by,
    gamma_last = Array("block_count")  # gamma_{k-1}, which the defect is estimated by,
    abrupt = Array("block_count")  # and the largest that does not fall off as a smooth field's do
    fastest = Array("block_count")  # scale in each group, as a velocity,
    steepest = Array("block_count")  # and slope
    absolute = Array("block_count")  # the absolute tolerance of blocks, divided by the relative one
    expected = Array("block_count")  # the largest size that blocks will reach, as far as is known
    rescaled = Integer()  # > 0: errors are relative to that where it is larger than a block's own size
    borrowed = Integer()  # 1: by their own sizes alone the step that was estimated is not good enough
    asks = (
        Integer()
    )  # 1: what blocks will reach can be asked for, by UNSCALED; -n: after n steps again; 0: never
    blind = Integer()  # 1: the field has the same value at all nodes of the step that was estimated
    restful = Integer()  # 1: the field at the start tells no time scale
    next_length = Real()  # of the next step to be tried
    length_after = Real()  # of the one after the step that is solved
    length_behind = Real()  # of the last step; 0: unknown
    error_behind = Real()  # logarithm of the last step's estimated error, divided by its order ...
    error_ahead = Real()  # ... and of that of the step that is solved
    defect_behind = Real()  # the same for the defect
    defect_ahead = Real()
    error_aim = Real()  # logarithm of the error to aim at, divided by its order
    defect_aim = Real()
    error_decay = Real()  # of coefficients from one degree to the next, where the error is allowed
    defect_decay = Real()  # the same where the defect is
    least_slope = Real()  # of a block's field beside the largest in its group, where errors are estimated
    rejected = Integer()  # 1: `values` are those of a rejected step of `length`, from the present state
    length_limit = Real()  # no step is longer, for what the iteration allows
    longest = Real()  # no step is longer, for what the user allows and the interval
    longest_blind = Real()  # the same where the field has the same value at all nodes of a step
    interval = Real()  # length of all that is integrated, from the trajectory's start; 0: unknown
    busy_implicit = Real()  # corrections of a step by the implicit solver to aim at, at most
    stop = Real()  # no step passes this time; infinite: none
    attempts = Integer()  # at the step ahead that were rejected,
    doubts = Integer()  # and those of them that did not look smooth
    doubt = Real()  # last coefficients that are a smaller part of the low ones fall off well enough
    slowest_decay = Real()  # of a smooth field, from the middle coefficients to the last ones
    negligible = Real()  # part of a block's size that the error at a kink may be
    sides = Integer()  # address of `problems.analysis.sides`, called like the field; 0: no such surfaces
    surfaces = Integer()  # how many distances it has besides: rows after the first
    side_values = Array("calls", MOST_SIDES, "lanes")  # its values at the stages,
    side_ends = Array(MOST_SIDES, "lanes")  # at the start, then at the end of the step,
    side_between = Array(MOST_SIDES, "lanes")  # and between two nodes
    side_times = Array("lanes")
    side_state = Array(2, "padded")  # a state there
    crossed = Integer()  # 1: a switching surface lies in the step that was attempted
    across = Integer()  # the first node beyond one, or END_ACROSS, or NO_SURFACE
    # Steps that end on a switching surface; see `step.surfaces`.
    locating = Integer()  # attempts at the step ahead to end it there; 0: none
    near = Real()  # length of the longest of them that crosses none, and
    far = Real()  # of the shortest that does
    apart_from_surface = Real()  # how far the surface was from the end of the last one, in parts of it
    surface = Integer()  # row of the distance that vanishes there; 0: unknown
    length_wanted = Real()  # of the step ahead, before that
    landing = Integer()  # 1: the step that is solved ends on a surface
    on_surface = Integer()  # the present state is on one: AT_STEP_END, AT_ORIGIN; 0: it is not
    kinked = Integer()  # 1: in the step that was estimated the field does not look smooth
    kinks = Integer()  # places where steps were rejected for that
    kink_end = Real()  # where the first such step at the last place would have ended
    doubt_end = Real()  # where the last step would have ended that failed or looked like one with a kink
    # The field where steps meet, which no node sees; see `step.kinks`. At the end of the step ahead, as its
    # polynomial says, eight partial sums a row; the same of the step behind.
    borders = Array(8, "padded")
    borders_behind = Array(8, "padded")
    gaps = Array("rows")  # how far that is from what the polynomial of the step ahead says
    apart = Integer()  # 1: for one of them that is more than for a smooth field
    lasts = Array("rows")  # the larger of the last two coefficients of a row,
    lasts_behind = Array("rows")  # and in the step behind
    border = Integer()  # what is known of the step behind: START, NOTHING, EXTRAPOLATED, SEEN
    border_ahead = Integer()  # the same of the step ahead
    breaks = Integer()  # 1: `stop` is a time at which the field may jump
    undone = Integer()  # 1: the field jumps before the end of the step behind
    behind_state = Array(2, "padded")  # the state before the step behind, to go back to
    behind_error = Array(2, "padded")
    behind_time = Real()
    behind_low = Real()
    behind_on_surface = Integer()  # `on_surface` there
    # Reversible steps, of length `epsilon` / density; see `step.reversible`.
    pace = Integer()  # address of `problems.emit.time_scale`, called like the field; 0: no such steps
    pace_rows = Integer()
    pace_parameters = Integer()
    pace_par = Array("pace_parameters")
    pace_state = Array("pace_rows", "lanes")
    pace_values = Array(2, "lanes")
    pace_times = Array("lanes")
    epsilon = Real()  # negative backwards
    log_density = Real()  # of the step ahead
    log_density_behind = Real()
    density_slope = Real()  # of the logarithm, in time, at the state
    kink_places = Array(2, KINKS_KEPT)  # pairs: time and length of the last step rejected at each place

    def __init__(self, shape: Shape, tables: Mapping[str, Numbers], more: Mapping[str, int] | None = None):
        c, rows = shape.constants, shape.rows
        groups, mode_groups = -(-(c.s + c.first) // 8), -(-c.modes // 8)
        numbers = {
            "field": shape.field, "fused": shape.fused, "parameters": shape.parameters,
            "rows": rows, "padded": -(-rows // 8) * 8, "lanes": c.lanes, "calls": -(-c.k // c.lanes),
            "chunks": -(-c.k // 8), "route": c.route, "second": shape.second, "unit": shape.unit,
            "k": c.k, "s": c.s, "matrix_size": tables["raw_matrix"].size // 8, "groups": groups,
            "first": c.first, "two_steps": int(c.two_steps), "mode_groups": mode_groups, "modes": c.modes,
            "most_groups": max(groups, mode_groups),
            "block_count": shape.group.size, "group_count": int(shape.group.max()) + 1, "energy_rows": 0,
            "pace_rows": 0, "pace_parameters": 0,
        }  # fmt: skip
        super().__init__({**numbers, **(more or {})}, {**tables, "block": shape.block, "group": shape.group})
        self.shape = shape
        self.row_factor[:] = self.speed[:] = self.mass[:] = 1.0
        self.kick_factor.reshape(-1, 8)[:, :4] = 1.0

    def read(self) -> Numbers:
        """Return a copy of the state, as (q, p) or y; shape (dim,)."""
        return self.state[self.shape.places]

    def write(self, y: Numbers) -> None:
        """Set the state, given as `read` returns it."""
        self.state[self.shape.places] = y

    @property
    def tables(self) -> dict[str, Numbers]:
        """The tables of coefficients that it points to."""
        slots = self.slots
        return {
            name: array
            for name, array in self._pointed.items()
            if isinstance(slot := slots[name], Array) and slot.of is float
        }

    def set_factors(self, h: float) -> None:
        """Set h and what is h times the velocities."""
        self.h = h
        if self.shape.second:
            rows = self.shape.rows
            kh = h * self.velocity[:rows]
            places = self.shape.places[rows:]
            self.row_factor[:rows] = kh
            self.drift_factor[places] = kh
            self.kick_factor[places + 4] = kh


def blocks(system: System) -> tuple[Integers, Integers]:
    """Return the block of each component, and the group (q or p) of each block.

    The change of an iteration is measured relative to the size of a block: the
    coordinates or momenta of one body, where the system says that it has bodies, so
    that a planetoid's tiny momentum is resolved, and else every component by itself.
    """
    dim, dof, width = system.dim, system.dof, width_of_blocks(system)
    block = np.arange(dim) // width
    group = np.zeros(dim // width, dtype=np.int64)
    if dof is not None:
        group[dof // width :] = 1
    return block, group


def width_of_blocks(system: System) -> int:
    """Return how many components a block has: the coordinates of a body, or one."""
    bodies = getattr(system, "bodies", None)
    return bodies.dimension if bodies is not None else 1
