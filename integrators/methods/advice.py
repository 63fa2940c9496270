"""Recommended settings, with their expected errors and cost.

Three settings that are accurate to rounding integrate the whole interval. Their differences measure how far
neighbouring trajectories diverge: no method in double precision determines the positions more accurately.
Every candidate integrates the interval too, and its positions are compared with theirs, its energies with the
initial one. Fixed step sizes are searched for on a piece at the start, about 200 steps of `HBVM()` long, and
then tried on the whole interval. Only if the interval takes longer than `LOOK` seconds is an error
extrapolated to its end: by the power of time with which it grew over the second half of the tested part, at
least linearly, as errors of regular motion grow. Such an accuracy does not count as reached.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from time import perf_counter
from typing import Annotated, Any

import numpy as np

from integrators.methods.gauss import Gauss
from integrators.methods.hbvm import HBVM, TOLERANCE
from integrators.protocol import Array, Destination, MethodBase, Status, offers
from integrators.running.integrate import prepared
from problems.checks import checked_arguments
from problems.errors import InputError, shown
from problems.problem import Problem, check_is_problem

LOOK = 2.0  # seconds that one run of the span may take; what comes later is not looked at
FIRST = 1e-6  # of the span: what is looked at first, without knowing what it costs
PIECE = 200  # steps of HBVM() that a piece is long
SAMPLES = 64  # states that are compared
SHORTEST = 0.02  # of a step of HBVM(): shorter fixed steps are not tried
SEARCH = 8  # lengths of steps tried for each method on the piece, ...
REPEATS = 3  # ... and on the span
ROUNDS = 5  # timings of a candidate, of which the fastest counts
SAFETY = 0.3  # the share of the accuracy that an expected error may take: the samples are not the whole
WIDTH = 16.0  # ratio of long to short adaptive steps above which fixed steps are not tried
KEPT = 1e-13  # error of an energy that is kept
FLOOR = 1e-15  # of what positions are known to
NEAR = 30.0  # times that: errors there are rounding errors, or theirs too
TOLERANCES = (1e-6, 1e-8, 1e-10, 1e-12, 1e-14, TOLERANCE)
ACCURATE = (HBVM(), HBVM(k=16, s=10, tol=TOLERANCE), HBVM(k=16, s=12, tol=TOLERANCE))
FIXED = ((2, 2), (4, 4), (6, 6), (8, 8), (8, 4), (16, 8))  # k, s
LONGEST_S = 14  # the degree at which HBVM() works: lengths of steps are first guessed in proportion


@dataclass(frozen=True)
class Proposal:
    """A setting, with its expected error and cost over the problem's whole interval.

    Attributes
    ----------
    method : MethodBase
        The setting.
    position : float
        Expected largest error of q (of y, for systems that are not Hamiltonian), relative to the
        largest component there is, over the whole integration interval.
    energy : float or None
        Largest relative error of the energy in the tested part; ``None`` for a system without energy.
    seconds : float
        Expected run time, without compilation.
    steps : int
        Expected number of steps.
    """

    method: MethodBase
    position: float
    energy: float | None
    seconds: float
    steps: int


@dataclass(frozen=True)
class Advice:
    """Recommended settings, with their expected errors and cost.

    Attributes
    ----------
    problem : Problem
        The problem.
    accuracy : float
        The requested accuracy.
    proposals : tuple of Proposal
        The settings that are expected to reach the accuracy at the end of the interval, or at `horizon` if
        that is earlier, the fastest first. If there is none, the most accurate setting that was found.
    reached : bool
        Whether the first proposal reached the accuracy at the end of the interval. False if the end was not
        tested.
    until : float
        Time up to which the settings were tested: the end of the interval, unless that takes more than two
        seconds or `HBVM` fails earlier.
    horizon : float
        Time up to which the accuracy can be reached in double precision; not later than `until`.
    why : str
        The reasons, in one to four sentences.
    """

    problem: Problem
    accuracy: float
    proposals: tuple[Proposal, ...]
    reached: bool
    until: float
    horizon: float
    why: str

    @property
    def piece(self) -> float:
        """Time from the start to `until`."""
        return self.until - self.problem.t0

    @property
    def method(self) -> MethodBase:
        """The method of the first proposal."""
        return self.proposals[0].method

    def __str__(self) -> str:
        return f"{self.method!r}: {self.why}"


@dataclass(frozen=True)
class _Trial:
    """What a method did on a part of the trajectory."""

    method: MethodBase
    position: float  # error up to the horizon
    last: float  # error up to the end of the part
    grown: float  # that over the error of its first half
    energy: float | None
    steps: int


class _Accuracy:
    def checked(self, owner: str, name: str, value: Any) -> float:
        if not isinstance(value, (int, float)) or not 0.0 < value < 1.0:
            raise InputError(
                f"the accuracy is a relative error between 0 and 1, not {shown(value)}; 1e-10 is usual."
            )
        return value


@checked_arguments
def advise(problem: Problem, accuracy: Annotated[float, _Accuracy()] = 1e-10) -> Advice:
    """Recommend a method and step size for a requested accuracy, with expected errors and cost.

    Parameters
    ----------
    problem : Problem
        The problem, with its ``t_end``.
    accuracy : float
        Requested error of the positions at ``t_end``, relative to the largest position, in (0, 1).

    Returns
    -------
    Advice
        ``advice.method`` is the method to pass to `integrate`.

    Raises
    ------
    problems.errors.InputError
        For an accuracy outside (0, 1), a problem without an interval, and if `HBVM` fails at its beginning.

    Notes
    -----
    `HBVM` with adaptive step size, and Gauss and HBVM with fixed ones, are tried, each on the whole
    integration interval: some thirty trajectories. If adaptive step sizes vary strongly, fixed ones are not
    tried. The errors are differences from trajectories in double precision, and not smaller than the
    differences between these.

    Examples
    --------
    >>> import problems
    >>> from integrators import advise
    >>> advice = advise(problems.load("kepler", e=0.2), 1e-8)
    >>> advice.reached
    True
    """
    check_is_problem(problem)
    if problem.t_end == problem.t0:
        raise InputError(f"the problem ends at its start, t0={problem.t0!r}; give it a later t_end.")
    goal = SAFETY * accuracy
    scout = _Scout(problem)
    span = _Part(problem, scout.end, goal)
    piece = _Part(problem, scout.piece_end, goal)
    candidates = list(_candidates(scout, span, piece, goal))
    meeting = [candidate for candidate in candidates if span.expected(candidate) <= goal]
    kept = meeting or [min(candidates, key=span.expected)]
    proposals = tuple(
        sorted((span.proposal(candidate, piece) for candidate in kept), key=lambda proposal: proposal.seconds)
    )
    reached = bool(meeting) and span.horizon == problem.t_end
    why = _why(scout, span, proposals, bool(meeting), accuracy)
    return Advice(problem, accuracy, proposals, reached, span.end, span.horizon, why)


class _Scout:
    """How far `HBVM()` gets, and the lengths of its steps on the way."""

    def __init__(self, problem: Problem):
        stepper = _started(problem, HBVM())
        parts, began, t = [np.array([problem.t0])], perf_counter(), problem.t0
        length, count, self.reason = FIRST * (problem.t_end - problem.t0), 0, ""
        while t != problem.t_end and (count < PIECE or perf_counter() < began + LOOK):
            before = perf_counter()
            t = problem.t_end if abs(problem.t_end - t) <= abs(length) else t + length
            samples = stepper.advance(np.array([t]), sample="steps")
            parts.append(samples.t)
            count += samples.t.size
            if samples.status is not Status.FINISHED:
                self.reason = samples.reason
                break
            if perf_counter() - before < LOOK / 16:
                length *= 2.0
        self.end = problem.t_end if t == problem.t_end and not self.reason else stepper.t
        times = np.concatenate(parts)
        times = times[np.append(True, np.diff(times) != 0.0)]
        if times.size < 2:
            raise InputError(f"HBVM() takes no step from t0={problem.t0!r}: {self.reason or stepper.status}")
        self.lengths = np.abs(np.diff(times))
        self.piece_end = float(times[PIECE]) if times.size > PIECE + 1 else self.end

    @property
    def varying(self) -> bool:
        """Whether adaptive steps differ so much that a fixed one is wasted on most of the way."""
        low, high = np.quantile(self.lengths, [0.02, 0.9])
        return bool(high > WIDTH * low)


class _Part:
    """A trajectory up to a time: as the accurate settings compute it, and as others do.

    Attributes
    ----------
    end : float
        The time.
    floor : ndarray, shape (m,)
        At each of the samples, how far the accurate settings have differed up to there.
    known : int
        The samples on which settings are judged: those where the floor is below the goal, or all.
    horizon : float
        The time of the last sample whose floor is below the goal.
    """

    def __init__(self, problem: Problem, end: float, goal: float):
        self.problem, self.end = problem, end
        self.times = np.linspace(problem.t0, end, SAMPLES + 1)[1:]
        states = [self._states(method) for method in ACCURATE]
        there = [self._positions(first[0]) for first in states if first is not None]
        if not there:
            raise InputError(f"HBVM() does not reach t={end!r}; integrate to there and see its status.")
        self._truth, self._size = there[0], float(np.abs(there[0]).max()) or 1.0
        apart = [self._distance(first, other) for first, other in combinations(there, 2)]
        self.floor = np.maximum(np.max(apart, axis=0), FLOOR) if apart else np.full(SAMPLES, np.inf)
        within = int(np.count_nonzero(self.floor <= goal))
        self.known = within or SAMPLES
        self.horizon = float(self.times[within - 1]) if within else problem.t0
        self.whole = abs((problem.t_end - problem.t0) / (end - problem.t0))

    def run(self, method: MethodBase) -> _Trial | None:
        """Return what a method does; ``None`` where it does not get through."""
        reached = self._states(method)
        if reached is None:
            return None
        y, steps = reached
        error = np.maximum(self._distance(self._positions(y), self._truth), self.floor)
        errors = self.problem.errors(y, self.times).get("energy")
        return _Trial(
            method,
            position=float(error[self.known - 1]),
            last=float(error[-1]),
            grown=float(error[-1] / error[SAMPLES // 2 - 1]),
            energy=None if errors is None else float(np.abs(errors).max()),
            steps=steps,
        )

    def carried(self, trial: _Trial) -> float:
        """Return by what an error is multiplied on the way from here to the problem's end."""
        if self.whole == 1.0:
            return 1.0
        least = 1.5 if trial.last < NEAR * FLOOR else 1.0  # a random walk of the energy is integrated
        return float(self.whole ** np.clip(np.log2(max(trial.grown, 1.0)), least, 2.0))

    def expected(self, trial: _Trial) -> float:
        """Return the error of the position by which a setting is judged: at the end, or at the horizon."""
        return trial.position * (self.carried(trial) if self.known == SAMPLES else 1.0)

    def proposal(self, trial: _Trial, piece: "_Part") -> Proposal:
        """Take the time of a trial, on a piece."""
        times, steps = [], 1
        for _ in range(ROUNDS):
            stepper = _started(self.problem, trial.method)
            before = perf_counter()
            stepper.advance(np.array([piece.end]))
            times.append(perf_counter() - before)
            steps = max(1, stepper.stats.steps)
        return Proposal(
            method=trial.method,
            position=trial.last * self.carried(trial),
            energy=trial.energy,
            seconds=min(times) * trial.steps * self.whole / steps,
            steps=math.ceil(trial.steps * self.whole),
        )

    def _states(self, method: MethodBase) -> tuple[Array, int] | None:
        stepper = _started(self.problem, method)
        samples = stepper.advance(self.times)
        if samples.status is not Status.FINISHED or not np.isfinite(samples.y).all():
            return None
        return samples.y, stepper.stats.steps

    def _positions(self, y: Array) -> Array:
        return y[:, : y.shape[1] // 2] if _has_energy(self.problem) else y

    def _distance(self, first: Array, other: Array) -> Array:
        """Return the largest distance up to each sample, relative to the largest component there is."""
        return np.maximum.accumulate(np.abs(first - other).max(axis=1) / self._size)


def _started(problem: Problem, method: MethodBase) -> Any:
    """Return a stepper at the start that takes the steps that `integrate` takes to the problem's end."""
    program, _ = prepared(method, problem.system)
    stepper: Any = program.start(problem.y0, problem.par, problem.t0)
    if offers(stepper, Destination):
        stepper.destination = problem.t_end
    return stepper


def _has_energy(problem: Problem) -> bool:
    return problem.system.kind != "poisson" and problem.system.energy is not None


def _candidates(scout: _Scout, span: _Part, piece: _Part, goal: float) -> Iterator[_Trial]:
    """Yield of each method its longest steps that meet the goal, or else its most accurate setting."""
    carried = 1.0
    for tol in TOLERANCES:  # the loosest first
        trial = span.run(HBVM(tol=tol))
        if trial is not None and (span.expected(trial) <= goal or tol == TOLERANCES[-1]):
            beginning = piece.run(trial.method)
            carried = max(1.0, trial.position / beginning.position) if beginning else 1.0
            yield trial
            break
    if scout.varying or goal < span.floor[span.known - 1]:
        return
    typical = float(np.median(scout.lengths))
    for k, s in FIXED:
        if k == s or _has_energy(span.problem):
            h = typical * s / LONGEST_S
            first = _longest(piece, goal / carried, k, s, h, typical * SHORTEST, SEARCH)
            if first is not None and span.end != piece.end:
                h = float(first.method.options()["h"])
                first = _longest(span, goal, k, s, h, typical * SHORTEST, REPEATS)
            if first is not None:
                yield first


def _longest(
    part: _Part, goal: float, k: int, s: int, h: float, shortest: float, attempts: int
) -> _Trial | None:
    """Seek the longest step of HBVM(k, s) that meets the goal, by its order."""
    best: _Trial | None = None
    for _ in range(attempts):
        h = float(f"{h:.3g}")
        if h < shortest:
            break
        trial = part.run(Gauss(s=s, h=h) if k == s else HBVM(k=k, s=s, h=h))
        if trial is None:
            h *= 0.5
            continue
        ratio = goal / part.expected(trial)
        meets = best is not None and part.expected(best) <= goal
        if best is None or (trial.steps < best.steps if meets and ratio >= 1.0 else not meets):
            best = trial
        if 1.0 <= ratio < 4.0:
            break
        h *= float(np.clip((0.5 * ratio) ** (0.5 / s), 0.3, 3.0))
    return best


def _why(scout: _Scout, span: _Part, proposals: tuple[Proposal, ...], met: bool, accuracy: float) -> str:
    """Return the reasons, with how far they were looked for."""
    first, end = proposals[0], span.problem.t_end
    words = [f"expected to be off by {first.position:.1g} at t={end:g}, and to take {first.seconds:.2g} s"]
    if not met:
        far = "out of reach" if first.position > accuracy else "hardly to be relied on"
        words[0] += f", the best that was found: {accuracy:g} is {far} in double precision."
    else:
        where = "" if span.horizon == end else f" up to t={span.horizon:g}"
        others = f"fastest of {len(proposals)} settings that meet"
        words[0] += (
            f", the {others if len(proposals) > 1 else 'only setting that meets'} {accuracy:g}{where}."
        )
    if span.end != end:
        words.append(
            f"{scout.reason or 'That takes long.'} Settings were tried up to t={span.end:g}, "
            f"{100.0 / span.whole:.2g} % of the integration interval; what comes "
            "later is extrapolated, and wrong where the motion becomes chaotic or an encounter comes."
        )
    keeping = next((proposal for proposal in proposals if (proposal.energy or 0.0) <= KEPT), None)
    if first.energy is not None and first.energy > KEPT and keeping is not None:
        words.append(
            f"Its energy is off by {first.energy:.1g}; {keeping.method!r} keeps it to {keeping.energy:.1g} "
            f"in {keeping.seconds / first.seconds:.2g} times the time."
        )
    if met and span.horizon != span.end:
        words.append(
            "Neighbouring trajectories diverge: settings that are accurate to rounding differ by more than "
            f"{SAFETY * accuracy:.1g} after t={span.horizon:g}, by {span.floor[-1]:.1g} at t={span.end:g}."
        )
    elif scout.varying:
        words.append(
            f"Adaptive steps vary by {np.ptp(np.log10(scout.lengths)):.1f} decades, so fixed steps were not "
            "tried."
        )
    return " ".join(words)
