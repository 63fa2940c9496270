"""Many trajectories of one system: starts and parameters differ, times do not.

They go in lanes, one in each lane of the vector unit (`integrators.kernel.ensemble`), and
one by one where that cannot be: with an implicit solver, more than sixteen stages, steps that
something else than the tolerance limits, a field that does not run on lanes, or switches in the state. One
whose equations the iteration does not solve, or is slow to solve, leaves its lane and goes by itself, from
its start; so does one with adaptive steps whose field has a discontinuity.
"""

from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from threading import Event
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from integrators.events.finder import Ending
from integrators.kernel.context import Context
from integrators.kernel.engines import run, run_own
from integrators.kernel.ensemble.group import LEFT
from integrators.kernel.ensemble.prepared import Lanes
from integrators.kernel.pace import Pace
from integrators.kernel.stepper import HBVMStepper, Program
from integrators.kernel.tangent.lanes import VectorLanes
from integrators.options import Count
from integrators.protocol import Array, Samples, Status, Trajectories, UserError, telling
from integrators.refusals import check_batch, check_times
from integrators.running.times import Counts, plan
from problems.checks import checked
from problems.errors import unknown

CHUNK = 1 << 14  # steps between two looks at Ctrl-C, at most
JOBS = 8  # for each thread, at least, where there are so many groups: for even loads
SAMPLINGS = ("partial", "stop", "dense")

Directions = tuple[Array, Array]
"""Parts of tangent vectors in the states, shape (n, dim, k), and in the parameters, (n, n_par, k)."""


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


