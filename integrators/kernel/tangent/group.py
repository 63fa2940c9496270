"""The memory of a group of tangent vectors."""

from dataclasses import dataclass

import numpy as np

from integrators.kernel.context import Context, Shape
from integrators.kernel.native.field import compile_field
from integrators.kernel.native.memory import aligned
from integrators.kernel.step.rule import FIRST_RATE
from integrators.protocol import Array
from problems import targets
from problems.problem import System


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

    @property
    def move_parameters(self) -> bool:
        """Whether any has a part in the parameters."""
        return self.parameters.size > 0 and bool(self.parameters.any())

    def some(self, part: slice) -> "Directions":
        """Return some of the vectors."""
        return Directions(self.state[:, part], self.parameters[:, part])


class Group:
    """The vectors that one function differentiates the field for: their context, and that of partial steps.

    Parameters
    ----------
    system : System
        The trajectory's; traced.
    contexts : pair of Context
        Of the trajectory, and for its partial steps.
    chosen : Directions
        Where they begin: n >= 1 vectors at the present state of the trajectory.
    moves : bool
        Whether they, or vectors in other groups, have parts in the parameters.
    fresh : dict
        Where contexts are kept that other groups of the same program can copy.
    """

    def __init__(
        self, system: System, contexts: tuple[Context, Context], chosen: Directions, moves: bool,
        fresh: dict[tuple[int, bool], Context],
    ):  # fmt: skip
        self.count = count = chosen.state.shape[1]
        self._system, self._trajectory, self._moves = system, contexts[0], moves
        if (count, moves) not in fresh:
            # when it is complete: another thread may copy it at once
            fresh[count, moves] = self._new_context()
        self.own, self.partial = (fresh[count, moves].copy() for _ in contexts)
        for context, base in zip((self.own, self.partial), contexts, strict=True):
            if not base.varying:  # else all have the same
                context.point_to(base.used_tables)
            solver, rule = context.solver, base.solver
            solver.tolerance, solver.stagnation = rule.tolerance, rule.stagnation
            solver.log_residual, solver.rate, context.varying = rule.log_residual, FIRST_RATE, base.varying
        base = self._trajectory
        dim, rows = base.shape.dim, base.shape.rows
        parameters = [base.par, *chosen.parameters.T] if moves else [base.par]
        for context in (self.own, self.partial):
            context.par[:] = np.concatenate(parameters)
            if base.shape.second:
                context.factors.velocity[: rows * count] = np.tile(base.factors.velocity[:rows], count)
        self.pulls = self._pulls(chosen)
        """The derivatives of the velocities relative to these, by row; ``None`` where they are 0."""
        numbers = np.arange(dim * count).reshape(dim, count)
        in_order = numbers.T.reshape(count, -1, rows).swapaxes(0, 1).reshape(-1)  # as `Context.read` has them
        self._indices = np.empty((dim, count), dtype=np.intp)  # of component i of vector v in a state
        self._indices.flat[in_order] = self.own.shape.state_indices
        self.own.state[self._indices] = chosen.state

    def read(self) -> Array:
        """Return the vectors at the last step, shape (dim, n)."""
        return self.own.state[self._indices]

    def put(self, vectors: Array) -> None:
        """Set the vectors at the last step, shape (dim, n)."""
        own = self.own
        own.state[self._indices] = vectors
        own.error[:] = 0.0
        own.length = own.older_length = 0.0
        own.blocks.age = 0

    def scale(self, factors: Array) -> None:
        """Multiply the vectors at the last step by n numbers."""
        own = self.own
        own.error[self._indices] *= factors
        own.state[self._indices] *= factors
        own.length = own.older_length = 0.0

    def _new_context(self) -> Context:
        """Return the context of n vectors, without what belongs to one trajectory."""
        base, system, n = self._trajectory, self._system, self.count
        shape = base.shape
        c, rows = shape.constants, n * shape.rows
        along = system.tangent(function_of(shape), n, parameters=self._moves)
        field = compile_field(system, along, c.lanes)
        halves = 2 if not shape.second and system.dof is not None else 1
        block = np.arange(rows) // (shape.rows // halves)
        wider = Shape(
            rows, shape.second, shape.unit, field, None,
            system.n_par * (1 + n if self._moves else 1), block, np.arange(halves * n), c,
        )  # fmt: skip
        padded = -(-rows // 8) * 8 + -(-shape.rows // 8) * 8
        return Context(wider, base.used_tables, {"padded": padded})

    def _pulls(self, chosen: Directions) -> Array | None:
        """Return the derivatives of the velocities relative to these, by row; ``None`` where they are 0."""
        base, system = self._trajectory, self._system
        if not base.shape.second or base.shape.unit or not self._moves:
            return None
        along = system.tangent("velocity_scale", self.count, parameters=True)
        par = np.concatenate([base.par, *chosen.parameters.T])
        slopes = targets.numpy(system, along)(0.0, np.zeros(0), par)
        pulls = aligned(slopes.size)
        pulls[:] = slopes / np.tile(base.factors.velocity[: base.shape.rows], self.count)
        return pulls if pulls.any() else None


def function_of(shape: Shape) -> str:
    """Return the name of the function that steps evaluate."""
    return "force" if shape.second else "field"
