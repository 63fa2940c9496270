"""HBVM that chooses everything itself against heyoka's Taylor method: no setting on our side."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median, quantiles

import numpy as np

from hbvm_bench.identity import make_method, make_problem
from hbvm_bench.race import truth
from hbvm_bench.race.accuracy import sample_times
from hbvm_bench.race.contests import chosen
from hbvm_bench.timing import Run
from integrators.protocol import MethodBase, Status
from problems.errors import InputError
from problems.problem import Problem

OURS = "HBVM()"
THEIRS = "Taylor(tol=1e-15)"
INSTEAD = {"sitnikov": "Taylor(tol=1e-15, compact_mode=True)"}
"""Without compact mode heyoka loses the planetoid from the axis: another trajectory."""

GOALS = {"outer_solar_system": 6.0, "sitnikov": 5.0, "kepler": 2.0, "henon_heiles": 1.5}
"""How many times as long the Taylor method should take, declared before it was measured."""


@dataclass(frozen=True)
class Side:
    """One method's errors and samples on one problem.

    Attributes
    ----------
    method : str
        As it prints.
    energy, position : float
        Largest relative error of the energy along the way; geometric mean of the relative
        errors of the positions at the ten times at which the true solution is stored. At
        round-off a single one of them would be a matter of luck.
    steps : int
        Of one run.
    seconds : list of float
        Of processor time per run, one entry per round.
    """

    method: str
    energy: float
    position: float
    steps: int
    seconds: list[float]


@dataclass(frozen=True)
class Duel:
    """What came out on one problem: errors and times of both."""

    problem: str
    goal: float
    ours: Side
    theirs: Side

    @property
    def ratio(self) -> float:
        """Their median over ours."""
        return median(self.theirs.seconds) / median(self.ours.seconds)

    @property
    def quartiles(self) -> tuple[float, float]:
        """Of the ratio within each round."""
        pairs = [b / a for a, b in zip(self.ours.seconds, self.theirs.seconds, strict=True)]
        low, _, high = quantiles(pairs, n=4, method="inclusive")
        return low, high

    @property
    def as_accurate(self) -> bool:
        """Whether neither of our errors is larger."""
        return self.ours.energy <= self.theirs.energy and self.ours.position <= self.theirs.position

    @property
    def reached(self) -> bool:
        """Whether the goal is: fast enough, and as accurate."""
        return self.as_accurate and self.ratio >= self.goal


def duels(
    keys: Sequence[str] = (), rounds: int = 25, tell: Callable[[str], None] = lambda key: None
) -> list[Duel]:
    """Run both methods on each problem, interleaved.

    Parameters
    ----------
    keys : sequence of str
        Of `GOALS`; all by default.
    rounds : int
        Timing samples of each, alternating; at least 2.
    tell : callable
        Called with a key before its problem runs.

    Raises
    ------
    problems.errors.InputError
        For an unknown key, or if an integration does not finish.
    problems.errors.MissingLibraryError
        If heyoka is missing.
    """
    if rounds < 2:
        raise InputError(f"rounds must be at least 2, not {rounds}.")
    found = []
    for contest in chosen(list(keys) or list(GOALS)):
        if contest.key not in GOALS:
            raise InputError(f"{contest.key!r} is not among {', '.join(GOALS)}.")
        tell(contest.key)
        problem = make_problem(contest.problem)
        found.append(_duel(contest.key, problem, rounds))
    return found


def _duel(key: str, problem: Problem, rounds: int) -> Duel:
    true = truth.known(problem)
    methods = [make_method(text) for text in (OURS, INSTEAD.get(key, THEIRS))]
    runs = [Run.of(problem, method) for method in methods]
    errors = [_errors(problem, method, run, true) for method, run in zip(methods, runs, strict=True)]
    seconds: list[list[float]] = [[], []]
    for _ in range(rounds):
        for samples, run in zip(seconds, runs, strict=True):
            samples.append(_seconds(run))
    ours, theirs = (
        Side(repr(method), *error, seconds=samples)
        for method, error, samples in zip(methods, errors, seconds, strict=True)
    )
    return Duel(key, GOALS[key], ours, theirs)


def _seconds(run: Run) -> float:
    """Return the processor's time for one run; other work on the machine does not count."""
    stepper = run.program.start(run.y0, run.par, run.t0)
    start = time.thread_time()
    stepper.advance(np.array([run.t_end]), sample=run.sample)
    return time.thread_time() - start


def _errors(
    problem: Problem, method: MethodBase, run: Run, true: truth.reference.Reference
) -> tuple[float, float, int]:
    """Return the errors of the energy and of the positions, and the number of steps."""
    stepper = run.program.start(run.y0, run.par, run.t0)
    times = np.union1d(sample_times(run.t0, run.t_end, None), true.t[1:])
    samples = stepper.advance(times)
    if samples.status is not Status.FINISHED:
        raise InputError(f"{method!r} did not finish: {samples.reason}")
    energy = float(np.max(problem.errors(samples.y, samples.t)["energy"]))
    positions = [
        truth.position_error(problem, true, float(t), y)
        for t, y in zip(samples.t, samples.y, strict=True)
        if t in true.t[1:]
    ]
    return energy, float(np.exp(np.mean(np.log(positions)))), stepper.stats.steps
