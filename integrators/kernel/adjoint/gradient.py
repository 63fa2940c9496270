"""The steps of a trajectory, recorded, and their adjoint, as Python sees them."""

import numpy as np

from integrators.kernel import tables
from integrators.kernel.adjoint.memory import HEAD, Pullback, Tape
from integrators.kernel.adjoint.tableau import adjoint
from integrators.kernel.context import DONE, Context, Shape
from integrators.kernel.engines import pull, record
from integrators.kernel.native.field import compile_field
from integrators.kernel.native.memory import aligned
from integrators.kernel.step.rule import FIRST_RATE, LOG_RESIDUAL_VARYING, STAGNATION, TOLERANCE
from integrators.protocol import Array
from problems import targets
from problems.problem import System


class Records:
    """Room for the records of so many steps of a trajectory.

    Parameters
    ----------
    shape : Shape
        Of the trajectory.
    capacity : int
        Steps that there is room for.
    """

    def __init__(self, shape: Shape, capacity: int):
        self.shape = shape
        self.tape = Tape({"capacity": capacity, "size": record_size(shape)}, {})

    def attach(self, context: Context) -> None:
        """Let the steps of a trajectory be recorded here."""
        context.follow, context.follow_memory = record.code(), self.tape

    def __len__(self) -> int:
        assert not self.tape.full
        return self.tape.count

    @property
    def bytes(self) -> int:
        """What they take in memory."""
        return 8 * self.tape.capacity * self.tape.size

    def read(self) -> tuple[Array, Array, Array]:
        """Return heads (n, HEAD), stages (n, rows, k) and states at the starts (n, dim)."""
        shape, c = self.shape, self.shape.constants
        rows = self.tape.records.reshape(-1, self.tape.size)[: len(self)]
        calls = _calls(shape)
        end = HEAD + calls * shape.rows * c.lanes
        stages = rows[:, HEAD:end].reshape(-1, calls, shape.rows, c.lanes).swapaxes(1, 2)
        return (
            rows[:, :HEAD],
            stages.reshape(len(self), shape.rows, -1)[..., : c.k],
            rows[:, end:][:, : shape.dim],
        )


