"""Many trajectories of one system: starts and parameters differ, times do not.

They go in lanes, one in each lane of the vector unit (`integrators.kernel.ensemble`), and
one by one where that cannot be: with steps of varying length, an implicit solver, more than
sixteen stages, a field that does not run on lanes. One whose equations the iteration does
not solve leaves its lane and goes by itself, from its start.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from threading import Event
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from integrators.kernel.ensemble.engine import run
from integrators.kernel.ensemble.group import Group
from integrators.kernel.ensemble.prepared import Lanes
from integrators.kernel.pace import Pace
from integrators.kernel.stepper import HBVMStepper
from integrators.options import Count
from integrators.protocol import Array, Status, Trajectories, UserError, check_batch, check_times
from integrators.times import Counts, plan
from problems.checks import checked
from problems.errors import unknown
from problems.problem import System

CHUNK = 1 << 14  # steps between two looks at Ctrl-C, at most
JOBS = 8  # for each thread, at least, where there are so many groups: for even loads
SAMPLINGS = ("side", "land", "dense")


@dataclass(frozen=True, eq=False)
class Batch(Trajectories):
    """Trajectories of one system, and what the kernel counts besides steps.

    Attributes
    ----------
    iterations, evaluations : ndarray of int, shape (n,)
        Work done per trajectory.
    """

    iterations: Counts
    evaluations: Counts


class BatchProgram(Protocol):
    """What a batch asks of its program."""

    system: System
    h: float

    def start(self, y0: ArrayLike, par: ArrayLike | None = None, t0: float = 0.0) -> HBVMStepper: ...
    def in_lanes(self) -> Lanes | None: ...


def prepare_batch(
    program: BatchProgram,
    Y0: ArrayLike,
    par: ArrayLike | None,
    times: ArrayLike,
    t0: float,
    sample: str | None = None,
    threads: int = 1,
) -> Callable[[], Batch]:
    """Check and allocate; return what integrates every start to all times. See `HBVMProgram.batch`."""
    if sample is not None and (not isinstance(sample, str) or sample not in SAMPLINGS):
        raise unknown("sampling of a batch", sample, SAMPLINGS)
    threads = checked("a batch", "threads", threads, Count)
    grid = check_times(times, t0)
    starts, parameters = check_batch(Y0, par, grid, program.system)
    n, dim = starts.shape
    counts = [np.zeros(n, dtype=np.int64) for _ in range(3)]
    result = Batch(
        grid, np.full((n, grid.size, dim), np.nan),
        [Status.FINISHED] * n, [""] * n, np.full(n, grid[-1]), *counts,
    )  # fmt: skip
    work = _Work(program, result, starts, parameters, t0, sample or "side", threads)
    lanes = program.in_lanes() if work.sample == "side" else None
    return work.all_alone if lanes is None else partial(work.run, _InLanes.of(lanes, work))


@dataclass(frozen=True, eq=False)
class _Work:
    """A batch under way; its trajectories may run on several threads."""

    program: BatchProgram
    result: Batch
    starts: Array
    parameters: Array
    t0: float
    sample: str
    threads: int
    stop: Event = field(default_factory=Event)

    def run(self, lanes: "_InLanes") -> Batch:
        """Integrate all trajectories in lanes, and those that leave one by one."""
        n, result = len(self.starts), self.result
        width = lanes.lanes.width
        size = max(1, n // (width * JOBS * self.threads)) * width
        self.share(lanes.run, [range(i, min(i + size, n)) for i in range(0, n, size)])
        stayed = lanes.arrived == 1
        result.steps[stayed] = lanes.steps
        result.iterations[stayed] = lanes.sweeps[stayed]
        result.evaluations[stayed] = lanes.lanes.k * lanes.sweeps[stayed]
        self.share(self.alone, np.flatnonzero(~stayed).tolist())
        return result

    def all_alone(self) -> Batch:
        """Integrate all trajectories one by one."""
        self.share(self.alone, list(range(len(self.starts))))
        return self.result

    def share(self, do: Callable[[Any], None], jobs: list[Any]) -> None:
        """Do all jobs, on several threads or in this one; Ctrl-C stops the threads' work too."""
        if self.threads == 1:
            for job in jobs:
                do(job)
            return
        with ThreadPoolExecutor(self.threads) as pool:
            waiting = [pool.submit(do, job) for job in jobs]
            try:
                for made in waiting:
                    made.result()
            except BaseException:
                self.stop.set()
                for made in waiting:
                    made.cancel()
                raise

    def alone(self, i: int) -> None:
        """Integrate one trajectory by a stepper: its steps are its own, or its implicit solver."""
        result = self.result
        try:
            stepper = self.program.start(self.starts[i], self.parameters[i], self.t0)
        except UserError as raised:
            result.y[i], result.t_stop[i], result.status[i] = np.nan, self.t0, Status.USER_ERROR
            result.reason[i] = f"{raised} at the start, t = {self.t0!r}."
            return
        stepper.stop = self.stop
        samples = stepper.advance(result.t, sample=self.sample)
        result.y[i, : samples.t.size], result.y[i, samples.t.size :] = samples.y, np.nan
        result.status[i], result.reason[i] = samples.status, samples.reason
        result.t_stop[i] = result.t[-1] if samples.status is Status.FINISHED else stepper.t
        stats = stepper.stats
        result.steps[i], result.iterations[i] = stats.steps, stats.iterations or 0
        result.evaluations[i] = stats.evaluations or 0


@dataclass(frozen=True, eq=False)
class _InLanes:
    """What a batch needs to go in lanes."""

    lanes: Lanes
    work: _Work
    h: float
    numbers: dict[str, int]
    arrays: dict[str, Any]
    spare: list[tuple[Group, Group]] = field(default_factory=list)

    @classmethod
    def of(cls, lanes: Lanes, work: _Work) -> "_InLanes":
        """Plan the steps to the samples; allocate."""
        result, t0 = work.result, work.t0
        h = -work.program.h if result.t[-1] < t0 else work.program.h
        targets, parts = plan(result.t, np.full(result.t.size, t0), h)
        n = len(work.starts)
        arrays = {
            "starts": work.starts, "all_par": work.parameters,
            "all_velocity": lanes.velocities(work.parameters),
            "times": np.ascontiguousarray(result.t), "targets": targets, "out": result.y,
            **lanes.parts(parts, h),
            "arrived": np.zeros(n, np.int64), "all_sweeps": np.zeros(n, np.int64),
        }  # fmt: skip
        made = cls(lanes, work, h, {"count": result.t.size, "trajectories": n}, arrays)
        made.spare.append(made._memory())
        return made

    def _memory(self) -> tuple[Group, Group]:
        return self.lanes.groups(self.work.t0, self.h, self.numbers, self.arrays)

    @property
    def steps(self) -> int:
        """Own steps of every trajectory."""
        return int(self.arrays["targets"].max(initial=0))

    @property
    def arrived(self) -> Counts:
        """1 for trajectories that arrived, 0 for those that left."""
        return self.arrays["arrived"]

    @property
    def sweeps(self) -> Counts:
        """Sweeps in which each took part."""
        return self.arrays["all_sweeps"]

    def run(self, members: range) -> None:
        """Integrate some trajectories, group by group."""
        try:
            memory = self.spare.pop()
        except IndexError:  # another thread has it
            memory = self._memory()
        group, side = memory
        group.at, group.end, group.sample = members.start, members.stop, -1
        pace = Pace(CHUNK, self.work.starts.shape[1])
        done = False
        while not done and not self.work.stop.is_set():
            with pace:
                done = run(group.address, side.address, pace.steps) == 1
        self.spare.append(memory)
