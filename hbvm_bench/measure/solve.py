"""Integrate with a program that is compiled already: the bench integrates one case several times."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.measure.timing import Run
from integrators.protocol import MethodBase, Program, Status
from integrators.solution import Solution
from problems.problem import Problem


def solve(problem: Problem, method: MethodBase, program: Program, times: NDArray[np.float64]) -> Solution:
    """Return what `integrators.integrate` returns, with what ``method.compile(problem.system)`` returned."""
    stepper = program.start(problem.y0, problem.par, problem.t0)
    samples = stepper.advance(times)
    finished = samples.status is Status.FINISHED
    return Solution(
        t=samples.t,
        y=samples.y,
        status=samples.status,
        reason=samples.reason,
        t_stop=float(samples.t[-1]) if finished and samples.t.size else stepper.t,
        stats=replace(stepper.stats),
        compile_seconds=program.compile_seconds,
        from_cache=program.from_cache,
        problem=problem,
        method=method,
    )


def solve_with_bare_end(
    problem: Problem, method: MethodBase, program: Program, times: NDArray[np.float64]
) -> Solution:
    """Return the same, but for the end, which is that of a second run without samples.

    That run is the one that is timed, and an error at the end is to be of the very run that is. The last
    time is the problem's end.
    """
    sampled = solve(problem, method, program, times)
    if sampled.status is not Status.FINISHED:
        return sampled
    _, end = Run.of(problem, method, program).seconds()
    before = sampled.t[:-1]
    return replace(
        sampled,
        t=np.append(before, end.t),
        y=np.vstack([sampled.y[:-1], end.y]),
        status=end.status,
        reason=end.reason,
        t_stop=sampled.t_stop if end.status is Status.FINISHED else float(before[-1]),
    )
