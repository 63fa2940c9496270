"""One setting on one problem: compiled, run with samples for its errors, run bare for its end state."""

from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from hbvm_bench.campaign.grid import GOLDEN
from hbvm_bench.campaign.identity import make_method
from hbvm_bench.measure.measured import largest_distance, positions
from hbvm_bench.measure.metrics import GUARD_TOLERANCE
from hbvm_bench.measure.timing import Run
from hbvm_bench.reference.solutions import Reference
from hbvm_bench.studies.race import truth
from hbvm_bench.studies.race.results import Outcome, Setting
from hbvm_bench.studies.race.settings import FAMILIES
from integrators.protocol import MethodBase, Samples, Status
from problems.errors import InputError
from problems.problem import Problem

Array = NDArray[np.float64]

SAMPLES = 400
NOWHERE = 1e-9  # of the span
CALLS = 20


@dataclass(frozen=True, eq=False)
class Entry:
    """A setting that has run: what came out, and what to time.

    Attributes
    ----------
    outcome : Outcome
        Without timings yet.
    run : Run or None
        ``None`` where there is nothing to time.
    first : float
        Seconds of the first bare run.
    """

    outcome: Outcome
    run: Run | None
    first: float


def sample_times(t0: float, t_end: float, h: float | None) -> Array:
    """Return the times at which the energy is looked at: one in each of `SAMPLES` equal parts of the span.

    Where in its part follows the golden ratio, so that no period of the motion is met at
    the same phase again and again. For a fixed step these times are moved to the nearest
    own step, so that sampling costs the method nothing in quality.

    Parameters
    ----------
    t0, t_end : float
        The span, ``t_end > t0``.
    h : float or None
        The fixed step.
    """
    number = np.arange(SAMPLES)
    share = (number + (number * GOLDEN) % 1.0) / SAMPLES
    share[-1] = 1.0
    if h is None:
        return np.unique(t0 + (t_end - t0) * share)
    steps = np.unique(np.rint((t_end - t0) * share / h))
    own = t0 + h * steps[(steps > 0) & (t0 + h * steps <= t_end)]
    return own if own.size else np.array([t_end])


def prepare(problem: Problem, setting: Setting, true: Reference, t_end: float) -> Entry:
    """Compile and run a setting; whatever happens is an outcome.

    Parameters
    ----------
    problem : Problem
        Of the contest.
    setting : Setting
        What to run.
    true : Reference
        The true solution, which contains ``t_end``.
    t_end : float
        End of the run.
    """
    try:
        method = make_method(setting.method)
        if reason := method.accepts(problem):
            return _nothing(setting, "refused", reason)
        return _measured(problem, setting, method, Run.of(problem, method, t_end=t_end), true)
    except InputError as error:  # a missing library among them
        return _nothing(setting, "refused", str(error))
    except Exception as error:  # a peer's adapter may raise anything; the race goes on
        return _nothing(setting, "crashed", f"{type(error).__name__}: {error}")


def _measured(problem: Problem, setting: Setting, method: MethodBase, run: Run, true: Reference) -> Entry:
    fixed = FAMILIES[setting.family].fixed
    times = sample_times(run.t0, run.t_end, getattr(method, "h", None) if fixed else None)
    stepper = run.program.start(run.y0, run.par, run.t0)
    samples = stepper.advance(times)
    if samples.status is not Status.FINISHED:
        return _nothing(setting, samples.status.value, samples.reason)
    stats = stepper.stats
    first, end = run.seconds()
    call, _ = run.until(NOWHERE).seconds(CALLS)
    if end.status is not Status.FINISHED:
        return _nothing(setting, end.status.value, end.reason)
    outcome = Outcome(
        setting=setting,
        status=Status.FINISHED.value,
        samples=int(samples.t.size),
        steps=stats.steps,
        rejections=stats.rejections,
        evaluations=stats.evaluations,
        iterations=stats.iterations,
        solver=stats.solver,
        caveat=method.caveat(problem) or "",
        compile_seconds=float(run.program.compile_seconds),
        from_cache=run.program.from_cache,
        call_seconds=call,
    )
    return Entry(_with_errors(outcome, problem, samples, end, true), run, first)


def _with_errors(
    outcome: Outcome, problem: Problem, samples: Samples, end: Samples, true: Reference
) -> Outcome:
    t, y = np.append(samples.t, end.t[-1]), np.vstack([samples.y, end.y[-1]])
    with np.errstate(all="ignore"):
        energy = float(np.max(next(iter(problem.errors(y, t).values()))))
        guards = problem.guards(y, t)
        size = float(np.max(largest_distance(problem, positions(problem, y))))
    guard, void = None, ""
    for name, values in guards.items():
        worst = float(np.max(np.abs(values)))
        guard = max(worst, guard or 0.0)
        if not worst <= GUARD_TOLERANCE * size:
            void = f"another trajectory: {name.replace('_', ' ')} reached {worst:.2g} instead of 0"
    position = truth.position_error(problem, true, float(end.t[-1]), end.y[-1])
    if not (np.isfinite(energy) and np.isfinite(position)):
        void = void or "its error is not a finite number"
    return msgspec.structs.replace(
        outcome,
        energy=energy if np.isfinite(energy) else None,
        position=position if np.isfinite(position) else None,
        guard=guard,
        void=void,
    )


def _nothing(setting: Setting, status: str, reason: str) -> Entry:
    return Entry(Outcome(setting=setting, status=status, reason=reason), None, 0.0)
