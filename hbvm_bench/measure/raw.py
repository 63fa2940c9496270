"""What the worker process of a case returns: what the integration gave, and nothing that judges it.

The series are::

    t, y                         times and states of the samples; of an ensemble the end of each trajectory
    extra.NAME                   histories that the stepper kept
    starts.y0, starts.y          initial conditions of a drift study that reached the end, shape (n, dim),
                                 their states at the same times, shape (n, times, dim)
    reversal.y                   the state after integrating there and back, shape (1, dim)
    witness.index, .high, .low   the reference subset: trajectories of an ensemble whose ends are known in
                                 128 bits, and these ends

Errors, their growth and metrics are pure functions of this; see `hbvm_bench.measure.reading`. A change
here makes every stored integration stale; a change there none.
"""

from dataclasses import replace
from decimal import Decimal

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.campaign.entries import Checks, Ensemble
from hbvm_bench.campaign.identity import fixed_step
from hbvm_bench.measure.batch import integrate
from hbvm_bench.measure.starts import changed, members, scaled
from hbvm_bench.store.records import Compile, Counters, Result, Value
from integrators.protocol import MethodBase, Program, Status
from integrators.solution import Solution
from problems.errors import InputError
from problems.problem import Problem

Array = NDArray[np.float64]
Series = dict[str, Array]

WITNESSES = 32  # trajectories whose end is known; each takes 0.04 to 0.13 s in the campaign `ensemble`


def solve(problem: Problem, method: MethodBase, program: Program, times: Array) -> Solution:
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


def solve_with_bare_end(problem: Problem, method: MethodBase, program: Program, times: Array) -> Solution:
    """Return the same, but for the end, which is that of a second run without samples.

    That is the run that is timed, and an error at the end is to be of the very run that is, as are the
    numbers of steps and evaluations. The last time is the problem's end.
    """
    sampled = solve(problem, method, program, times)
    if sampled.status is not Status.FINISHED:
        return sampled
    stepper = program.start(problem.y0, problem.par, problem.t0)
    end = stepper.advance(np.array([problem.t_end]), sample=method.to_end)
    before = sampled.t[:-1]
    return replace(
        sampled,
        t=np.append(before, end.t),
        y=np.vstack([sampled.y[:-1], end.y]),
        status=end.status,
        reason=end.reason,
        t_stop=sampled.t_stop if end.status is Status.FINISHED else float(before[-1]),
        stats=replace(stepper.stats),
    )


def of_solution(solution: Solution) -> tuple[Result, Series]:
    """Return what there is to store of a trajectory, with its series."""
    stats = solution.stats
    counts = {name: getattr(stats, name) for name in ("steps", "rejections", "evaluations", "iterations")}
    counts = {name: None if count is None else int(count) for name, count in counts.items()}
    histories = {f"extra.{name}": v for name, v in stats.extra.items() if isinstance(v, np.ndarray)}
    result = Result(
        outcome="stalled" if solution.status is Status.STALLED else "ok",
        status=solution.status.value,
        reason=solution.reason,
        t_stop=float(solution.t_stop) if np.isfinite(solution.t_stop) else None,
        counters=Counters(**counts, solver=stats.solver),
        compile=Compile(seconds=float(solution.compile_seconds), cached=solution.from_cache),
        warnings=list(solution.warnings),
    )
    kept = {name: values for name, values in histories.items() if values.dtype.kind in "fiu"}
    return result, {"t": solution.t, "y": solution.y, **kept}


def beside(solution: Solution, program: Program, asked: Checks) -> tuple[Value, Series]:
    """Integrate what is looked at beside a trajectory: further initial conditions, and the way back.

    Returned is, beside the series, why there is no way back; the value is computed when it is read.
    """
    problem, series = solution.problem, Series()
    way_back = Value(why="not asked for")
    if asked.reversal:
        returned = _there_and_back(problem, solution.method, program, asked.reversal)
        if isinstance(returned, str):
            way_back = Value(why=returned)
        else:
            way_back, series["reversal.y"] = Value(), returned[None]
    if asked.starts and solution.status is Status.FINISHED:
        starts, states = [], []
        for start in scaled(problem, asked.starts)[1:]:
            samples = program.start(start, problem.par, problem.t0).advance(solution.t)
            if samples.status is Status.FINISHED:
                starts.append(start)
                states.append(samples.y)
        shape = (len(starts), solution.t.size, problem.system.dim)
        series["starts.y0"] = np.reshape(starts, (len(starts), problem.system.dim))
        series["starts.y"] = np.reshape(states, shape)
    return way_back, series


def ensemble(problem: Problem, program: Program, asked: Ensemble) -> tuple[Result, Series]:
    """Integrate an ensemble once; its series are over the trajectories, not over time."""
    starts, par = members(problem, asked)
    batch = integrate(program, starts, problem, par=par)
    failed = batch.failed
    index = np.unique(np.linspace(0, asked.count - 1, WITNESSES).astype(int))
    result = Result(
        outcome="stalled" if failed and failed[0] is Status.STALLED else "ok",
        status=(failed[0] if failed else Status.FINISHED).value,
        reason=f"{len(failed)} of {asked.count} trajectories failed; {batch.reason}" if failed else "",
        t_stop=problem.t_end,
        counters=Counters(steps=batch.steps, evaluations=batch.evaluations),
        compile=Compile(seconds=float(program.compile_seconds), cached=program.from_cache),
        trajectories=asked.count,
    )
    series = {"t": np.full(asked.count, problem.t_end), "y": batch.y}
    return result, series | _ends(problem, index, starts[index], par[index])


def _ends(problem: Problem, index: NDArray[np.intp], starts: Array, par: Array) -> Series:
    """Return the 128-bit ends of a few trajectories, one row each; nothing without heyoka."""
    from hbvm_bench.reference import solutions  # few cases ask for it

    span = np.array([problem.t0, problem.t_end])
    rows: list[list[Decimal]] = []
    try:
        for start, own in zip(starts, par, strict=True):
            member = changed(problem, start, own, problem.t_end)
            rows.append(solutions.taylor(member, span, solutions.TOLERANCE)[-1])
    except InputError:  # heyoka is missing, or it does not arrive
        return {}
    high = np.array([[float(value) for value in row] for row in rows])
    low = np.array([[float(value - Decimal(float(value))) for value in row] for row in rows])
    return {"witness.index": index.astype(np.float64), "witness.high": high, "witness.low": low}


def _there_and_back(problem: Problem, method: MethodBase, program: Program, share: float) -> Array | str:
    way = share * (problem.t_end - problem.t0)
    step = fixed_step(method)
    if step:  # a whole number of steps, so that the way back meets the same ones
        way = float(np.copysign(max(1, round(abs(way) / step)) * step, way))
    turn = problem.t0 + way
    y = problem.y0
    for which, begin, end in (("there", problem.t0, turn), ("back", turn, problem.t0)):
        samples = program.start(y, problem.par, begin).advance(np.array([end]))
        if samples.status is not Status.FINISHED:
            return f"the way {which} ended as {samples.status.value.replace('_', ' ')}"
        y = samples.y[-1]
    return y
