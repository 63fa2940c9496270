"""The Stoermer-Verlet method, written as a guest of hbvm-bench.

p_{n+1/2} = p_n + h/2 F(q_n),  q_{n+1} = q_n + h c p_{n+1/2},  p_{n+1} = p_{n+1/2} + h/2 F(q_{n+1})
"""

import math
from dataclasses import dataclass
from time import perf_counter

import numba
import numpy as np

from integrators.checkpoints import Identity
from integrators.protocol import MethodBase, Samples, Stats, Status, check_state, check_times
from problems import InputError, emit


@numba.njit(error_model="numpy")
def _steps(force, scale, par, t0, h, n, y, count, slope):
    """Take count steps from the time t0 + n h; y is changed in place."""
    dof = len(scale)
    force(t0 + n * h, y[:dof], par, slope)
    for k in range(count):
        for i in range(dof):
            y[dof + i] += 0.5 * h * slope[i]
            y[i] += h * (scale[i] * y[dof + i])
        force(t0 + (n + k + 1) * h, y[:dof], par, slope)
        for i in range(dof):
            y[dof + i] += 0.5 * h * slope[i]


@dataclass(frozen=True, kw_only=True, repr=False)
class Verlet(MethodBase):
    """The Stoermer-Verlet method with a fixed step, order 2, symplectic.

    Parameters
    ----------
    h : float
        Length of the step, positive.
    """

    h: float

    library = "hbvm-bench-duffing"
    family = "Verlet"
    citation = "L. Verlet, Physical Review 159 (1967) 98-103"

    def __post_init__(self) -> None:
        if isinstance(self.h, bool) or not isinstance(self.h, int | float) or not 0 < self.h < math.inf:
            raise InputError(f"h={self.h!r} of Verlet must be a positive number.")

    @property
    def order(self) -> int:
        return 2

    def accepts(self, problem):
        """Accept separable Hamiltonians."""
        if problem.system.separable:
            return None
        return "it needs a separable Hamiltonian, H = sum of c p^2/2 + V(q, t)."

    def compile(self, system):
        return _Program(self, system)


class _Program:
    from_cache = None

    def __init__(self, method, system):
        started = perf_counter()
        self.method, self.system = method, system
        self.force = emit.numba(system, "force")
        self.scale = emit.numpy(system, "velocity_scale")
        zero = np.zeros(system.dim)
        par = system.pack()
        scale = np.ones(system.dof)
        _steps(self.force, scale, par, 0.0, 0.0, 0, zero, 0, np.zeros(system.dof))
        self.compile_seconds = perf_counter() - started

    def start(self, y0, par=None, t0=0.0):
        par = self.system.pack() if par is None else np.array(par, dtype=float)
        return _Stepper(self, check_state(y0, self.system.dim), par, float(t0))


@dataclass(frozen=True, eq=False)
class Checkpoint:
    identity: Identity
    n: int
    y: np.ndarray


class _Stepper:
    def __init__(self, program, y, par, t0):
        self._program, self._par, self._t0, self._y = program, par, t0, y
        self._scale = program.scale(0.0, y, par)
        self._slope = np.empty(program.system.dof)
        self._n, self._h = 0, program.method.h
        self._identity = Identity.of(repr(program.method), program.system, par)
        self.status, self.reason = Status.RUNNING, ""

    @property
    def t(self):
        return self._t0 + self._n * self._h

    @property
    def y(self):
        return self._y.copy()

    @property
    def stats(self):
        return Stats(steps=abs(self._n), evaluations=abs(self._n) + 1)

    def _advanced(self, y, n, h, count):
        y = y.copy()
        t0 = self._t0 if h == self._h else self.t
        at = n if h == self._h else 0
        _steps(self._program.force, self._scale, self._par, t0, h, at, y, count, self._slope)
        return y

    def step(self):
        self._y = self._advanced(self._y, self._n, self._h, 1)
        self._n += 1
        return self.status

    def advance(self, times, *, sample=None):
        if sample not in (None, "side"):
            raise InputError(f"Verlet makes states between steps beside them only, not sample={sample!r}.")
        grid = check_times(times, self.t)
        if grid[-1] < self.t:
            raise InputError("Verlet of this example integrates forward only.")
        states = np.empty((len(grid), len(self._y)))
        for i, time in enumerate(grid):
            whole = math.floor((time - self._t0) / self._h * (1 + 1e-15)) - self._n
            if whole > 0:
                self._y = self._advanced(self._y, self._n, self._h, whole)
                self._n += whole
            rest = time - self.t
            if not np.isfinite(self._y).all():
                self.status, self.reason = Status.NOT_FINITE, f"the state overflowed before t = {time!r}."
                return Samples(grid[:i], states[:i], self.status, self.reason)
            # A throw-away step onto the time: the sequence of steps is untouched.
            states[i] = self._y if abs(rest) <= 1e-12 * self._h else self._advanced(self._y, 0, rest, 1)
        return Samples(grid, states, Status.FINISHED)

    def checkpoint(self):
        return Checkpoint(self._identity, self._n, self._y.copy())

    def restore(self, checkpoint):
        self._identity.check(checkpoint, Checkpoint)  # of another method, system or parameters: refused
        self._n, self._y = checkpoint.n, checkpoint.y.copy()
        self.status, self.reason = Status.RUNNING, ""
