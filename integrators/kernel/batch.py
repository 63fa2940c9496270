"""Many trajectories of one system: starts and parameters differ, times do not.

A trajectory of a small system spends its time waiting for its own square roots
and divisions. A few trajectories taken through their steps together fill that
time; each sees exactly the operations that it would see alone.
"""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from threading import Event
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from integrators.kernel.context import ALWAYS_IMPLICIT, DENSE, DONE, LAND, SIDE, Context, Shape
from integrators.kernel.native import engine
from integrators.kernel.pace import Pace
from integrators.kernel.step.engine import steps
from integrators.kernel.stepper import HBVMStepper, Program, failure
from integrators.options import Count
from integrators.protocol import Array, Status, Trajectories, UserError, check_batch, check_times
from integrators.times import Counts, plan
from problems.checks import checked
from problems.errors import unknown

CHUNK = 1 << 14  # steps between two looks at Ctrl-C, at most
SAMPLINGS = {"side": SIDE, "land": LAND, "dense": DENSE}


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


class BatchProgram(Program, Protocol):
    """What a batch asks of its program."""

    varying: bool
    shape: Shape

    def start(self, y0: ArrayLike, par: ArrayLike | None = None, t0: float = 0.0) -> HBVMStepper: ...


def members_for(rows: int, route: int) -> int:
    """Return how many trajectories to take through their steps together.

    Two, where a sweep over eight stages of a few components waits more than it
    works (Kepler: 25 ns alone, 15 ns in pairs); larger systems and sixteen
    stages keep the processor busy by themselves.
    """
    return 2 if route == 8 and rows <= 6 else 1


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
    h = -program.h if grid[-1] < t0 else program.h
    bases = np.full(grid.size, t0)
    if sample == "land":
        bases[1:] = grid[:-1]
    n, dim = starts.shape
    counts = [np.zeros(n, dtype=np.int64) for _ in range(3)]
    result = Batch(
        grid, np.full((n, grid.size, dim), np.nan),
        [Status.FINISHED] * n, [""] * n, np.full(n, grid[-1]), *counts,
    )  # fmt: skip
    work = _Work(program, result, starts, parameters, t0, h, sample or "side", *plan(grid, bases, h))
    return partial(_done, work, threads)


def _done(work: "_Work", threads: int) -> Batch:
    program, result = work.program, work.result
    n = len(result.status)
    if program.varying or program.solver.strategy == ALWAYS_IMPLICIT:
        work.share(work.alone, range(n), threads)
        return result
    size = min(n, members_for(program.shape.rows, program.constants.route))
    groups = [range(first, min(first + size, n)) for first in range(0, n, size)]
    threads = min(threads, len(groups))
    work.share(work.run, [groups[i::threads] for i in range(threads)], threads)
    return result


@dataclass(frozen=True, eq=False)
class _Work:
    """A batch under way; groups of its trajectories may run on several threads."""

    program: BatchProgram
    result: Batch
    starts: Array
    parameters: Array
    t0: float
    h: float
    sample: str
    targets: Counts
    parts: Array
    stop: Event = field(default_factory=Event)

    def share(self, do: Callable[[Any], None], jobs: Iterable[Any], threads: int) -> None:
        """Do all jobs, on several threads or in this one; Ctrl-C stops the threads' work too."""
        if threads == 1:
            for job in jobs:
                do(job)
            return
        with ThreadPoolExecutor(threads) as pool:
            waiting = [pool.submit(do, job) for job in jobs]
            try:
                for done in waiting:
                    done.result()
            except BaseException:
                self.stop.set()
                for done in waiting:
                    done.cancel()
                raise

    def run(self, groups: list[range]) -> None:
        """Integrate groups of trajectories one after another, in memory of their own."""
        if not groups:
            return
        program, size = self.program, len(groups[0])
        pairs = [program.contexts() for _ in range(size)]
        for own, _ in pairs:
            own.point(program.scaled(self.h))
        addresses = np.array([[context.address for context in pair] for pair in pairs])
        y, times = self.result.y, self.result.t
        pace = Pace(CHUNK, self.starts.shape[1])
        for group in groups:
            here = addresses[: len(group)].T.copy()
            for pair, i in zip(pairs, group, strict=False):
                program.load(pair, self.starts[i], self.parameters[i], self.t0)
                self._reset(pair[0], self.starts[i])
            made, broken = 0, False
            while made < times.size:
                try:
                    with pace:
                        made = steps(
                            engine.ADVANCE_BATCH, here.ctypes.data, len(group), SAMPLINGS[self.sample],
                            times.size, times.ctypes.data, self.targets.ctypes.data, self.parts.ctypes.data,
                            made, y[group[0] :].ctypes.data, pace.steps,
                        )  # fmt: skip
                except UserError:  # of which of them is not known: each by itself
                    broken = True
                    break
                if self.stop.is_set():
                    return
            for pair, i in zip(pairs, group, strict=False):
                if broken or pair[0].wanted:
                    self.alone(i)
                else:
                    self._report(i, pair)

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

    def _reset(self, context: Context, start: Array) -> None:
        context.steps = context.iterations = context.evaluations = context.restarts = context.partial = 0
        context.strategy = self.program.solver.strategy
        context.wanted = context.slow = 0
        context.t0, context.h = self.t0, self.h
        steps(engine.RESET, context.address, out=start.ctypes.data)

    def _report(self, i: int, pair: tuple[Context, Context]) -> None:
        result, ctx = self.result, pair[0]
        result.steps[i] = ctx.steps
        result.iterations[i] = ctx.iterations
        result.evaluations[i] = ctx.evaluations
        if ctx.outcome != DONE:
            t = ctx.t0 + ctx.n * ctx.h
            result.y[i, ctx.made :] = np.nan
            result.t_stop[i] = t
            result.status[i], result.reason[i] = failure(ctx.outcome, self.program, pair, t)
