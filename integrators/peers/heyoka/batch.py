"""Many trajectories by heyoka's batch integrator: one trajectory in each lane of the vector unit."""

from collections.abc import Callable
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from integrators.peers import load
from integrators.protocol import Array, Status, Trajectories
from integrators.refusals import check_batch, check_times
from integrators.running.times import Counts
from integrators.running.watchdog import STALL_STEPS, StallDetector
from problems.systems.base import System


class Lanes:
    """heyoka's batch integrator, compiled for one system and as many lanes as it recommends here.

    Parameters
    ----------
    system : System
        What moves.
    equations : list
        heyoka's pairs of variable and right-hand side.
    options : dict
        Those of `integrators.peers.heyoka.taylor.Taylor`.
    """

    def __init__(self, system: System, equations: list[Any], options: dict[str, Any]):
        hy = load("heyoka")
        self.system = system
        self.size = int(hy.recommended_simd_size())
        started = perf_counter()
        self._ta = hy.taylor_adaptive_batch(
            equations,
            np.zeros((system.dim, self.size)),
            **options,
        )
        self.compile_seconds = perf_counter() - started

    def prepare(
        self, starts: ArrayLike, par: ArrayLike | None, times: ArrayLike, t0: float
    ) -> Callable[[], Trajectories]:
        """Check and allocate; return what integrates every start to all times.

        See `integrators.peers.heyoka.taylor.TaylorProgram.prepare_batch`.
        """
        grid = check_times(times, t0)
        given, parameters = check_batch(starts, par, grid, self.system)
        n = len(given)
        result = Trajectories(
            t=grid,
            y=np.full((n, grid.size, self.system.dim), np.nan),
            status=[Status.FINISHED] * n,
            reason=[""] * n,
            t_stop=np.full(n, grid[-1]),
            steps=np.zeros(n, dtype=np.int64),
        )
        # A last group that is not full repeats the last trajectory in its spare lanes, which are not read.
        members = np.minimum(np.arange(-(-n // self.size) * self.size), n - 1).reshape(-1, self.size)
        states, values = (
            np.ascontiguousarray(rows[members].transpose(0, 2, 1)) for rows in (given, parameters)
        )
        return partial(self._run, result, states, values, t0)

    def _run(self, result: Trajectories, states: Array, values: Array, t0: float) -> Trajectories:
        """Integrate group by group; states and values have the shape (groups, components, lanes).

        Between heyoka's calls is only what cannot wait: a group of a small system takes 0.1 ms.
        """
        ta, size, n, y = self._ta, self.size, len(result.status), result.y
        now, state, par = ta.time, ta.state, ta.pars  # heyoka's own memory
        ends = [(place, t, [t] * size) for place, t in enumerate(result.t.tolist())]
        ended: list[tuple[int, Any]] = []
        for first, begin in zip(range(0, n, size), states, strict=True):
            ta.set_time(t0)
            state[:] = begin
            if len(par):
                par[:] = values[first // size][: len(par)]
            for place, t, all_there in ends:
                if t != t0:
                    ta.propagate_until(all_there, max_steps=STALL_STEPS)
                    if now.tolist() != all_there:
                        self._one_by_one(result, np.arange(first, min(first + size, n)), place, t0)
                        break
                    ended.append((first, ta.propagate_res))
                y[first : first + size, place] = state.T[: n - first]
        for first, lanes in ended:
            result.steps[first : first + size] += [outcome[3] for outcome in lanes][: n - first]
        broken = np.logical_not(np.isfinite(y).all(axis=2))
        for i in np.flatnonzero(broken.any(axis=1)).tolist():
            if result.status[i] is Status.FINISHED:  # so in the very step that came to the time
                place = int(np.argmax(broken[i]))
                t, y[i, place:] = float(result.t[place]), np.nan
                result.status[i], result.t_stop[i] = Status.NOT_FINITE, t
                result.reason[i] = f"the state is not finite at t = {t:.6g}"
        return result

    def _one_by_one(self, result: Trajectories, members: Counts, place: int, t0: float) -> None:
        """Integrate on a group of which some lanes did not reach the time at ``place``, lane by lane."""
        going = set(range(len(members)))
        before = np.full(self.size, result.t[place - 1] if place else t0)
        for number, time in enumerate(result.t[place:].tolist(), place):
            if number > place:
                before = self._propagate(time)
            self._towards(result, members, going, time, before)
            for lane in going:
                result.y[members[lane], number] = self._ta.state[:, lane]
            if not going:
                return

    def _propagate(self, time: float) -> Array:
        """Propagate all lanes towards a time; return the times from which they went."""
        before = self._ta.time.copy()
        self._ta.propagate_until(np.full(self.size, time), max_steps=STALL_STEPS)
        return before

    def _towards(
        self, result: Trajectories, members: Counts, going: set[int], time: float, before: Array
    ) -> None:
        """Bring the lanes that are going to a time, after a first propagation from ``before``.

        A lane that fails leaves ``going``, and its status and reason are noted. heyoka ends a propagation
        as soon as one lane is not finite, wherever the others are then, so these are propagated again.
        """
        ta = self._ta
        watches = {lane: StallDetector(float(before[lane]), time) for lane in going}
        ahead = set(going)
        while True:
            for lane in sorted(ahead):
                i, t, steps = members[lane], float(ta.time[lane]), ta.propagate_res[lane][3]
                result.steps[i] += steps
                if not (np.isfinite(t) and np.isfinite(ta.state[:, lane]).all()):
                    t = t if np.isfinite(t) else float(before[lane])
                    status, reason = Status.NOT_FINITE, f"the state is not finite after t = {t:.6g}"
                elif t == time:
                    ahead.discard(lane)
                    continue
                elif reason := watches[lane].update(t, steps):
                    status = Status.STALLED
                else:
                    continue
                result.status[i], result.t_stop[i], result.reason[i] = status, t, reason
                going.discard(lane)
            ahead &= going
            self._idle(going)
            if not ahead:
                return
            before = self._propagate(time)

    def _idle(self, going: set[int]) -> None:
        """Set the lanes that have ended to the state of one that goes on, so that they do not stop it."""
        ta = self._ta
        idle = [lane for lane in range(self.size) if lane not in going]
        if not (idle and going):
            return
        twin = min(going)
        high, low = (part.copy() for part in ta.dtime)
        for values in (high, low, ta.state.T, ta.pars.T):
            values[idle] = values[twin]
        ta.set_dtime(high, low)
