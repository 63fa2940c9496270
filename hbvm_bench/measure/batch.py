"""Many trajectories of one problem at once, through the method's batch path where it has one."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.protocol import Batches, PreparedBatches, Program, Status, offers
from problems.problem import Problem

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Members:
    """What a batch returned of its members."""

    y: Array  # states at the end, shape (n, dim); NaN where a trajectory did not arrive
    status: list[Status]  # of each
    reason: str  # that of the first that failed
    steps: int  # over all, as the next
    evaluations: int | None
    seconds: float  # of integrating; preparing the batch, or making a stepper for each start, is left out

    @property
    def failed(self) -> list[Status]:
        """How those ended that did not arrive."""
        return [status for status in self.status if status is not Status.FINISHED]


def prepared(
    program: Any, starts: Array, problem: Problem, par: Array | None = None
) -> Callable[[], Any] | None:
    """Return the call of a program's batch, compiled, checked and allocated where it can prepare one.

    ``None`` where it has no batch. Preparing one compiles what the program leaves to its first batch.
    """
    par = problem.par if par is None else par
    arguments = {"times": np.array([problem.t_end]), "t0": problem.t0}
    if offers(program, PreparedBatches):
        return program.prepare_batch(starts, par, **arguments)
    return partial(program.batch, starts, par, **arguments) if offers(program, Batches) else None


def integrate(
    program: Program,
    starts: Array,
    problem: Problem,
    sample: str | None = None,
    clock: Callable[[], float] = time.perf_counter,
    par: Array | None = None,
) -> Members:
    """Integrate every start, shape (n, dim), to the end of the interval, with the parameters of each.

    The program's ``batch`` is used where it has one, prepared before the clock runs where it can be
    (``prepare_batch``); otherwise one trajectory follows the other and meets the end as ``sample`` says
    (`integrators.protocol.MethodBase.to_end`).
    """
    end = np.array([problem.t_end])
    par = np.tile(problem.par, (len(starts), 1)) if par is None else par
    go = prepared(program, starts, problem, par)
    if go is not None:
        begin = clock()
        batch = go()
        spent = clock() - begin
        counts = getattr(batch, "evaluations", None)
        return Members(
            y=batch.y[:, -1],
            status=batch.status,
            reason=next((reason for reason in batch.reason if reason), ""),
            steps=int(batch.steps.sum()),
            evaluations=None if counts is None else int(counts.sum()),
            seconds=spent,
        )
    y = np.full(starts.shape, np.nan)
    status: list[Status] = []
    evaluated: list[int | None] = []
    reason, steps, spent = "", 0, 0.0
    for i, start in enumerate(starts):
        stepper = program.start(start, par[i], problem.t0)
        begin = clock()
        samples = stepper.advance(end, sample=sample)
        spent += clock() - begin
        status.append(samples.status)
        reason = reason or samples.reason
        if samples.status is Status.FINISHED:
            y[i] = samples.y[-1]
        steps += stepper.stats.steps
        evaluated.append(stepper.stats.evaluations)
    evaluations = None if None in evaluated else sum(filter(None, evaluated))
    return Members(y, status, reason, steps, evaluations, spent)