def record_size(shape: Shape) -> int:
    """Return how many doubles the record of a step takes."""
    return HEAD + _calls(shape) * shape.rows * shape.constants.lanes + -(-shape.dim // 8) * 8


def _calls(shape: Shape) -> int:
    return -(-shape.constants.k // shape.constants.lanes)


class Adjoint:
    """The adjoint of the steps of a method on a system, from the last one on backwards.

    Parameters
    ----------
    system : System
        Traced.
    shape : Shape
        Of the trajectories.
    par : ndarray, shape (n_par,)
    parameters : bool
        Whether derivatives with respect to the parameters are wanted.
    """

    def __init__(self, system: System, shape: Shape, par: Array, parameters: bool):
        self._system, self._second, self._par = system, shape.second, par
        c = shape.constants
        if shape.second:
            c = tables.constants(c.k, c.s, False, c.lanes)
        self._forward, self._constants = c, adjoint(c)
        dim = system.dim
        field = compile_field(system, (-system.product("state")).named("adjoint"), c.lanes)
        halves = 1 if system.dof is None else 2
        block = np.arange(dim) // (dim // halves)
        own = Shape(dim, False, True, field, None, system.n_par, block, np.arange(halves), self._constants)
        fixed = tables.fixed(self._constants)
        if c.route != tables.THROUGH:
            fixed["raw_matrix"] = tables.rounded(self._constants)
        fixed["extrapolation"] = tables.extrapolations(c) if c.route > tables.THROUGH else aligned(0)
        self.context = context = Context(own, fixed, {"padded": 2 * (-(-dim // 8) * 8)})
        context.solver.tolerance, context.solver.stagnation = TOLERANCE, STAGNATION
        context.solver.log_residual, context.solver.rate = LOG_RESIDUAL_VARYING, FIRST_RATE
        context.varying = 1
        context.par[:] = par
        self._wanted = parameters and system.n_par > 0
        wanted = system.n_par if self._wanted else 0
        self._memory = Pullback({"parameters": wanted, "room": wanted * c.lanes, "states": dim}, {})
        if wanted:
            self._memory.slopes = compile_field(system, system.product("parameters"), c.lanes)

    def begin(self, gradient: Array) -> None:
        """Set the gradient with respect to the end; those with respect to the parameters go on adding up."""
        self.context.write(gradient)
        self.context.error[:] = 0.0
        self.context.length = 0.0

    def follow(self, records: Records) -> None:
        """Follow recorded steps, the last one first."""
        if not len(records):
            return
        heads, stages, states = records.read()
        if self._second:
            stages = self._whole(heads, stages, states)
        heads, stages = heads[::-1].copy(), stages[::-1, :, ::-1]
        c, memory = self._constants, self._memory
        calls, (n, dim, k) = _calls(self.context.shape), stages.shape
        room = aligned(n * calls * dim * c.lanes)
        blocks = room.reshape(n, calls, dim, c.lanes)
        padded = np.concatenate([stages, np.repeat(stages[..., -1:], calls * c.lanes - k, axis=2)], axis=2)
        blocks[:] = padded.reshape(n, dim, calls, c.lanes).swapaxes(1, 2)
        memory.point({"heads": heads, "stages": room})
        memory.count, memory.next = n, 0
        while pull(self.context, memory) != DONE:
            self._solve(heads[memory.next], stages[memory.next])
            memory.next += 1

    def _whole(self, heads: Array, positions: Array, states: Array) -> Array:
        """Return the stages of positions and momenta, from those of the positions."""
        n, dof, k = positions.shape
        flat = positions.swapaxes(0, 1).reshape(dof, -1)
        times = (heads[:, [0]] + heads[:, [2]] * heads[:, [3]]) + heads[:, [3]] * self._nodes
        forces = targets.numpy(self._system, "force")(
            times.reshape(-1), np.concatenate([flat, np.zeros_like(flat)]), self._par
        )
        forces = forces.reshape(dof, n, k).swapaxes(0, 1)
        momenta = states[:, dof:, np.newaxis] + heads[:, 3, np.newaxis, np.newaxis] * (
            forces @ self._matrix.T
        )
        return np.concatenate([positions, momenta], axis=1)

    @property
    def _nodes(self) -> Array:
        return self._forward.arrays["nodes"].reshape(-1)

    @property
    def _matrix(self) -> Array:
        """The matrix of the forward method, (k, k)."""
        return _matrix(self._forward)

    def _solve(self, head: Array, stages: Array) -> None:
        """Follow one step, whose equations the fixed-point iteration did not solve, by elimination."""
        context, (dim, k) = self.context, stages.shape
        t0, _, n, h = head[:4].tolist()
        times = t0 + (n + 1.0) * h - h * self._nodes
        units = np.repeat(np.eye(dim), k, axis=1)  # weights: each unit vector at each stage
        product = targets.numpy(self._system, self._system.product("state"))
        at = np.concatenate([units, np.tile(stages, (1, dim))])
        jacobians = product(np.tile(times, dim), at, self._par).reshape(dim, dim, k)  # [d, e]: df_e/dy_d
        end = context.read()
        matrix = np.eye(k * dim) - h * np.einsum("ij,dej->idje", _matrix(self._constants), jacobians).reshape(
            k * dim, k * dim
        )
        weights = self._constants.arrays["weights"].reshape(-1)
        solved = np.linalg.solve(matrix, np.tile(end, k)).reshape(k, dim)
        context.write(end + h * np.einsum("j,dej,je->d", weights, jacobians, solved))
        context.error[:] = 0.0
        context.length = 0.0
        if self._wanted:
            at = np.concatenate([solved.T, stages])
            slopes = targets.numpy(self._system, self._system.product("parameters"))(times, at, self._par)
            self._memory.sums[:] += h * (slopes @ weights)

    @property
    def gradient(self) -> tuple[Array, Array]:
        """The derivatives with respect to the state now, and to the parameters."""
        memory = self._memory
        return self.context.read(), memory.sums + memory.sums_low


def _matrix(constants: tables.Constants) -> Array:
    """Return the matrix of a method, (k, k)."""
    matrix = constants.arrays["matrix"]
    return matrix @ constants.arrays["projection"] if constants.route == tables.THROUGH else matrix
