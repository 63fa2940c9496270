"""The memory of a trajectory, by name: every slot with its type, its shape and its meaning.

Compiled functions take the address of a `Context` and nothing else, so their signature
does not change with what they do, and a batch is a row of contexts. There ``ctx.h`` is a
number, ``ctx.stages`` an address and ``ctx.solver`` the part that the iteration reads and writes; see
`integrators.kernel.native.memory`. Each part has its own file in `integrators.kernel.parts`.

Stage memory is a structure of arrays: `calls` blocks of `padded` rows of `lanes`
doubles; row d of a block holds component d of the block's stages, side by side, as
the vector field wants it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from integrators.kernel.native.memory import Addressed, Array, Integer, Memory, Pointer, Real, Within
from integrators.kernel.parts.blocks import Blocks
from integrators.kernel.parts.controller import Controller
from integrators.kernel.parts.counters import Counters
from integrators.kernel.parts.discontinuities import Discontinuities
from integrators.kernel.parts.energy import Energy
from integrators.kernel.parts.estimate import Estimate
from integrators.kernel.parts.events import Events
from integrators.kernel.parts.factors import Factors
from integrators.kernel.parts.implicit import Implicit
from integrators.kernel.parts.pace import Pace
from integrators.kernel.parts.previous import Previous
from integrators.kernel.parts.scratch import STAGE, Scratch
from integrators.kernel.parts.solver import Solver
from integrators.kernel.parts.surfaces import Surfaces
from integrators.kernel.parts.tables import Tables

if TYPE_CHECKING:  # what compiled code does not depend on
    from integrators.kernel.tables import Constants
    from problems.problem import System

Numbers = NDArray[np.float64]
Integers = NDArray[np.int64]

# How a step, or an advance, ended.
# SCATTERED: the iteration has converged, but not to the trajectory. NOT_KEPT: a quantity that a line
# integral is to keep is no invariant. HALTED: a search for events has to be attended to before the next step.
# UNSCALED: the step ahead does not become good enough however short it is, and the sizes that the blocks
# will reach may say that it is. MISSED: a partial step sees what the step ahead has not. SLIDING: the field
# pushes back to a switching surface from both sides. ACTS: an event in the step changes the state.
# ACCUMULATE: such events come after ever shorter times. ANEW: one has happened within a step of fixed size,
# and steps are counted from there. RENEW: one has changed parameters, and what follows from them is not yet
# renewed. NOISY: noise of a field that is called may be what keeps steps short.
RUNNING, DONE, DIVERGED, NOT_FINITE, BUDGET, UNDERFLOW, SCATTERED, NOT_KEPT, HALTED = range(9)
UNSCALED, MISSED, SLIDING, ACTS, ACCUMULATE, ANEW, RENEW, NOISY = range(9, 17)

# How states between steps are made.
PARTIAL, STOP, DENSE = range(3)

# What solves the step ahead, if anything does: the values, or increments that the implicit solver has found.
UNSOLVED, BY_VALUES, BY_INCREMENT = range(3)

# What the entry of `trajectory` can do; see `integrators.kernel.trajectory.entry`.
RESET, ADVANCE, TAKE, PART, GO_ON, ACT, ATTEMPT = range(7)

# What whole iterations do after the last one, if anything; see `Context.fused`.
MEASURE, EVALUATE = 1, 2

# What a line integral does; see `Context.line`.
VALUES, END, ARRIVE = range(3)

# What vectors follow; see `Context.follow`: a solved STEP, a sample at the present STATE, or at the end of a
# solved PART, and the present state, which has STOPPED there.
STEP, STATE, PART_END, STOPPED = range(4)


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
    field : Addressed
        The vector field.
    fused : Addressed or None
        Whole iterations, if there are any.
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
    field: Addressed
    fused: Addressed | None
    parameters: int
    block: Integers
    group: Integers
    constants: "Constants"

    @property
    def dim(self) -> int:
        """Length of the state."""
        return self.rows * (2 if self.second else 1)

    @cached_property
    def state_indices(self) -> Integers:
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
    pointers : mapping of str to Addressed, optional
        What further slots point to.
    arrays : mapping of str to ndarray, optional
        Arrays that further slots point to.
    """

    # --- what is integrated, and how ---
    field = Pointer()  # void(times, stages, par, values) on one block of stages
    fused = Pointer()  # whole iterations, void(context, count, after); 0: none, see `step.fused`
    # A line integral, int64(operation, context); 0: plain. It makes the VALUES at the stages from
    # the field, the state at a step's END, and learns of every new state at which the trajectory has ARRIVEd.
    line = Pointer()
    follow = Pointer()  # int64(operation, context, memory), which vectors follow the steps by; 0: none
    follow_memory = Pointer()
    team = Pointer()  # threads that share the work, a `integrators.kernel.parts.team.Team`; 0: none
    parameters = Integer()
    par = Array("parameters")
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

    # --- where it is ---
    h = Real(lasting=True)
    t0 = Real(lasting=True)
    time_low = Real(lasting=True)  # what `t0` lacks
    n = Integer(lasting=True)  # steps since `t0`
    samples_written = Integer()  # samples
    # Second-order form: blocks [p p p p q q q q]; first-order form: y
    state = Array(2, "padded", lasting=True)
    error = Array(2, "padded", lasting=True)  # what `state` lacks, in the same places
    next_state = Array(2, "padded", lasting=True)
    next_error = Array(2, "padded", lasting=True)

    # --- the step ahead, and the steps before it ---
    solved = Integer(lasting=True)  # what solves the step ahead: UNSOLVED, BY_VALUES, BY_INCREMENT
    times = Array("calls", "lanes")
    stages = Array(*STAGE)
    values = Array(*STAGE, lasting=True)  # of the field
    older_values = Array(*STAGE, lasting=True)  # of the step before
    length = Real(lasting=True)  # of the step that `values` belong to; 0: none
    older_length = Real(lasting=True)  # of the one that `older_values` belong to, right before that; 0: none

    # --- parts ---
    tables = Within(Tables)
    factors = Within(Factors)
    scratch = Within(Scratch)
    blocks = Within(Blocks)
    solver = Within(Solver)
    implicit = Within(Implicit)
    controller = Within(Controller)
    estimate = Within(Estimate)
    discontinuities = Within(Discontinuities)
    previous = Within(Previous)
    surfaces = Within(Surfaces)
    events = Within(Events)
    energy = Within(Energy)
    pace = Within(Pace)
    counters = Within(Counters)

    def __init__(
        self,
        shape: Shape,
        tables: Mapping[str, Numbers],
        more: Mapping[str, int] | None = None,
        arrays: Mapping[str, NDArray[Any]] | None = None,
        pointers: Mapping[str, Addressed | None] | None = None,
    ):
        c, rows = shape.constants, shape.rows
        groups, mode_groups = -(-(c.s + c.first) // 8), -(-c.modes // 8)
        numbers = {
            "parameters": shape.parameters, "rows": rows, "padded": -(-rows // 8) * 8, "lanes": c.lanes,
            "calls": -(-c.k // c.lanes),
            "chunks": -(-c.k // 8), "route": c.route, "second": shape.second, "unit": shape.unit,
            "k": c.k, "s": c.s, "tables.matrix_size": tables["raw_matrix"].size // 8, "tables.groups": groups,
            "tables.first": c.first, "tables.two_steps": int(c.two_steps), "tables.mode_groups": mode_groups,
            "tables.modes": c.modes, "tables.most_groups": max(groups, mode_groups),
            "blocks.count": shape.group.size, "blocks.groups": int(shape.group.max()) + 1, "energy.rows": 0,
            "pace.rows": 0, "pace.parameters": 0,
        }  # fmt: skip
        blocks = {"blocks.of_row": shape.block, "blocks.group": shape.group}
        super().__init__(
            {**numbers, **(more or {})},
            {**_qualified(tables), **blocks, **(arrays or {})},
            {"field": shape.field, "fused": shape.fused, **(pointers or {})},
        )
        self.shape = shape
        self.factors.row[:] = self.blocks.speed[:] = self.blocks.mass[:] = 1.0
        self.factors.kick.reshape(-1, 8)[:, :4] = 1.0

    def read(self) -> Numbers:
        """Return a copy of the state, as (q, p) or y; shape (dim,)."""
        return self.state[self.shape.state_indices]

    def write(self, y: Numbers) -> None:
        """Set the state, given as `read` returns it."""
        self.state[self.shape.state_indices] = y

    def point_to(self, tables: Mapping[str, Numbers]) -> None:
        """Let it use other tables."""
        self.point(_qualified(tables))

    @property
    def used_tables(self) -> dict[str, Numbers]:
        """The tables of coefficients that it points to."""
        indices = {name: self.word_of[f"tables.{name}"] for name in Tables.slots}
        return {name: self.pointed[index] for name, index in indices.items() if index in self.pointed}

    def set_factors(self, h: float) -> None:
        """Set h and what is h times the velocities."""
        self.h = h
        if self.shape.second:
            rows, factors = self.shape.rows, self.factors
            kh = h * factors.velocity[:rows]
            indices = self.shape.state_indices[rows:]
            factors.row[:rows] = kh
            factors.drift[indices] = kh
            factors.kick[indices + 4] = kh


def _qualified(tables: Mapping[str, Numbers]) -> dict[str, Numbers]:
    return {f"tables.{name}": table for name, table in tables.items()}


def blocks(system: "System") -> tuple[Integers, Integers]:
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


def width_of_blocks(system: "System") -> int:
    """Return how many components a block has: the coordinates of a body, or one."""
    bodies = getattr(system, "bodies", None)
    return bodies.dimension if bodies is not None else 1
