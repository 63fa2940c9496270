"""Gauss with fixed steps in double-double arithmetic: a program, and its trajectories."""

from contextlib import suppress
from time import perf_counter
from typing import Any

import numpy as np
from numba import NumbaError, njit
from numpy.typing import ArrayLike

from integrators.extended.arithmetic import FUNCTIONS, Numbers, minus, plus, product, times
from integrators.extended.step import SOLVED, field_of, solver, tables, weighted
from integrators.protocol import Array, MethodBase, Samples, Status
from integrators.refusals import check_parameters, check_start, one_thread
from integrators.running.times import COUNTABLE
from integrators.stepping import ProgramBase, RestorableStepper
from problems.errors import InputError
from problems.graph.functions import CALLED
from problems.graph.nodes import reachable
from problems.problem import System

AT_ONCE = 32  # steps between two looks at Ctrl-C
UNSOLVED, UNDEFINED = 1, 2  # what ended a march


def lacking(system: System) -> str | None:
    """Return what of a field double-double arithmetic does not have, such as ``m.erf``, or ``None``."""
    known = {function.__name__ for function in FUNCTIONS}
    for node in reachable(system.function("field").roots):
        called = CALLED.get(node.op)
        if node.op == "table" or (called and called.numba.partition("(")[0] not in known):
            return f"m.{node.op}"
    return None


class DoubleDoubleProgram(ProgramBase):
    """Gauss(s, h) in double-double arithmetic, compiled for one system.

    Raises
    ------
    problems.errors.InputError
        If the field cannot be compiled for it.
    """

    def __init__(self, system: System, method: MethodBase, *, s: int, h: float):
        super().__init__(system, method)
        began = perf_counter()
        key, field = field_of(system)
        self.from_cache = key in _marches
        self.s, self.h, self.tables = s, h, tables(s)
        self.march = _marches[key] if self.from_cache else _march(field)
        y = np.zeros(system.dim, np.complex128)
        try:  # no step at all: numba compiles at the first call
            self.march(0j, 0, 0, complex(h), y, system.pack().astype(complex), *self.tables, _counts())
        except NumbaError:
            raise InputError(
                f"the field of {system.name} cannot be had in double-double; leave out precision=."
            ) from None
        _marches[key] = self.march
        self.compile_seconds = perf_counter() - began

    def stepper(self, y: Array, par: Array, t: float) -> "DoubleDoubleStepper":
        """Return a trajectory from a start in doubles."""
        return DoubleDoubleStepper(self, y.astype(complex), par, t)

    def start_pairs(
        self, pairs: Array, par: ArrayLike | None = None, t0: float = 0.0
    ) -> "DoubleDoubleStepper":
        """Return a trajectory from a start in pairs, (dim, 2); see `integrators.protocol.DoubleDouble`."""
        values = check_parameters(par, self.system)
        stepper = DoubleDoubleStepper(self, pairs[:, 0] + 1j * pairs[:, 1], values, check_start(t0))
        stepper.started = self, values
        return stepper


_marches: dict[str, Any] = {}


def _march(field: Any) -> Any:
    solve = solver(field)

    @njit
    def march(t, first, n, step, y, par, nodes, weights, matrix, counts):
        """Take the steps ``first`` ... ``first + n - 1`` of those from a time; return what ended them, or 0.

        ``counts`` are the steps taken and the iterations; they and ``y`` are right where the field raises.
        """
        s, dim = len(nodes), len(y)
        slope = np.zeros((s, dim), np.complex128)
        new = np.zeros((s, dim), np.complex128)
        after = np.zeros(dim, np.complex128)
        for i in range(n):
            here = plus(t, times(complex(float(first + i)), step))
            count, change = solve(here, y, par, step, nodes, matrix, slope, new)
            counts[1] += count
            if not change < SOLVED:
                return UNSOLVED if change < np.inf else UNDEFINED
            for d in range(dim):
                after[d] = plus(y[d], times(weighted(weights, slope[:, d]), step))
                if not np.isfinite(after[d].real):
                    return UNDEFINED
            y[:] = after
            counts[0] += 1
        return 0

    return march


def _counts() -> Any:
    return np.zeros(2, np.int64)


