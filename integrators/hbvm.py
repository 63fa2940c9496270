"""Hamiltonian Boundary Value Methods, HBVM(k, s), with a fixed step."""

import math
import operator
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from integrators.legendre import tables
from integrators.protocol import (
    SAMPLINGS,
    Array,
    MethodBase,
    Samples,
    Stats,
    Status,
    check_state,
    check_times,
)
from problems.errors import InputError, unknown
from problems.problem import Problem, System

Counts = NDArray[np.int64]

CHUNK = 1 << 14  # steps between two looks at Ctrl-C
COUNTABLE = 2.0**53

CITATION = """\
@book{BrugnanoIavernaro2016,
  author = {Brugnano, Luigi and Iavernaro, Felice},
  title = {Line Integral Methods for Conservative Problems},
  publisher = {Chapman and Hall/CRC},
  year = {2016}
}
"""


@dataclass(frozen=True, kw_only=True)
class HBVM(MethodBase):
    r"""HBVM(k, s): the polynomial of degree s whose line integral of grad H vanishes.

    With the orthonormal shifted Legendre polynomials ``P_j`` and the k-point
    Gauss rule ``(c_l, b_l)`` on [0, 1], one step of length h from ``y_0`` is

        gamma_j = sum_l b_l P_j(c_l) f(t_0 + c_l h, Y_l),             j = 0 .. s-1,
        Y_l     = y_0 + h sum_j gamma_j int_0^{c_l} P_j,              l = 1 .. k,
        y_1     = y_0 + h gamma_0.

    As a Runge-Kutta method: ``A = I P' Omega`` (rank s), weights b, nodes c.

    Properties, each asserted in ``tests/integrators``:

    * order 2s for every k >= s (`test_order`);
    * symmetric and perfectly A-stable: |R(iy)| = 1 (`test_tableau`, `test_hbvm`);
    * k = s is the Gauss-Legendre method, which is symplectic and keeps quadratic
      invariants; with k > s it is neither (`test_energy`);
    * a polynomial Hamiltonian of degree nu is conserved to round-off if and only
      if k >= nu s / 2 (`test_energy`); any other smooth one in practice, once k is
      large enough that the quadrature error is below round-off (`test_sitnikov`).

    Limits: energy is not accuracy. At a step too large for the trajectory the
    energy is still conserved and the trajectory is wrong; other invariants, such
    as the angular momentum, are kept only as far as the order does. Poisson
    systems with a non-constant structure are not conserved.

    Parameters
    ----------
    k : int
        Nodes of the quadrature, k >= s.
    s : int
        Degree of the polynomial, s >= 1; the order is 2s.
    h : float
        Length of a step, > 0; integration backwards takes steps of -h.

    Raises
    ------
    problems.errors.InputError
        For values outside these ranges.

    References
    ----------
    L. Brugnano, F. Iavernaro, D. Trigiante, *Hamiltonian Boundary Value Methods
    (energy preserving discrete line integral methods)*, JNAIAM 5 (2010) 17-37.
    """

    k: int
    s: int
    h: float

    library = "hbvm-bench"
    citation = CITATION
    family = "hbvm"

    def __post_init__(self) -> None:
        for name in ("s", "k"):
            object.__setattr__(self, name, _whole(type(self).__name__, name, getattr(self, name)))
        object.__setattr__(self, "h", _length(type(self).__name__, self.h))
        if self.k < self.s:
            raise InputError(f"HBVM needs k >= s; k={self.k} is less than s={self.s}: raise k or lower s.")

    @property
    def order(self) -> int:
        """Order of convergence, 2s."""
        return 2 * self.s

    def accepts(self, problem: Problem) -> str | None:
        """Accept every system of ordinary differential equations."""
        return None

    def compile(self, system: System) -> "HBVMProgram":
        """Compile the vector field of ``system``, and the kernel if this machine has not yet."""
        return HBVMProgram(system, k=self.k, s=self.s, h=self.h)


