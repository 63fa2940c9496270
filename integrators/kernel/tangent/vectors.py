"""Tangent vectors of one trajectory, as Python sees them."""

from typing import Any

import numpy as np

from integrators.kernel.context import Context
from integrators.kernel.engines import follow, solver
from integrators.kernel.implicit.workspace import Workspace
from integrators.kernel.tangent.group import Directions, Group, function_of
from integrators.kernel.tangent.memory import Tangents
from integrators.protocol import Array
from problems.graph.nodes import reachable
from problems.problem import System

MOST = 8  # vectors in a group
FEWEST = 2  # samples that there is room for, of which nobody may want to know: those of single steps
OPERATIONS = 1000  # of the derivatives of a group, about: unrolled code takes long to compile


class Vectors:
    """The memory of tangent vectors that follow a trajectory, from its present state on.

    Parameters
    ----------
    system : System
        The trajectory's; traced.
    contexts : pair of Context
        Of the trajectory, and for its partial steps; complete, with the start.
    directions : Directions
        As many as the vectors, which move parameters if they do.
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
        self._context = contexts[0]
        self.shape, moves = directions.state.shape, directions.move_parameters
        dim, count = self.shape
        operations = len(reachable(system.function(function_of(self._context.shape)).roots))
        most = max(1, min(MOST, OPERATIONS // operations))
        ends = np.cumsum([part.size for part in np.array_split(np.arange(count), -(-count // most))]).tolist()
        self._parts = [slice(*ends_) for ends_ in zip([0, *ends[:-1]], ends, strict=True)]
        self._groups = [Group(system, contexts, directions.some(part), moves, fresh) for part in self._parts]
        self._memory = memory = Tangents(
            {
                "dim": dim, "rows": self._context.shape.rows,
                "count": count, "groups": len(ends), "room_size": dim * ends[0],
            },
            {},
        )  # fmt: skip
        memory.trajectory = self._context
        memory.own = [group.own for group in self._groups]
        memory.partial = [group.partial for group in self._groups]
        memory.vectors[:] = [group.count for group in self._groups]
        self._out = np.empty((0, *self.shape))
        self._known: dict[float, Array] = {}
        self._parameters = directions.parameters
        self._solver: Workspace | None = None  # of the trajectory
        self.solvers: list[Workspace] = []
        """The implicit solvers of the vectors, where there are any."""
        self.room(FEWEST)
        memory.pulls = [group.pulls for group in self._groups]
        self._context.follow, self._context.follow_memory = follow.code(), memory

    def solve_by(self, solvers: tuple[Workspace, Workspace]) -> None:
        """Give the vectors the implicit solver of the trajectory and that of its partial steps."""
        self._solver, code = solvers[0], solver.code()
        for group in self._groups:
            for context, own in zip((group.own, group.partial), solvers, strict=True):
                workspace = own.along(context.shape, context.padded, group.pulls)
                context.implicit.code, context.implicit.memory = code, workspace
                context.point({"implicit.increment": workspace.increment})
                self.solvers.append(workspace)

    @property
    def memory(self) -> Tangents:
        """What compiled code knows of them."""
        return self._memory

    @property
    def iterations(self) -> int:
        """Iterations of all groups, own and partial steps."""
        return sum(
            group.own.counters.iterations + group.partial.counters.iterations for group in self._groups
        )

    @property
    def failed(self) -> bool:
        """Whether the equations of a step's derivative were not solved."""
        return bool(self._memory.failed)

    def room(self, count: int) -> None:
        """Make room for the vectors at so many samples."""
        count = max(count, FEWEST)
        if self._out.shape[0] != count or self._known:  # which are parts of it
            self._out = np.empty((count, *self.shape))
            self._memory.point({"out": self._out})

    def fits(self, directions: Directions) -> bool:
        """Whether other vectors differ in their parts in the state only."""
        same = directions.parameters.shape == self._parameters.shape
        return same and np.array_equal(directions.parameters, self._parameters)

    def put(self, state: Array) -> None:
        """Set the vectors at the last step; their parts in the parameters stay as they are."""
        for group, part in zip(self._groups, self._parts, strict=True):
            group.put(state[:, part])

    def scale(self, factors: Array) -> None:
        """Multiply the vectors at the last own step by numbers."""
        for group, part in zip(self._groups, self._parts, strict=True):
            group.scale(factors[part])

    @property
    def _step_ahead(self) -> list[Array]:
        """What the vectors need of the trajectory's step ahead, which may be solved."""
        return [self._context.stages, *([self._solver.gamma] if self._solver else [])]

    def save(self) -> tuple[Any, ...]:
        """Return copies of all that the continuation depends on."""
        groups = tuple(group.own.lasting() for group in self._groups)
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
        for group, lasting in zip(self._groups, groups, strict=True):
            group.own.go_on(*lasting)
            group.own.set_factors(group.own.h)
        for own, kept in zip(self.solvers, solvers, strict=bool(solvers)):
            own.restore(kept)

    def note(self, times: Array) -> None:
        """Keep the vectors of the samples that have been made, by their times."""
        for i, t in enumerate(times.tolist()):
            self._known[t] = self._out[i]

    def note_now(self, t: float) -> None:
        """Keep the vectors at the last step, at time t."""
        self._known[t] = np.concatenate([group.read() for group in self._groups], axis=1)

    def take(self, times: Array) -> Array:
        """Return the vectors at samples, shape (m, dim, n); forget them, and those between."""
        known, self._known = self._known, {}
        return np.array([known[t] for t in times.tolist()]).reshape(-1, *self.shape)