def prepare_batch(
    program: Program,
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
    result = nothing_yet(grid, *starts.shape)
    work = Work(program, result, starts, parameters, t0, sample or "partial", threads)
    lanes = program.in_lanes() if work.sample == "partial" else None
    if lanes is None:
        return work.all_alone
    return partial(work.run, (Adaptive if lanes.varying else Fixed).planned(lanes, work))


def nothing_yet(times: Array, n: int, dim: int) -> Batch:
    """Return what a batch of n trajectories begins with."""
    counts = [np.zeros(n, dtype=np.int64) for _ in range(3)]
    return Batch(
        times, np.full((n, times.size, dim), np.nan), [Status.FINISHED] * n, [""] * n, np.full(n, times[-1]),
        *counts,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Work:
    """A batch under way; its trajectories may run on several threads."""

    program: Program
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
        jobs = deque(range(i, min(i + size, n)) for i in range(0, n, size))
        self.share(lanes.run, [jobs] * min(self.threads, len(jobs)))
        stayed = lanes.arrived != LEFT
        result.steps[stayed] = lanes.steps[stayed]
        result.iterations[stayed] = lanes.iterations[stayed]
        result.evaluations[stayed] = lanes.lanes.k * lanes.iterations[stayed]
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
                for future in waiting:
                    future.result()
            except BaseException:
                self.stop.set()
                for future in waiting:
                    future.cancel()
                raise

    def alone(self, i: int) -> None:
        """Integrate one trajectory by a stepper: its steps are its own, or its implicit solver."""
        result = self.result
        try:
            stepper = self.started(i)
        except UserError as raised:
            result.y[i], result.t_stop[i], result.status[i] = np.nan, self.t0, Status.USER_ERROR
            result.reason[i] = f"{raised} at the start, t = {self.t0!r}."
            return
        stepper.stop, stepper.destination = self.stop, float(result.t[-1])
        samples = stepper.advance(result.t, sample=self.sample)
        ending, count = self.ending(i, stepper, samples)
        result.y[i, :count] = self.states(stepper, samples)[:count]
        result.y[i, count:] = np.nan
        result.status[i], result.reason[i], result.t_stop[i] = ending.status, ending.reason, ending.stop
        stats = stepper.stats
        result.steps[i], result.iterations[i] = stats.steps, stats.iterations or 0
        result.evaluations[i] = stats.evaluations or 0
        if extra := telling(stats):
            result.extra[i] = extra

    def started(self, i: int) -> HBVMStepper:
        """Return a stepper at the start of a trajectory."""
        return self.program.start(self.starts[i], self.parameters[i], self.t0)

    def ending(self, i: int, stepper: HBVMStepper, samples: Samples) -> tuple[Ending, int]:
        """Return how a trajectory ended, and how many of the samples it reached."""
        stop = float(self.result.t[-1]) if samples.status is Status.FINISHED else stepper.t
        return Ending(samples.status, samples.reason, stop), samples.t.size

    def states(self, stepper: HBVMStepper, samples: Samples) -> Array:
        """Return what the result has of samples that a stepper has made."""
        return samples.y


@dataclass(frozen=True, eq=False)
class _InLanes:
    """What a batch needs to go in lanes."""

    lanes: Lanes
    work: Work
    h: float
    numbers: dict[str, int]
    arrays: dict[str, Any]
    spare: list[Any] = field(default_factory=list)

    @classmethod
    def planned(cls, lanes: Lanes, work: Work) -> Self:
        """Plan; allocate."""
        result, n = work.result, len(work.starts)
        h, counts, more = cls.plan(lanes, work)
        arrays = {
            "starts": work.starts, "all_par": work.parameters,
            "all_velocity": lanes.velocities(work.parameters),
            "times": np.ascontiguousarray(result.t), "out": result.y, **more,
            "arrived": np.zeros(n, np.int64), "all_iterations": np.zeros(n, np.int64),
        }  # fmt: skip
        lanes_ = cls(lanes, work, h, {"count": result.t.size, "trajectories": n, **counts}, arrays)
        lanes_.spare.append(lanes_.memory())
        return lanes_

    @classmethod
    def plan(cls, lanes: Lanes, work: Work) -> tuple[float, dict[str, int], dict[str, Any]]:
        """Return the step that the matrix is for, and what else `Group` has: numbers and arrays."""
        raise NotImplementedError

    def memory(self) -> Any:
        """Return memory for one thread."""
        return self.lanes.groups(self.work.t0, self.h, self.numbers, self.arrays)

    def advance(self, memory: Any, budget: int) -> int:
        """Go on; return 1 at the end, or 0 after so many steps."""
        group, partial = memory
        return run(group, partial, budget)

    def pace(self) -> Pace:
        """Return how many steps are taken between two looks at Ctrl-C."""
        return Pace(CHUNK, self.work.starts.shape[1])

    @property
    def steps(self) -> Counts:
        """Steps of every trajectory."""
        raise NotImplementedError

    @property
    def arrived(self) -> Counts:
        """How trajectories have left their lanes: `LEFT`, `ARRIVED`, ... of `ensemble.group`."""
        return self.arrays["arrived"]

    @property
    def iterations(self) -> Counts:
        """Iterations in which each took part."""
        return self.arrays["all_iterations"]

    def run(self, jobs: deque[range]) -> None:
        """Integrate trajectories by the jobs that are left, which other threads take from too."""
        try:
            memory = self.spare.pop()
        except IndexError:  # another thread has it
            memory = self.memory()
        group = memory[0]
        group.sample = -1
        pace = self.pace()
        while True:
            try:
                members = jobs.popleft()
            except IndexError:
                if not group.more:
                    break
                group.more = 0  # what is in lanes still
            else:
                group.at, group.end, group.more = members.start, members.stop, 1
            done = False
            while not done:
                if self.work.stop.is_set():
                    return
                with pace:
                    done = self.advance(memory, pace.steps) == 1


class Fixed(_InLanes):
    """Fixed steps: a group of trajectories after the other."""

    @classmethod
    def plan(cls, lanes: Lanes, work: Work) -> tuple[float, dict[str, int], dict[str, Any]]:
        times, t0 = work.result.t, work.t0
        h = -work.program.h if times[-1] < t0 else work.program.h
        targets, parts = plan(times, np.full(times.size, t0), h)
        return h, {}, {"targets": targets, **lanes.parts(parts, h)}

    @property
    def steps(self) -> Counts:
        return np.full(len(self.arrived), self.arrays["targets"].max(initial=0))


class Adaptive(_InLanes):
    """Adaptive steps: in each lane one trajectory after the other."""

    @classmethod
    def plan(cls, lanes: Lanes, work: Work) -> tuple[float, dict[str, int], dict[str, Any]]:
        return 1.0, {}, {"all_steps": np.zeros(len(work.starts), np.int64)}

    def contexts(self) -> list[tuple[Context, ...]]:
        """Return fresh contexts for each lane: that of its trajectory first."""
        par = self.work.parameters[0]
        return [self.work.program.contexts(par)[:1] for _ in range(self.lanes.width)]

    def memory(self) -> Any:
        contexts, adaptive = self.contexts(), self.work.program.adaptive
        assert adaptive is not None
        for context, *_ in contexts:
            context.controller.interval = float(abs(self.work.result.t[-1] - self.work.t0))
            adaptive.limit(context, context.controller.interval)
        group, _ = self.lanes.groups(self.work.t0, self.h, self.numbers, self.arrays)
        group.contexts = [context for context, *_ in contexts]
        group.first_length = self.work.program.plan.h or 0.0
        return group, contexts

    def advance(self, memory: Any, budget: int) -> int:
        return run_own(memory[0], budget)

    @property
    def steps(self) -> Counts:
        return self.arrays["all_steps"]


def batch_along(
    program: Program, lanes: VectorLanes, Y0: ArrayLike, par: ArrayLike | None, times: ArrayLike,
    t0: float, directions: Directions, threads: int,
) -> Batch:  # fmt: skip
    """Integrate every start, and the vectors along it, to all times. See `HBVMProgram.batch_along`.

    They are a batch of trajectories of a larger system.
    """
    threads = checked("a batch", "threads", threads, Count)
    grid = check_times(times, t0)
    starts, parameters = check_batch(Y0, par, grid, program.system)
    larger = nothing_yet(grid, len(starts), lanes.dim)
    joined = lanes.join(starts, directions[0]), lanes.join_parameters(parameters, directions[1])
    work = _WorkAlong(
        program, larger, *joined, t0, "partial", threads, larger=lanes, single=(starts, parameters),
        directions=directions,
    )  # fmt: skip
    work.run(Fixed.planned(lanes, work))
    y, vectors = lanes.split(larger.y)
    return replace(larger, y=y, variations=vectors)


@dataclass(frozen=True, eq=False, kw_only=True)
class _WorkAlong(Work):
    """A batch of the larger system; what leaves its lane is integrated by a stepper with tangent vectors."""

    larger: VectorLanes
    single: tuple[Array, Array]
    directions: Directions

    def started(self, i: int) -> HBVMStepper:
        """Return a stepper at the start of a trajectory, with its vectors."""
        starts, parameters = self.single
        stepper = self.program.start(starts[i], parameters[i], self.t0)
        stepper.follow(*(part[i] for part in self.directions))
        return stepper

    def states(self, stepper: HBVMStepper, samples: Samples) -> Array:
        """Return samples and the vectors there as states of the larger system."""
        assert stepper.variations is not None
        return self.larger.join(np.asarray(samples.y), stepper.variations)
