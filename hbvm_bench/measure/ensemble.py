"""Many trajectories of one problem at once, through the method's batch path where it has one.

Measured as one case: every trajectory's invariants against its own start, the position
of a few of them against 128-bit Taylor solutions, and the time of all.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.campaign.file import Ensemble
from hbvm_bench.measure.measured import Measured, ahead, largest_distance, position_error, positions
from hbvm_bench.measure.starts import members
from hbvm_bench.measure.timing import Timeable
from hbvm_bench.reference import solutions as reference
from hbvm_bench.reference.solutions import Reference
from hbvm_bench.store.records import Compile, Counters
from integrators.protocol import MethodBase, Program, Samples, Status
from problems.analysis.invariants import evaluate
from problems.errors import InputError
from problems.problem import Problem

Array = NDArray[np.float64]

WITNESSES = 32  # trajectories whose end is known; each takes 0.04 to 0.13 s in the campaign `ensemble`
WARM_UP = 16  # trajectories


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
        return [one for one in self.status if one is not Status.FINISHED]


def prepared(
    program: Program, starts: Array, problem: Problem, par: Array | None = None
) -> Callable[[], Any] | None:
    """Return the call of a program's batch, compiled, checked and allocated where it can prepare one.

    ``None`` where it has no batch. Preparing one compiles what the program leaves to its first batch.
    """
    par = problem.par if par is None else par
    arguments = {"times": np.array([problem.t_end]), "t0": problem.t0}
    if prepare := getattr(program, "prepare_batch", None):
        return prepare(starts, par, **arguments)
    batch = getattr(program, "batch", None)
    return None if batch is None else partial(batch, starts, par, **arguments)


def integrate(
    program: Program,
    starts: Array,
    problem: Problem,
    sample: str | None = None,
    clock: Callable[[], float] = time.perf_counter,
    par: Array | None = None,
) -> Members:
    """Integrate every start, shape (n, dim), to the end of the problem's span, with the parameters of each.

    The program's ``batch`` is used where it has one, prepared before the clock runs where it can be
    (``prepare_batch``); otherwise one trajectory follows the other and meets the end as ``sample`` says
    (`integrators.protocol.MethodBase.to_end`).
    """
    end = np.array([problem.t_end])
    par = np.tile(problem.par, (len(starts), 1)) if par is None else par
    go = prepared(program, starts, problem, par)
    if go is not None:
        begin = clock()
        made = go()
        spent = clock() - begin
        counts = getattr(made, "evaluations", None)
        return Members(
            y=made.y[:, -1],
            status=made.status,
            reason=next((reason for reason in made.reason if reason), ""),
            steps=int(made.steps.sum()),
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


def measure(problem: Problem, program: Program, ensemble: Ensemble) -> tuple[Measured, Status, str]:
    """Run an ensemble once and evaluate what it kept; return it with the first failure, if any, and why.

    Its series are over the trajectories, not over time; see `Measured.trajectories`.
    """
    starts, par = members(problem, ensemble)
    made = integrate(program, starts, problem, par=par)
    failed = made.failed
    witnesses = np.unique(np.linspace(0, ensemble.count - 1, WITNESSES).astype(int))
    known = _truth(problem, starts[witnesses], par[witnesses])
    with np.errstate(all="ignore"):
        distance = largest_distance(problem, positions(problem, made.y))
        errors = _errors(problem, starts, par, made.y)
        position = phase = np.empty(0)
        if known is not None:
            gap = (made.y[witnesses] - known.high) - known.low
            position = position_error(problem, gap, known.high)
            phase = np.abs(ahead(problem, known.t, known.high, gap))
    t = np.full(ensemble.count, problem.t_end)
    measured = Measured(
        problem=problem,
        t=t,
        y=made.y,
        errors=errors,
        guards={name: np.asarray(v, float) for name, v in problem.guards(made.y, t).items()},
        distance=distance,
        position_t=np.full(len(position), problem.t_end),
        position=np.sort(position),  # the last is the largest
        phase=np.sort(phase),
        reference=known,
        complete=not failed,
        t_stop=problem.t_end,
        counters=Counters(steps=made.steps, evaluations=made.evaluations),
        compile=Compile(seconds=float(program.compile_seconds), cached=program.from_cache),
        trajectories=ensemble.count,
    )
    reason = f"{len(failed)} of {ensemble.count} trajectories failed; {made.reason}" if failed else ""
    return measured, failed[0] if failed else Status.FINISHED, reason


@dataclass(frozen=True, eq=False)
class EnsembleRun(Timeable):
    """An ensemble, ready to be timed."""

    program: Program
    starts: Array  # where the trajectories start, shape (n, dim)
    problem: Problem  # its parameters and span
    sample: str | None  # how one trajectory meets the end
    par: Array | None = None  # parameters of each, shape (n, n_par); the problem's own by default

    @classmethod
    def of(cls, problem: Problem, method: MethodBase, program: Program, asked: Ensemble) -> "EnsembleRun":
        """Return the run of a method, and the program it compiled, on an ensemble of a problem."""
        starts, par = members(problem, asked)
        return cls(program, starts, problem, method.to_end, par)

    def until(self, share: float) -> "EnsembleRun":
        """Return the run of a few of the trajectories, over the first ``share`` of the span."""
        end = self.problem.t0 + share * (self.problem.t_end - self.problem.t0)
        problem = _from(self.problem, self.problem.y0, self.problem.par, end)
        par = None if self.par is None else self.par[:WARM_UP]
        return replace(self, starts=self.starts[:WARM_UP], par=par, problem=problem)

    def once(self, clock: Callable[[], float]) -> tuple[float, Samples]:
        made = integrate(self.program, self.starts, self.problem, self.sample, clock, self.par)
        status = next(iter(made.failed), Status.FINISHED)
        return made.seconds, Samples(np.array([self.problem.t_end]), made.y[:1], status)


def _errors(problem: Problem, starts: Array, par: Array, y: Array) -> dict[str, Array]:
    """Return the errors of the invariants, each trajectory's against its own start, shape (n,)."""
    found: dict[str, Array] = {}
    for name in problem.system.invariant_names:
        function = problem.system.function(f"invariant:{name}")
        before = evaluate(function, problem.t0, np.ascontiguousarray(starts.T), par.T)
        after = evaluate(function, problem.t_end, np.ascontiguousarray(y.T), par.T)
        gaps = np.stack([(a - b).rounded() for a, b in zip(after, before, strict=True)])
        size = np.linalg.norm(np.stack([b.hi for b in before]), axis=0)
        found[name] = np.linalg.norm(gaps, axis=0) / np.where(size == 0.0, 1.0, size)
    return found


def _truth(problem: Problem, starts: Array, par: Array) -> Reference | None:
    """Return the 128-bit ends of a few trajectories, one row each; ``None`` without heyoka."""
    span = np.array([problem.t0, problem.t_end])
    rows: list[list[Decimal]] = []
    try:
        for start, own in zip(starts, par, strict=True):
            one = _from(problem, start, own, problem.t_end)
            rows.append(reference.taylor(one, span, reference.TOLERANCE)[-1])
    except InputError:  # heyoka is missing, or it does not arrive
        return None
    high = np.array([[float(value) for value in row] for row in rows])
    low = np.array([[float(value - Decimal(float(value))) for value in row] for row in rows])
    made = {"method": f"heyoka taylor_adaptive, fp_type=real128, tol={reference.TOLERANCE}"}
    return Reference(np.full(len(rows), problem.t_end), high, low, made)


def _from(problem: Problem, start: Array, par: Array, t_end: float) -> Problem:
    """Return a problem with another start, other parameters and another end."""
    values = problem.system.unpack(par)
    parameters = {key: v.tolist() if isinstance(v, np.ndarray) else v for key, v in values.items()}
    return Problem(problem.system, y0=start, parameters=parameters, t0=problem.t0, t_end=t_end)
