"""Programs and trajectories of diffrax's solvers."""

import math
from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from integrators.peers import load
from integrators.protocol import Array, MethodBase, Status, Trajectories
from integrators.refusals import check_batch, check_times
from integrators.running.watchdog import STALL_STEPS, StallDetector, stall_detector
from integrators.stepping import FixedStepper, ProgramBase, RestorableStepper, StepperBase
from problems.problem import System


class DiffraxProgram(ProgramBase):
    """A solve that JAX has compiled ahead of time, for any start, parameters, step and tolerances.

    Compiled code is kept while the process lives; ``from_cache`` says whether it was there.
    The method is one of `integrators.peers.diffrax.methods`, named as diffrax's solver.
    """

    def __init__(self, system: System, method: MethodBase):
        super().__init__(system, method)
        load("diffrax", "diffrax", "jax")
        from integrators.peers.diffrax import solve

        self.solve, self.adaptive = solve, self.method.h is None
        compiled, self.from_cache = self.solve_for(1)
        self.compile_seconds = 0.0 if self.from_cache else compiled.seconds

    def solve_for(self, sign: int) -> tuple[Any, bool]:
        """Return the compiled solve for a direction of time, and whether it was there already."""
        return self.solve.solve_for(self.system, type(self.method).__name__, sign, self.adaptive)

    def stepper(self, y: Array, par: Array, t: float) -> StepperBase:
        """Return a trajectory."""
        return (AdaptiveStepper if self.adaptive else DiffraxStepper)(self, y, par, t)

    def batch(
        self, Y0: ArrayLike, par: ArrayLike | None = None, *, times: ArrayLike, t0: float = 0.0
    ) -> Trajectories:
        """Integrate many initial conditions to the same times under ``jax.vmap``; see `prepare_batch`."""
        return self.prepare_batch(Y0, par, times=times, t0=t0)()

    def prepare_batch(
        self, Y0: ArrayLike, par: ArrayLike | None = None, *, times: ArrayLike, t0: float = 0.0
    ) -> Callable[[], Trajectories]:
        """Compile ``jax.jit(jax.vmap(solve))`` for so many trajectories; return what integrates them, once.

        Each has step sizes of its own, and all wait for the one with the most steps. Every time is the end of
        a plain ``diffeqsolve``, after which the next one begins.
        """
        grid = check_times(times, t0)
        starts, parameters = check_batch(Y0, par, grid, self.system)
        sign = 1 if grid[-1] > t0 else -1
        many = self.solve_for(sign)[0].many
        method = self.method

        def solved(t: float, end: float, y: Array) -> tuple[Array, Array]:
            span = np.float64(sign * t), np.float64(sign * end)
            if self.adaptive:
                y, counts = many(*span, y, parameters, np.float64(method.rtol), np.float64(method.atol))
            else:
                y, counts = many(*span, np.float64(method.h), y, parameters)
            return np.asarray(y), np.asarray(counts)

        begun = perf_counter()
        solved(t0, t0, starts)
        self.compile_seconds += perf_counter() - begun
        return lambda: self._batch(solved, starts, grid, t0)

    def _batch(self, solved: Callable[..., Any], y: Array, grid: Array, t0: float) -> Trajectories:
        n, t = len(y), t0
        states, steps = np.empty((n, grid.size, y.shape[1])), np.zeros(n, dtype=np.int64)
        status, reason, stopped = [Status.FINISHED] * n, [""] * n, np.full(n, grid[-1])
        for place, end in enumerate(grid.tolist()):
            y, counts = solved(t, end, y)
            y = np.where(counts[:, 2:] > 0, y, np.nan)
            steps += np.where(np.isfinite(y[:, 0]), counts[:, 0], 0)
            for i in np.flatnonzero(~np.isfinite(y).all(axis=1)).tolist():
                if status[i] is Status.FINISHED:
                    status[i], stopped[i] = Status.NOT_FINITE, t
                    reason[i] = f"diffrax did not get from t = {t!r} to {end!r}."
            states[:, place], t = y, end
        return Trajectories(t=grid, y=states, status=status, reason=reason, t_stop=stopped, steps=steps)


