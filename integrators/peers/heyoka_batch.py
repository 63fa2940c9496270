"""Many trajectories by heyoka's batch integrator: one trajectory in each lane of the vector unit."""

from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from integrators.crawl import CRAWL_STEPS, Crawl
from integrators.peers.options import load
from integrators.protocol import Array, Status, check_batch, check_times
from integrators.trajectories import Counts, Trajectories
from problems import emit
from problems.system import System


class Lanes:
    """heyoka's batch integrator, compiled for one system and as many lanes as it recommends here.

    Parameters
    ----------
    system : System
        What moves.
    options : dict
        Those of `integrators.peers.heyoka.Taylor`.
    """

    def __init__(self, system: System, options: dict[str, Any]):
        hy = load("heyoka")
        self.system = system
        self.size = int(hy.recommended_simd_size())
        started = perf_counter()
        self._ta = hy.taylor_adaptive_batch(
            emit.heyoka(system),
            np.zeros((system.dim, self.size)),
            pars=np.tile(system.pack({})[:, None], (1, self.size)),
            **options,
        )
        self.compile_seconds = perf_counter() - started

    def run(self, starts: ArrayLike, par: ArrayLike | None, times: ArrayLike, t0: float) -> Trajectories:
        """Integrate every start to all times; see `integrators.peers.heyoka.TaylorProgram.batch`."""
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
        for first in range(0, n, self.size):
            # the last lanes begin as a trajectory that is there; what they do is not looked at
            members = np.minimum(np.arange(first, first + self.size), n - 1)
            self._group(result, members[: min(self.size, n - first)], given[members], parameters[members], t0)
        return result

    def _group(self, result: Trajectories, members: Counts, starts: Array, par: Array, t0: float) -> None:
        ta, lanes = self._ta, range(len(members))
        ta.set_time(t0)
        ta.state[:] = starts.T
        if par.shape[1]:
            ta.pars[:] = par.T
        going = set(lanes)
        for place, time in enumerate(result.t.tolist()):
            if time != t0:
                self._towards(result, members, going, time)
            for lane in going:
                result.y[members[lane], place] = ta.state[:, lane]
            if not going:
                return

    def _towards(self, result: Trajectories, members: Counts, going: set[int], time: float) -> None:
        """Bring the lanes that are going to a time; those that fail go no more, and say why.

        heyoka leaves a propagation as soon as one lane is not finite, wherever the others are then:
        they are taken up again.
        """
        ta, end = self._ta, np.full(self.size, time)
        watches = {lane: Crawl(float(ta.time[lane]), time) for lane in going}
        ahead = set(going)
        while ahead:
            before = ta.time.copy()
            ta.propagate_until(end, max_steps=CRAWL_STEPS)
            for lane in sorted(ahead):
                i, t, steps = members[lane], float(ta.time[lane]), ta.propagate_res[lane][3]
                result.steps[i] += steps
                if not (np.isfinite(t) and np.isfinite(ta.state[:, lane]).all()):
                    t = t if np.isfinite(t) else float(before[lane])
                    status, reason = Status.NOT_FINITE, f"the state is not finite after t = {t:.6g}"
                elif t == time:
                    ahead.discard(lane)
                    continue
                elif reason := watches[lane].sees(t, steps):
                    status = Status.STALLED
                else:
                    continue
                result.status[i], result.t_stop[i], result.reason[i] = status, t, reason
                going.discard(lane)
            ahead &= going
            self._idle(going)

    def _idle(self, going: set[int]) -> None:
        """Have the lanes that are not going do what one that is does, so that they stop no other."""
        ta = self._ta
        idle = [lane for lane in range(self.size) if lane not in going]
        if not (idle and going):
            return
        twin = min(going)
        high, low = (part.copy() for part in ta.dtime)
        for values in (high, low, ta.state.T, ta.pars.T):
            values[idle] = values[twin]
        ta.set_dtime(high, low)
