"""What is looked at beside the trajectory: the law of each invariant's drift, and time reversal."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.campaign.file import Checks
from hbvm_bench.campaign.identity import fixed_step
from hbvm_bench.measure import drift
from hbvm_bench.measure.measured import Measured, largest_distance, positions
from hbvm_bench.measure.starts import scaled
from hbvm_bench.store.records import Law
from integrators.protocol import MethodBase, Program, Status
from problems.analysis import invariants
from problems.problem import Problem

Array = NDArray[np.float64]


def check(measured: Measured, method: MethodBase, program: Program, asked: Checks) -> Measured:
    """Return what was measured with the laws of its drifts and the way back, as far as they are asked for.

    ``measured`` is the trajectory from the problem's own start, over all samples; ``program`` made it.
    """
    problem = measured.problem
    if asked.reversal:
        measured = replace(measured, reversal=_reversal(problem, method, program, asked.reversal))
    if not asked.starts:
        return measured
    if not measured.complete:
        law = Law(why=f"the trajectory ends at t = {measured.t_stop:.4g}", starts=1)
        return replace(measured, laws=dict.fromkeys(problem.system.invariant_names, law))
    t = np.abs(measured.t - problem.t0)
    later = t > 0.0
    series = [_errors(problem, problem.y0, measured.t, measured.y)]
    for start in scaled(problem, asked.starts)[1:]:
        samples = program.start(start, problem.par, problem.t0).advance(measured.t)
        if samples.status is Status.FINISHED:
            series.append(_errors(problem, start, measured.t, samples.y))
    errors = {name: np.stack([one[name] for one in series])[:, later] for name in series[0]}
    found = {
        name: drift.fit(t[later], rows, signed=name == "energy") if rows.shape[1] else Law(why="no samples")
        for name, rows in errors.items()
    }
    return replace(measured, laws=found, drift={"t": t[later], **errors} if errors else {})


def _errors(problem: Problem, start: Array, t: Array, y: Array) -> dict[str, Array]:
    """Return the errors against the values at ``start``, the energy's with their sign, shape (n,) each."""
    found: dict[str, Array] = {}
    states = np.ascontiguousarray(np.vstack([start[None], y]).T)
    times = np.concatenate([[problem.t0], t])
    with np.errstate(all="ignore"):
        for name in problem.system.invariant_names:
            values = invariants.evaluate(
                problem.system.function(f"invariant:{name}"), times, states, problem.par
            )
            gaps = np.stack([(v.hi[1:] - v.hi[0]) + (v.lo[1:] - v.lo[0]) for v in values])
            size = float(np.linalg.norm([v.hi[0] for v in values])) or 1.0
            found[name] = (gaps[0] if name == "energy" else np.linalg.norm(gaps, axis=0)) / size
    return found


def _reversal(problem: Problem, method: MethodBase, program: Program, share: float) -> float | str:
    way = share * (problem.t_end - problem.t0)
    step = fixed_step(method)
    if step:  # a whole number of steps, so that the way back meets the same ones
        way = float(np.copysign(max(1, round(abs(way) / step)) * step, way))
    turn = problem.t0 + way
    y = problem.y0
    for which, begin, end in (("there", problem.t0, turn), ("back", turn, problem.t0)):
        made = program.start(y, problem.par, begin).advance(np.array([end]))
        if made.status is not Status.FINISHED:
            return f"the way {which} ended as {made.status.value.replace('_', ' ')}"
        y = made.y[-1]
    with np.errstate(all="ignore"):
        return float(largest_distance(problem, positions(problem, (y - problem.y0)[None]))[0])
