"""An ensemble, ready to be timed."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.campaign.file import Ensemble
from hbvm_bench.measure.batch import integrate
from hbvm_bench.measure.starts import changed, members
from hbvm_bench.measure.timing import Timeable
from integrators.protocol import MethodBase, Program, Samples, Status
from problems.problem import Problem

Array = NDArray[np.float64]

WARM_UP = 16  # trajectories


@dataclass(frozen=True, eq=False)
class EnsembleRun(Timeable):
    """An ensemble, ready to be timed."""

    program: Program
    starts: Array  # where the trajectories start, shape (n, dim)
    problem: Problem  # its parameters and interval
    sample: str | None  # how one trajectory meets the end
    par: Array | None = None  # parameters of each, shape (n, n_par); the problem's own by default

    @classmethod
    def compiled(
        cls, problem: Problem, method: MethodBase, program: Program, asked: Ensemble
    ) -> "EnsembleRun":
        """Return the run of a method, and the program it compiled, on an ensemble of a problem."""
        starts, par = members(problem, asked)
        return cls(program, starts, problem, method.to_end, par)

    def until(self, share: float) -> "EnsembleRun":
        """Return the run of a few of the trajectories, over the first ``share`` of the interval."""
        end = self.problem.t0 + share * (self.problem.t_end - self.problem.t0)
        problem = changed(self.problem, self.problem.y0, self.problem.par, end)
        par = None if self.par is None else self.par[:WARM_UP]
        return replace(self, starts=self.starts[:WARM_UP], par=par, problem=problem)

    def once(self, clock: Callable[[], float]) -> tuple[float, Samples]:
        members_ = integrate(self.program, self.starts, self.problem, self.sample, clock, self.par)
        status = next(iter(members_.failed), Status.FINISHED)
        return members_.seconds, Samples(np.array([self.problem.t_end]), members_.y[:1], status)