class _Direction:
    """The compiled solve for one direction of time; what it cost to compile is noted with the statistics."""

    def __init__(self, stepper: StepperBase, program: DiffraxProgram, sign: int):
        self.sign = sign
        self._of = stepper, program
        self.solve, known = program.solve_for(sign)
        if not known:
            extra = stepper.stats.extra
            extra["compile_seconds"] = extra.get("compile_seconds", 0.0) + self.solve.seconds

    def towards(self, sign: int) -> "_Direction":
        """Return the compiled solve for the direction ``sign``."""
        return self if sign == self.sign else _Direction(*self._of, sign)

    def plain(self, t: float, end: float, *rest: Any) -> tuple[Array, list[int]]:
        """Solve plainly; see `integrators.peers.diffrax.solve.Solve.plain`."""
        y, counts = self.solve.plain.call(np.float64(self.sign * t), np.float64(self.sign * end), *rest)
        return np.asarray(y), np.asarray(counts).tolist()


class DiffraxStepper(FixedStepper):
    """A trajectory with fixed steps; see `integrators.stepping.FixedStepper` for the sampling.

    ``"end"`` is a plain ``diffeqsolve`` to each time, which begins anew there.
    """

    samplings = (*FixedStepper.samplings, "end")
    at_once = 1 << 18  # so many that the 0.1 ms of a call into JAX is nothing

    def __init__(self, program: DiffraxProgram, y: Array, par: Array, t: float):
        super().__init__(program, y, par, t)
        self._restart(t, y, self._h)

    def _restart(self, t: float, y: Array, h: float) -> None:
        self._way = _Direction(self, self._program, 1 if h > 0.0 else -1)
        self._states, self._inner = y, None

    def _serve(self, grid: Array, how: str) -> tuple[Array, Array]:
        if how != "end":
            return super()._serve(grid, how)
        self._towards(float(grid[-1]))
        way, states = self._way, np.empty((grid.size, self._y.size))
        t, y = self._t, self._y
        for i, end in enumerate(grid.tolist()):
            state, (accepted, _, arrived) = way.plain(t, end, np.float64(abs(self._h)), y, self._par)
            t, y = end, state if arrived else np.full(y.size, np.nan)
            states[i] = y
            self._stats.steps += accepted
            self._evaluated(accepted)
            self._t0, self._n, self._states, self._inner = t, 0, y, None
            if not math.isfinite(y.sum()):
                return grid[: i + 1], states[: i + 1]
        return grid, states

    def _solve(self, base: float, h: float, n0: int, n1: int) -> tuple[Array, Any]:
        sign = self._way.sign
        if self._inner is None:
            self._inner = self._way.solve.begin.call(np.float64(sign * base), self._states, self._par)
        y, inner = self._way.solve.run.call(
            np.float64(sign * base),
            np.float64(sign * h),
            np.int64(n0),
            np.int64(n1),
            self._states,
            self._inner,
            self._par,
        )
        return np.asarray(y), inner

    def _march(self, count: int) -> None:
        self._states, self._inner = self._solve(self._t0, self._h, self._n, self._n + count)
        self._evaluated(count)

    def _state(self) -> Array:
        return self._states.copy()

    def _aside(self, part: float) -> Array:
        return self._solve(self._time(), part, 0, 1)[0]

    def _shorten(self, part: float) -> None:
        self._states, self._inner = self._solve(self._time(), part, 0, 1)
        self._evaluated(1)

    def _save_steps(self) -> Any:
        # JAX's arrays are immutable.
        return self._way.sign, self._states, self._inner

    def _load_steps(self, steps: Any) -> None:
        sign, self._states, self._inner = steps
        self._way = self._way.towards(sign)