class DoubleDoubleStepper(RestorableStepper):
    """A trajectory whose states have twice the digits of a double.

    The steps end at t0 + n h exactly, and a partial step leads to every other time, also to one that is
    the end of a step but for rounding. With ``"stop"`` the steps count from such a time on.

    Attributes
    ----------
    low : ndarray, shape (m, dim), or None
        What the samples of the last ``advance``, doubles, leave out.
    """

    samplings = ("partial", "stop")

    def __init__(self, program: DoubleDoubleProgram, y: Numbers, par: Array, t: float):
        super().__init__(y.real.copy(), t)
        self._program, self._par = program, par.astype(complex)
        self._base, self._n, self._h, self._here = complex(t), 0, program.h, y.copy()
        self._present = complex(t), y.copy()  # time and state, as numbers
        self.low: Array | None = None
        self._served: list[Numbers] = []
        self._stats.evaluations = self._stats.iterations = 0
        self._stats.solver = "fixed point"

    @one_thread
    def advance(self, times: ArrayLike, *, sample: str | None = None) -> Samples:
        """Integrate to ``times[-1]``; see the class for the samplings and the protocol for the rest."""
        _, present = self._present
        self._served = []
        samples = super().advance(times, sample=sample)
        rows = self._served
        if rows and not self._status.failed:
            self._present = complex(float(samples.t[-1])), rows[-1]
        if samples.t.size > len(rows):  # the first of the times is the present
            rows = [present, *rows]
        self.low = np.array([row.imag for row in rows]).reshape(samples.y.shape)
        return samples

    @property
    @one_thread
    def pairs(self) -> Array:
        """The state at exactly the present time ``t``, in pairs, shape (dim, 2).

        A step may end at a time that is no double, a rounding error away.
        """
        t, y = self._present
        if t.imag:
            y, program = y.copy(), self._program
            with suppress(
                ArithmeticError, ValueError
            ):  # the field is not defined here, and ends the next step
                program.march(t, 0, 1, complex(-t.imag), y, self._par, *program.tables, _counts())
        return np.stack([y.real, y.imag], axis=1)

    def _time(self, n: int) -> complex:
        return plus(self._base, product(float(n), self._h))

    def _towards(self, end: float) -> None:
        """Turn round where ``end`` lies on the other side of the present: steps count from here then."""
        t, y = self._present
        if minus(complex(end), t).real * self._h < 0.0:
            self._base, self._n, self._h, self._here = t, 0, -self._h, y.copy()

    def _serve(self, grid: Array, how: str) -> tuple[Array, Array]:
        self._towards(float(grid[-1]))
        for t in grid.tolist():
            n, part = self._split(t)
            if not self._go(n):
                break
            state = self._here
            if part != 0.0:
                state = self._here.copy()
                if not self._take(self._time(self._n), 0, 1, part, state):
                    break
                if how == "stop":
                    self._stats.steps += 1
                    self._base, self._n, self._here = complex(t), 0, state
            self._served.append(state.copy())
        states = np.array([row.real for row in self._served]).reshape(-1, self._y.size)
        return grid[: len(states)], states

    def _split(self, t: float) -> tuple[int, complex]:
        """Return how many steps from the base end before a time or at it, and what is left, exactly."""
        distance = minus(complex(t), self._base)
        n = float(np.rint(distance.real / self._h))
        if n > COUNTABLE:
            raise InputError(f"h={abs(self._h)!r} would need {n:.1e} steps; take a larger h.")
        part = minus(distance, product(n, self._h))
        if part.real * self._h < 0.0:
            n, part = n - 1.0, plus(part, self._h)
        return int(n), part

    def _go(self, n: int) -> bool:
        """March to the step with number ``n``; return whether it is reached."""
        while self._n < n:
            count = min(n - self._n, AT_ONCE)
            before = self._stats.steps
            arrived = self._take(self._base, self._n, count, complex(self._h), self._here, own=True)
            self._n += self._stats.steps - before
            if not arrived:
                return False
        return True

    def _take(self, t: complex, first: int, n: int, step: complex, y: Numbers, *, own: bool = False) -> bool:
        """Take steps, of which ``own`` ones count; return whether all of them are taken."""
        counts = _counts()
        try:
            ended = self._program.march(t, first, n, step, y, self._par, *self._program.tables, counts)
        except ArithmeticError:  # a division by zero
            ended = UNDEFINED
        except ValueError:  # the root of a number below zero
            ended = UNDEFINED
        taken, iterations = counts.tolist()
        steps, s = taken + (ended != 0), self._program.s
        self._stats.iterations = (self._stats.iterations or 0) + iterations
        self._stats.evaluations = (self._stats.evaluations or 0) + steps + s * iterations
        self._stats.steps += taken if own else 0
        if not ended:
            return True
        self._present = plus(t, times(complex(float(first + taken)), step)), y.copy()
        here, size = self._present[0].real, abs(self._h)
        if ended == UNSOLVED:
            self._fail(
                Status.NONLINEAR_DIVERGENCE, here, y.real,
                f"the fixed-point iteration does not converge at t = {here!r}; take a step below {size!r}.",
            )  # fmt: skip
        else:
            self._fail(
                Status.NOT_FINITE, here, y.real,
                f"the stages of the step from t = {here!r} are not finite; take a step below {size!r}.",
            )  # fmt: skip
        return False

    def _one_step(self) -> tuple[float, Array] | None:
        if not self._go(self._n + 1):
            return None
        t = self._time(self._n)
        self._present = t, self._here.copy()
        return t.real, self._here.real.copy()

    def _save(self) -> Any:
        t, y = self._present
        return self._base, self._n, self._h, self._here.copy(), t, y.copy()

    def _load(self, inner: Any) -> None:
        self._base, self._n, self._h, here, t, y = inner
        self._here, self._present = here.copy(), (t, y.copy())