class HBVMProgram:
    """HBVM(k, s) with step h, compiled for one system; satisfies `integrators.protocol.Program`."""

    def __init__(self, system: System, *, k: int, s: int, h: float):
        from integrators.kernel import fixed

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
            If ``y0`` is not finite or not of shape (dim,).
        """
        values = self.system.pack({}) if par is None else np.array(par, dtype=np.float64)
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
        from integrators.kernel import fixed

        self._kernel = fixed
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
        kernel = self._kernel
        count = self._counters.tolist()
        return Stats(
            steps=count[kernel.STEPS],
            rejections=0,
            evaluations=count[kernel.EVALUATIONS],
            iterations=count[kernel.ITERATIONS],
            solver="fixed point",
            extra={"partial_steps": count[kernel.PARTIAL], "restarts": count[kernel.RESTARTS]},
        )

    def step(self) -> Status:
        """Take one step of length h; after a failure, do nothing."""
        if not self._status.failed:
            self._run(self._kernel.SIDE, np.zeros(1), np.array([self._n + 1]), np.zeros(1))
        return self._status

    def advance(self, times: ArrayLike, *, sample: str | None = None) -> Samples:
        """Integrate to ``times[-1]``; see the class for the samplings and the protocol for the rest."""
        if sample is not None and sample not in SAMPLINGS:
            raise unknown("sampling", str(sample), SAMPLINGS)
        grid = check_times(times, self.t)
        if self._status.failed:
            return Samples(grid[:0], np.empty((0, self._y.size)), self._status, self._reason)
        kernel = self._kernel
        if (grid[-1] - self.t) * self._h < 0.0:
            self._t0, self._n, self._h = self.t, 0, -self._h
        if sample == "steps":
            last = int(plan(grid[-1:], np.array([self._t0]), self._h)[0][0])
            targets = np.arange(self._n + (grid[0] != self.t), last + 1)
            return self._run(kernel.SIDE, self._t0 + targets * self._h, targets, np.zeros(targets.size))
        bases = np.full(grid.size, self._t0)
        if sample == "land":
            bases[1:] = grid[:-1]
        between = {"land": kernel.LAND, "dense": kernel.DENSE}.get(sample or "side", kernel.SIDE)
        return self._run(between, grid, *plan(grid, bases, self._h))

    def checkpoint(self) -> Checkpoint:
        """Return a copy of all that the continuation depends on."""
        return Checkpoint(
            self._t0, self._n, self._h, self._y.copy(), self._e.copy(),
            self._previous.copy(), self._length, self._status, self._reason,
        )  # fmt: skip

    def restore(self, checkpoint: Checkpoint) -> None:
        """Go back to a checkpoint of the same program; the counters keep counting."""
        self._t0, self._n, self._h = checkpoint.t0, checkpoint.n, checkpoint.h
        self._y, self._e = checkpoint.y.copy(), checkpoint.e.copy()
        self._previous, self._length = checkpoint.previous.copy(), checkpoint.length
        self._status, self._reason = checkpoint.status, checkpoint.reason

    def _run(self, between: int, times: Array, targets: Counts, parts: Array) -> Samples:
        """Run the kernel over the samples, in chunks so that Ctrl-C is heard between them."""
        kernel, table = self._kernel, self._program.tables
        out = np.empty((times.size, self._y.size))
        code, made = kernel.BUDGET, 0
        while code == kernel.BUDGET:
            code, change, self._t0, self._n, self._length, made = kernel.advance(
                self._program.field, self._par,
                table.integrals.hi, table.projection.hi, table.nodes.hi,
                self._program.block, self._program.group,
                self._h, self._t0, self._n, self._y, self._e, self._previous, self._length,
                between, times, targets, parts, made, out, CHUNK, self._counters,
            )  # fmt: skip
        status = Status.FINISHED
        if code != kernel.DONE:
            status, self._reason = self._failure(code, change)
            self._status = status
        return Samples(times[:made], out[:made], status, self._reason)

    def _failure(self, code: int, change: float) -> tuple[Status, str]:
        if code == self._kernel.NOT_FINITE:
            return Status.NOT_FINITE, f"the vector field is not finite in the step from t = {self.t!r}."
        return Status.NONLINEAR_DIVERGENCE, (
            f"the fixed-point iteration did not converge in the step from t = {self.t!r}, h = {self._h!r} "
            f"(relative change {change:.1e} after {self._kernel.MAX_ITERATIONS} iterations at most); "
            "take a smaller h."
        )


def plan(times: Array, bases: Array, h: float) -> tuple[Counts, Array]:
    """Split each distance from a base into whole steps and a part of one.

    Parameters
    ----------
    times, bases : ndarray, shape (m,)
        Times asked for and the times they are counted from.
    h : float
        Length of a step; negative backwards.

    Returns
    -------
    steps : ndarray of int, shape (m,)
        Whole steps that end at or before the time.
    parts : ndarray, shape (m,)
        What is left of ``times - bases - steps * h``, without the rounding of these
        operations; exactly 0 where the time is a step's end but for a few ulp.

    Raises
    ------
    problems.errors.InputError
        If h is so small that the steps cannot be counted.
    """
    count = np.rint((times - bases) / h)
    if count.size and count.max() > COUNTABLE:
        raise InputError(f"h={abs(h)!r} would need {count.max():.1e} steps; take a larger h.")
    parts = _rest(times, bases, count, h)
    close = np.abs(parts) <= 4.0 * np.spacing(np.maximum(np.abs(times), np.abs(bases)))
    count = np.where(~close & (parts * h < 0.0), count - 1.0, count)
    parts = np.where(close, 0.0, _rest(times, bases, count, h))
    return count.astype(np.int64), parts


def _rest(times: Array, bases: Array, count: Array, h: float) -> Array:
    """Return times - bases - count * h, rounded once (Dekker's sum and product)."""
    gap = times - bases
    back = gap - times
    gap_error = (times - (gap - back)) - (bases + back)
    product = count * h
    split = 134217729.0  # 2^27 + 1
    high = split * count - (split * count - count)
    top = split * h - (split * h - h)
    low, bottom = count - high, h - top
    product_error = ((high * top - product) + high * bottom + low * top) + low * bottom
    return ((gap - product) - product_error) + gap_error


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


def _whole(method: str, name: str, value: Any) -> int:
    """Return an option as an int >= 1, or refuse it."""
    try:
        number = 0 if isinstance(value, bool) else operator.index(value)
    except TypeError:
        number = 0
    if number < 1:
        raise InputError(f"{method} needs a whole number {name} >= 1, not {name}={value!r}.")
    return number


def _length(method: str, h: Any) -> float:
    """Return the step as a float > 0, or refuse it."""
    try:
        length = math.nan if isinstance(h, (bool, str)) else float(h)
    except (TypeError, ValueError):
        length = math.nan
    if not (length > 0.0 and math.isfinite(length)):
        raise InputError(
            f"{method} needs a finite step h > 0, not h={h!r}; the sign of time is that of the times."
        )
    return length
