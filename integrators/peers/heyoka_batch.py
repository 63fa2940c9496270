"""Many trajectories by heyoka's batch integrator: one trajectory in each lane of the vector unit."""

from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from integrators.peers.options import load
from integrators.protocol import Array, Status, as_numbers, check_state, check_times
from integrators.trajectories import Counts, Trajectories
from problems import emit, limits
from problems.errors import InputError
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
        self._success = hy.taylor_outcome.time_limit
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
        given, parameters = self._given(starts, par)
        grid = check_times(times, t0)
        n = len(given)
        gib = 8 * given.size * grid.size / 2**30
        limits.check(f"a batch of {n} trajectories", "GIB", gib)
        result = Trajectories(
            t=grid,
            y=np.full((n, grid.size, self.system.dim), np.nan),
            status=[Status.FINISHED] * n,
            reason=[""] * n,
            t_stop=np.full(n, grid[-1]),
            steps=np.zeros(n, dtype=np.int64),
        )
        for first in range(0, n, self.size):
            # the last lanes repeat a trajectory, so that all have something to do
            members = np.minimum(np.arange(first, first + self.size), n - 1)
            self._group(result, members[: min(self.size, n - first)], given[members], parameters[members], t0)
        return result

    def _group(self, result: Trajectories, members: Counts, starts: Array, par: Array, t0: float) -> None:
        ta, lanes = self._ta, range(len(members))
        ta.set_time(t0)
        ta.state[:] = starts.T
        if par.shape[1]:
            ta.pars[:] = par.T
        ended = [False for _ in lanes]
        for place, time in enumerate(result.t.tolist()):
            if time == t0:
                result.y[members, place] = starts[: len(members)]
                continue
            ta.propagate_until(np.full(self.size, time))
            for lane in lanes:
                outcome, _, _, steps = ta.propagate_res[lane]
                i = members[lane]
                if ended[lane]:
                    continue
                result.steps[i] += steps
                if outcome == self._success and np.isfinite(ta.state[:, lane]).all():
                    result.y[i, place] = ta.state[:, lane]
                    continue
                ended[lane] = True
                result.status[i] = Status.NOT_FINITE
                result.t_stop[i] = ta.time[lane]
                result.reason[i] = f"the state is not finite after t = {ta.time[lane]:.6g}"
            if all(ended):
                return

    def _given(self, starts: ArrayLike, par: ArrayLike | None) -> tuple[Array, Array]:
        rows = np.atleast_2d(as_numbers("Y0", starts))
        if rows.ndim != 2 or rows.shape[0] == 0:
            raise InputError(f"Y0 must have shape (n, {self.system.dim}) with n >= 1, not {rows.shape}.")
        checked = np.array([check_state(row, self.system.dim) for row in rows])
        default = self.system.pack({})
        values = default if par is None else as_numbers("par", par)
        if values.shape == default.shape:
            return checked, np.tile(values, (len(checked), 1))
        if values.shape != (len(checked), default.size):
            raise InputError(
                f"par must have shape {default.shape} or ({len(checked)}, {default.size}), "
                f"not {values.shape}."
            )
        return checked, values