class AdaptiveStepper(RestorableStepper):
    """A trajectory with steps chosen by diffrax: ``"stop"`` (default), ``"steps"`` or ``"end"``.

    ``"stop"`` goes on, after a time, with the step it would have taken; ``"end"`` is a plain
    ``diffeqsolve`` to each time, which begins anew there.
    """

    samplings = ("stop", "steps", "end")

    def __init__(self, program: DiffraxProgram, y: Array, par: Array, t: float):
        super().__init__(y, t)
        self._program, self._par = program, par
        self._tolerances = np.float64(program.method.rtol), np.float64(program.method.atol)
        self._stats.rejections = 0
        self._stats.evaluations = None if program.method.evaluations is None else 0
        self._begin(1)

    def _begin(self, sign: int) -> None:
        self._way, self._inner = _Direction(self, self._program, sign), None

    def _towards(self, end: float) -> None:
        sign = 1 if end > self._t else -1
        if sign != self._way.sign:
            self._begin(sign)

    def _advance(self, t: float, y: Array, end: float, limit: int) -> tuple[float, Array, int]:
        """Solve from ``t`` to ``end`` in at most ``limit`` steps; return where it came and how it ended."""
        sign = self._way.sign
        if self._inner is None:
            self._inner = self._way.solve.begin.call(np.float64(sign * t), y, self._par, *self._tolerances)
        state, control, dt = self._inner
        y, reached, state, control, dt, accepted, rejected, code = self._way.solve.run.call(
            np.float64(sign * t),
            np.float64(sign * end),
            dt,
            y,
            state,
            control,
            np.int64(limit),
            self._par,
            *self._tolerances,
        )
        self._inner = state, control, dt
        self._count(int(accepted), int(rejected))
        reached, code, solve = sign * float(reached), int(code), self._program.solve
        if code == solve.DT_MIN:
            self._fail(
                Status.STEP_UNDERFLOW,
                reached,
                np.asarray(y),
                f"diffrax's step fell below {solve.ULPS:g} ulp at t = {reached!r}.",
            )
        elif code == solve.OTHER:
            self._fail(
                Status.NOT_FINITE,
                reached,
                np.asarray(y),
                f"diffrax ended without success at t = {reached!r}.",
            )
        return reached, np.asarray(y), code

    def _count(self, accepted: int, rejected: int) -> None:
        stats = self._stats
        stats.steps += accepted
        stats.rejections = (stats.rejections or 0) + rejected
        if (each := self._program.method.evaluations) is not None:
            stats.evaluations = (stats.evaluations or 0) + (accepted + rejected) * each

    def _ends(self, grid: Array) -> tuple[Array, Array]:
        states, t, y = np.empty((grid.size, self._y.size)), self._t, self._y
        for i, end in enumerate(grid.tolist()):
            self._inner = None
            state, (accepted, rejected, arrived) = self._way.plain(t, end, y, self._par, *self._tolerances)
            if not arrived:  # why not is found out under a watch
                _, y = self._watched(t, y, end, stall_detector(self, t, end))
                if self._status.failed:
                    return grid[:i], states[:i]
                state, accepted, rejected, self._inner = y, 0, 0, None
            self._count(accepted, rejected)
            t, y = end, state
            states[i] = y
        return grid, states

    def _serve(self, grid: Array, how: str) -> tuple[Array, Array]:
        self._towards(float(grid[-1]))
        if how == "end":
            return self._ends(grid)
        states, t, y = np.empty((grid.size, self._y.size)), self._t, self._y
        watch = stall_detector(self, t, float(grid[-1]))
        for i, end in enumerate(grid.tolist()):
            t, y = self._watched(t, y, end, watch)
            if self._status.failed:
                return grid[:i], states[:i]
            states[i] = y
        return grid, states

    def _watched(self, t: float, y: Array, end: float, watch: StallDetector) -> tuple[float, Array]:
        """Solve from ``t`` to ``end``, a limited number of steps at a time; note a failure."""
        code = self._program.solve.LIMIT
        while code == self._program.solve.LIMIT and t != end:
            t, y, code = self._advance(t, y, end, STALL_STEPS)
            if code == self._program.solve.LIMIT and (stalled := watch.update(t, STALL_STEPS)):
                self._fail(Status.STALLED, t, y, stalled)
            if self._status.failed:
                return t, y
        return end, y

    def _step_states(self, end: float) -> tuple[Array, Array]:
        self._towards(end)
        times, states = [self._t], [self._y]
        while times[-1] != end:
            t, y, _ = self._advance(times[-1], states[-1], end, 1)
            if self._status.failed:
                break
            times.append(t)
            states.append(y)
        return np.array(times[1:]), np.array(states).reshape(-1, self._y.size)[1:]

    def _one_step(self) -> tuple[float, Array] | None:
        t, y, _ = self._advance(self._t, self._y, math.copysign(math.inf, self._way.sign), 1)
        return None if self._status.failed else (t, y)

    def _save(self) -> Any:
        # JAX's arrays are immutable.
        return self._way.sign, self._inner

    def _load(self, inner: Any) -> None:
        sign, self._inner = inner
        self._way = self._way.towards(sign)
