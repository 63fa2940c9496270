"""Warm seconds of whole integrations, honestly: compiled before, without output, samples kept."""

import math
import time
from collections.abc import Callable

import numpy as np

from hbvm_bench.campaign import TimingPlan
from hbvm_bench.records import Compile, TimingRound
from integrators.protocol import MethodBase, Status
from problems.problem import Problem

WARM_UP = 0.01  # of the span: everything has run once
SLOW = 1.0  # seconds; an integration longer than this needs no second warm-up


def time_round(problem: Problem, method: MethodBase, plan: TimingPlan) -> TimingRound | str:
    """Take the samples of one round.

    Parameters
    ----------
    problem, method
        What to time: integrations from ``t0`` to ``t_end`` that return the end state only.
    plan : TimingPlan
        How many samples, and how long they may take.

    Returns
    -------
    TimingRound or str
        A sentence where the integration does not reach the end.
    """
    program = method.compile(problem.system)
    end = np.array([problem.t_end])
    early = np.array([problem.t0 + WARM_UP * (problem.t_end - problem.t0)])

    def integrate(times: np.ndarray = end) -> Status:
        return program.start(problem.y0, problem.par, problem.t0).advance(times).status

    integrate(early)
    first, status = _seconds(integrate, 1)
    if status is not Status.FINISHED:
        return f"not timed: the integration ended as {status.value}"
    repeats = max(1, math.ceil(1.2 * plan.shortest / max(first, 1e-9)))
    samples = [first] if first > SLOW else []
    spent = sum(samples)
    while len(samples) < plan.samples and (not samples or spent + first * repeats <= plan.budget):
        total, _ = _seconds(integrate, repeats)
        samples.append(total / repeats)
        spent += total
    return TimingRound(
        samples=samples,
        repeats=repeats,
        compile=Compile(seconds=float(program.compile_seconds), cached=program.from_cache),
    )


def _seconds(integrate: Callable[[], Status], repeats: int) -> tuple[float, Status]:
    status = Status.RUNNING
    start = time.perf_counter()
    for _ in range(repeats):
        status = integrate()
    return time.perf_counter() - start, status
