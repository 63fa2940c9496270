"""HBVM(k, s) for one system and along one trajectory: `Program` and `Stepper` over the compiled steps."""

from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from integrators.grid import Counts, plan
from integrators.kernel import fixed
from integrators.legendre import tables
from integrators.protocol import SAMPLINGS, Array, Samples, Stats, Status, check_state, check_times
from problems.errors import InputError, unknown
from problems.problem import System

CHUNK = 1 << 14  # steps between two looks at Ctrl-C


class HBVMProgram:
    """HBVM(k, s) with step h, compiled for one system; satisfies `integrators.protocol.Program`."""

    def __init__(self, system: System, *, k: int, s: int, h: float):
        started = perf_counter()
        self.system = system
        self.tables = tables(k, s)
        self.h = h
        self.field, field_cached = fixed.compile_field(system)
        kernel_cached = fixed.compile_kernel()
        self.block, self.group = blocks(system)
        self.from_cache = field_cached and kernel_cached
        self.compile_seconds = perf_counter() - started

    def start(self, y0: ArrayLike, par: ArrayLike | None = None, t0: float = 0.0) -> "HBVMStepper":
        """Return a stepper at ``t0``; ``par`` defaults to the system's own parameters.

        Raises
        ------
        problems.errors.InputError
            If ``y0`` is not finite, or ``y0`` or ``par`` is not of the system's length.
        """
        values = self.system.pack()
        if par is not None:
            if np.shape(par) != values.shape:
                raise InputError(f"par must have shape {values.shape}, not {np.shape(par)}; see system.pack.")
            values[:] = par
        return HBVMStepper(self, check_state(y0, self.system.dim), values, float(t0))


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """All that the continuation of an `HBVMStepper` depends on."""

    t0: float
    n: int
    h: float
    y: Array
    e: Array
    previous: Array
    length: float
    status: Status
    reason: str


