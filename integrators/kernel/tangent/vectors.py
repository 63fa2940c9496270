"""Tangent vectors of one trajectory, as Python sees them."""

from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np

from integrators.kernel.context import Context, Shape
from integrators.kernel.implicit import engine as implicit_engine
from integrators.kernel.implicit.workspace import Workspace
from integrators.kernel.native.field import compile_field
from integrators.kernel.native.memory import aligned
from integrators.kernel.step.rule import FIRST_RATE
from integrators.kernel.tangent.engine import follow
from integrators.kernel.tangent.memory import Tangents
from integrators.protocol import Array
from problems import emit
from problems.problem import System
from problems.trace.graph import reachable

MOST = 8  # vectors in a group
FEWEST = 2  # samples that there is room for, of which nobody may want to know: those of single steps
OPERATIONS = 1000  # of the derivatives of a group, about: what is written out takes its time to be compiled


@dataclass(frozen=True, eq=False)
class Directions:
    """Tangent vectors at the start of a trajectory.

    Attributes
    ----------
    state : ndarray, shape (dim, n)
        Their parts in the state.
    parameters : ndarray, shape (n_par, n)
        Their parts in the parameters, which stay as they are.
    """

    state: Array
    parameters: Array


class Vectors:
    """Tangent vectors that follow a trajectory.

    Parameters
    ----------
    system : System
        The trajectory's; traced.
    contexts : pair of Context
        Of the trajectory, and for its partial steps; complete, with the start.
    directions : Directions
        The vectors at the start.
    fresh : dict
        Where contexts are kept that the next trajectory of the same program can copy.
    """

    def __init__(
        self,
        system: System,
        contexts: tuple[Context, Context],
        directions: Directions,
        fresh: dict[tuple[int, bool], Context],
    ):
        self._fresh = fresh
        self._context = contexts[0]
        self.shape, self._parameters = directions.state.shape, directions.parameters
        dim, count = self.shape
        moves = bool(directions.parameters.any())
        operations = len(reachable(system.function(self._function_name).roots))
        most = max(1, min(MOST, OPERATIONS // operations))
        parts = np.array_split(np.arange(count), -(-count // most))
        self._pairs, pulls = [], []
        self._solver: Workspace | None = None  # of the trajectory
        self.solvers: list[Workspace] = []
        """The implicit solvers of the vectors, where there are any."""
        for part in parts:
            chosen = Directions(directions.state[:, part], directions.parameters[:, part])
            self._pairs.append(tuple(self._follower(system, base, chosen, moves) for base in contexts))
            pulls.append(self._pulls(system, chosen))
        self._memory = memory = Tangents(
            {
                "trajectory": self._context.address, "dim": dim, "rows": self._context.shape.rows,
                "count": count, "groups": len(parts), "room_size": dim * len(parts[0]),
            },
            {},
        )  # fmt: skip
        memory.own[:] = [own.address for own, _ in self._pairs]
        memory.partial[:] = [partial.address for _, partial in self._pairs]
        memory.vectors[:] = [part.size for part in parts]
        self._kept_pulls = pulls
        memory.pulls[:] = [0 if pull is None else pull.ctypes.data for pull in pulls]
        self._known: dict[float, Array] = {}
        self.room(FEWEST)
        self._context.point({"follow_memory": memory.words})  # keeps it alive
        self._context.follow = follow.code().address

    @property
    def _function_name(self) -> str:
        return "force" if self._context.shape.second else "field"

    def _follower(self, system: System, base: Context, chosen: Directions, moves: bool) -> Context:
        """Return the context of a group that follows one of the trajectory's."""
        shape, n = base.shape, chosen.state.shape[1]
        if (n, moves) not in self._fresh:
            self._fresh[n, moves] = self._new_context(system, base, n, moves)
        context = self._fresh[n, moves].copy()
        context.point_to(base.used_tables)
        context.solver.tolerance, context.solver.log_rest, context.varying = (
            base.solver.tolerance,
            base.solver.log_rest,
            base.varying,
        )
        context.solver.rate = FIRST_RATE
        parameters = [base.par, *chosen.parameters.T] if moves else [base.par]
        context.par[:] = np.concatenate(parameters)
        if shape.second:
            context.factors.velocity[: n * shape.rows] = np.tile(base.factors.velocity[: shape.rows], n)
        context.write(_laid_out(chosen.state, shape.rows))
        return context

    def _new_context(self, system: System, base: Context, n: int, moves: bool) -> Context:
        """Return the context of n vectors, without what belongs to one trajectory."""
        shape = base.shape
        c, rows = shape.constants, n * shape.rows
        field = compile_field(system, system.tangent(self._function_name, n, parameters=moves), c.lanes)
        halves = 2 if not shape.second and system.dof is not None else 1
        block = np.arange(rows) // (shape.rows // halves)
        wider = Shape(
            rows, shape.second, shape.unit, field.address, 0,
            system.n_par * (1 + n if moves else 1), block, np.arange(halves * n), c,
        )  # fmt: skip
        padded = -(-rows // 8) * 8 + -(-shape.rows // 8) * 8
        return Context(wider, base.used_tables, {"padded": padded})

    def _pulls(self, system: System, chosen: Directions) -> Array | None:
        """Return the derivatives of the velocities relative to these, by row; ``None`` where they are 0."""
        shape = self._context.shape
        if not shape.second or shape.unit or not chosen.parameters.any():
            return None
        n = chosen.parameters.shape[1]
        along = system.tangent("velocity_scale", n, parameters=True)
        par = np.concatenate([self._context.par, *chosen.parameters.T])
        slopes = emit.numpy(system, along)(0.0, np.zeros(0), par)
        pulls = aligned(slopes.size)
        pulls[:] = slopes / np.tile(self._context.factors.velocity[: shape.rows], n)
        return pulls if pulls.any() else None

    def solve_by(self, solvers: tuple[Workspace, Workspace]) -> None:
        """Give the vectors the implicit solver of the trajectory and that of its partial steps."""
        self._solver = solvers[0]
        for pair, pulls in zip(self._pairs, self._memory.pulls.tolist(), strict=True):
            for context, solver in zip(pair, solvers, strict=True):
                workspace = solver.along(context.shape, context.padded, pulls)
                context.implicit.code, context.implicit.memory = (
                    implicit_engine.solver.code().address,
                    workspace.address,
                )
                context.point({"implicit.increment": workspace.increment})
                self.solvers.append(workspace)

    @property
    def iterations(self) -> int:
        """Iterations of all groups, own and partial steps."""
        return sum(context.counters.iterations for pair in self._pairs for context in pair)

    @property
    def failed(self) -> bool:
        """Whether the equations of a step's derivative were not solved."""
        return bool(self._memory.failed)

    def room(self, count: int) -> None:
        """Make room for the vectors at so many samples."""
        self._out = np.empty((max(count, FEWEST), *self.shape))
        self._memory.point({"out": self._out})

    def fits(self, directions: Directions) -> bool:
        """Whether other vectors differ in their parts in the state only."""
        same = directions.parameters.shape == self._parameters.shape
        return same and np.array_equal(directions.parameters, self._parameters)

    def put(self, state: Array) -> None:
        """Set the vectors at the last step; their parts in the parameters stay as they are."""
        first, rows = 0, self._context.shape.rows
        for own, _ in self._pairs:
            n = own.shape.rows // rows
            own.write(_laid_out(state[:, first : first + n], rows))
            own.error[:] = 0.0
            own.length = own.older_length = 0.0
            own.blocks.age = 0
            first += n

    def scale(self, factors: Array) -> None:
        """Multiply the vectors at the last own step by numbers."""
        first, rows = 0, self._context.shape.rows
        for own, _ in self._pairs:
            n = own.shape.rows // rows
            state = own.state.copy()
            own.write(_laid_out(np.tile(factors[first : first + n], (self.shape[0], 1)), rows))
            own.error[:] *= own.state
            own.state[:] *= state
            own.length = own.older_length = 0.0
            first += n

    @property
    def _step_ahead(self) -> list[Array]:
        """What the vectors need of the trajectory's step ahead, which may be solved."""
        return [self._context.stages, *([self._solver.gamma] if self._solver else [])]

    def save(self) -> tuple[Any, ...]:
        """Return copies of all that the continuation depends on."""
        groups = tuple(
            (own.words[_LASTING], tuple(array.copy() for array in _arrays(own))) for own, _ in self._pairs
        )
        solvers = tuple(solver.save() for solver in self.solvers)
        ahead = [array.copy() for array in self._step_ahead]
        return self.shape, self._parameters.copy(), ahead, groups, solvers

    def fit(self, saved: tuple[Any, ...] | None) -> bool:
        """Whether that was saved of vectors that differ from these in their parts in the state at most."""
        if saved is None or saved[0] != self.shape or not np.array_equal(saved[1], self._parameters):
            return False
        return saved[2][0].shape == self._context.stages.shape

    def restore(self, saved: tuple[Any, ...]) -> None:
        """Go back to what `save` returned."""
        _, _, ahead, groups, solvers = saved
        for array, kept in zip(self._step_ahead, ahead, strict=False):
            array[:] = kept
        for (own, _), (words, arrays) in zip(self._pairs, groups, strict=True):
            own.words[_LASTING] = words
            own.set_factors(own.h)
            for array, kept in zip(_arrays(own), arrays, strict=True):
                array[:] = kept
        for solver, kept in zip(self.solvers, solvers, strict=bool(solvers)):
            solver.restore(kept)

    def note(self, times: Array) -> None:
        """Keep the vectors of the samples that have been made, by their times."""
        for i, t in enumerate(times.tolist()):
            self._known[t] = self._out[i]

    def note_now(self, t: float) -> None:
        """Keep the vectors at the last step, at time t."""
        columns = []
        for own, _ in self._pairs:
            rows = self._context.shape.rows
            vectors = own.read().reshape(-1, own.shape.rows // rows, rows)
            columns.append(vectors.swapaxes(0, 1).reshape(vectors.shape[1], -1).T)
        self._known[t] = np.concatenate(columns, axis=1)

    def take(self, times: Array) -> Array:
        """Return the vectors at samples, shape (m, dim, n); forget them, and those between."""
        known, self._known = self._known, {}
        return np.array([known[t] for t in times.tolist()]).reshape(-1, *self.shape)


# What goes from step to step.
_LASTING = [
    Context.word_of[name]
    for name in (
        "h",
        "t0",
        "time_low",
        "n",
        "length",
        "older_length",
        "blocks.age",
        "solver.free",
        "solver.rate",
    )
]
_arrays = attrgetter("state", "error", "values", "older_values", "blocks.weights", "blocks.floored_weights")


def _laid_out(vectors: Array, rows: int) -> Array:
    """Return vectors, (dim, n), as the state of their context."""
    return vectors.T.reshape(vectors.shape[1], -1, rows).swapaxes(0, 1).reshape(-1)