class HBVMStepper:
    """A trajectory of HBVM(k, s); satisfies `integrators.protocol.Stepper`.

    The present time is ``t0 + n h`` with an integer n, never an accumulated sum.
    ``advance`` offers every sampling:

    ``"side"`` (default)
        A throw-away step of the missing length from the last own step: order 2s,
        energy as at the own steps, and the own steps are untouched.
    ``"steps"``
        The own steps themselves, up to the last time (and the present state, if
        the first time is the present).
    ``"land"``
        The last step before each time is shortened onto it and the next begins
        there. This changes the sequence of steps, which costs a symplectic
        method (k = s) its long-time behaviour.
    ``"dense"``
        The polynomial of the step: free, but of order s + 1 only, and it does not
        keep the energy.
    """

    def __init__(self, program: HBVMProgram, y: Array, par: Array, t0: float):
        self._program = program
        self._par = par
        self._t0, self._n, self._h = t0, 0, program.h
        self._y, self._e = y, np.zeros_like(y)
        self._previous, self._length = np.zeros((program.tables.s, y.size)), 0.0
        self._counters = np.zeros(5, dtype=np.int64)
        self._status, self._reason = Status.RUNNING, ""

    @property
    def t(self) -> float:
        """Time of the last own step."""
        return self._t0 + self._n * self._h

    @property
    def y(self) -> Array:
        """A copy of the state at the last own step."""
        return self._y.copy()

    @property
    def status(self) -> Status:
        """How the integration stands."""
        return self._status

    @property
    def reason(self) -> str:
        """One sentence on a failure; empty otherwise."""
        return self._reason

    @property
    def stats(self) -> Stats:
        """Counters of the work done; ``extra``: partial steps made, restarts from a bad extrapolation."""
        count = self._counters.tolist()
        return Stats(
            steps=count[fixed.STEPS],
            rejections=0,
            evaluations=count[fixed.EVALUATIONS],
            iterations=count[fixed.ITERATIONS],
            solver="fixed point",
            extra={"partial_steps": count[fixed.PARTIAL], "restarts": count[fixed.RESTARTS]},
        )

    def step(self) -> Status:
        """Take one step of length h; after a failure, do nothing."""
        if not self._status.failed:
            self._run(fixed.SIDE, np.zeros(1), np.array([self._n + 1]), np.zeros(1))
        return self._status

    def advance(self, times: ArrayLike, *, sample: str | None = None) -> Samples:
        """Integrate to ``times[-1]``; see the class for the samplings and the protocol for the rest."""
        if sample is not None and sample not in SAMPLINGS:
            raise unknown("sampling", str(sample), SAMPLINGS)
        grid = check_times(times, self.t)
        if self._status.failed:
            return Samples(grid[:0], np.empty((0, self._y.size)), self._status, self._reason)
        t0, n, h = self._t0, self._n, self._h
        if (grid[-1] - self.t) * h < 0.0:  # turn round: steps are counted from here
            t0, n, h = self.t, 0, -h
        between = {"land": fixed.LAND, "dense": fixed.DENSE}.get(sample or "side", fixed.SIDE)
        bases = np.full(grid.size, t0)
        if sample == "land":
            bases[1:] = grid[:-1]
        targets, parts = plan(grid, bases, h)
        if sample == "steps":
            targets = np.arange(n + (grid[0] != self.t), targets[-1] + 1)
            grid, parts = t0 + targets * h, np.zeros(targets.size)
        self._t0, self._n, self._h = t0, n, h
        return self._run(between, grid, targets, parts)

    def checkpoint(self) -> Checkpoint:
        """Return a copy of all that the continuation depends on."""
        return Checkpoint(
            self._t0, self._n, self._h, self._y.copy(), self._e.copy(),
            self._previous.copy(), self._length, self._status, self._reason,
        )  # fmt: skip

    def restore(self, checkpoint: Checkpoint) -> None:
        """Go back to a checkpoint of the same program; the counters keep counting.

        Raises
        ------
        problems.errors.InputError
            If the checkpoint is that of another system or another s.
        """
        if checkpoint.previous.shape != self._previous.shape:
            raise InputError(
                f"this checkpoint has coefficients of shape {checkpoint.previous.shape}, not "
                f"{self._previous.shape}: it belongs to another method or system."
            )
        self._t0, self._n, self._h = checkpoint.t0, checkpoint.n, checkpoint.h
        self._y, self._e = checkpoint.y.copy(), checkpoint.e.copy()
        self._previous, self._length = checkpoint.previous.copy(), checkpoint.length
        self._status, self._reason = checkpoint.status, checkpoint.reason

    def _run(self, between: int, times: Array, targets: Counts, parts: Array) -> Samples:
        """Run the kernel over the samples, in chunks so that Ctrl-C is heard between them."""
        table = self._program.tables
        out = np.empty((times.size, self._y.size))
        code, change, made = fixed.BUDGET, 0.0, 0
        while code == fixed.BUDGET:
            code, change, self._t0, self._n, self._length, made = fixed.advance(
                self._program.field, self._par,
                table.integrals.hi, table.projection.hi, table.nodes.hi,
                self._program.block, self._program.group,
                self._h, self._t0, self._n, self._y, self._e, self._previous, self._length,
                between, times, targets, parts, made, out, CHUNK, self._counters,
            )  # fmt: skip
        status = Status.FINISHED
        if code != fixed.DONE:
            status, self._reason = self._failure(code, change)
            self._status = status
        return Samples(times[:made], out[:made], status, self._reason)

    def _failure(self, code: int, change: float) -> tuple[Status, str]:
        if code == fixed.NOT_FINITE:
            return Status.NOT_FINITE, f"the vector field is not finite in the step from t = {self.t!r}."
        return Status.NONLINEAR_DIVERGENCE, (
            f"the fixed-point iteration did not converge in the step from t = {self.t!r}, h = {self._h!r} "
            f"(relative change {change:.1e} after {fixed.MAX_ITERATIONS} iterations at most); "
            "take a smaller h."
        )


def blocks(system: System) -> tuple[Counts, Counts]:
    """Return the block of each component, and the group (q or p) of each block.

    The change of an iteration is measured relative to the size of a block: the
    coordinates or momenta of one body, where the system says that it has bodies, so
    that a planetoid's tiny momentum is resolved, and else every component by itself.
    """
    dim, dof = system.dim, system.dof
    bodies = getattr(system, "bodies", None)
    width = bodies.dimension if bodies is not None else 1
    block = np.arange(dim) // width
    group = np.zeros(dim // width, dtype=np.int64)
    if dof is not None:
        group[dof // width :] = 1
    return block, group
