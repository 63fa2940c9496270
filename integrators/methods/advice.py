"""Which of our methods, and with which step: found by trying them on the beginning of the problem.

Every candidate runs a piece of the trajectory, about 200 steps of `HBVM()` long, and its
positions are compared with those of `HBVM()`, its energies with the first. For fixed steps
the length is then sought at which the error expected at the end meets the accuracy. The
piece's error is carried on to the end by the power of time by which it grew over the second
half of the piece, at least linearly: that is how errors grow where motion is regular. Where
neighbouring trajectories part exponentially, no method keeps the positions; then
the piece itself is what is judged, and the advice says so.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from time import perf_counter
from typing import Annotated, Any

import numpy as np

from integrators.methods.gauss import Gauss
from integrators.methods.hbvm import HBVM, TOLERANCE
from integrators.protocol import Array, MethodBase, Status, check_is_problem
from problems.checks import checked_arguments
from problems.errors import InputError, shown
from problems.problem import Problem

PIECE = 200  # steps of HBVM() that a piece is long
SAMPLES = 64  # states of a piece that are compared
SEARCH = 8  # lengths of steps tried for each method
ROUNDS = 5  # timings of a candidate, of which the fastest counts
SAFETY = 0.3  # the share of the accuracy that an expected error may take: a piece is not the whole
NEIGHBOUR = 1e-9  # relative distance at which a neighbouring trajectory starts
# Growth of its distance beyond which motion counts as irregular, and pieces are halved: if it also is so many
# times as far in the second half as in the first (twice where it grows with time), or as far as this.
APART, STEEP, FAR = 1e4, 10.0, 1e-2
SHORTEST = 12  # steps of a piece
WIDTH = 16.0  # ratio of long to short own steps above which fixed steps are not tried
KEPT = 1e-13  # error of an energy that is kept
FLOOR = 1e-15  # of what positions are known to
NEAR = 30.0  # times that: errors there are rounding errors, or theirs too
TOLERANCES = (1e-6, 1e-8, 1e-10, 1e-12, 1e-14, TOLERANCE)
FIXED = ((2, 2), (4, 4), (6, 6), (8, 8), (8, 4), (16, 8))  # k, s
LONGEST_S = 14  # the degree at which HBVM() works: lengths of steps are first guessed in proportion


@dataclass(frozen=True)
class Proposal:
    """One setting, and what it is expected to do over the problem's whole span.

    Attributes
    ----------
    method : MethodBase
        The setting.
    position : float
        Expected largest error of q (of y, for systems that are not Hamiltonian), relative to the
        largest component there is; at the end of the span, or of the piece for chaotic motion.
    energy : float or None
        Largest relative error of the energy on the piece; ``None`` where there is none.
    seconds : float
        Expected time of computing, without compilation.
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
    """What to take, what else was tried, and why.

    Attributes
    ----------
    problem : Problem
        The problem.
    accuracy : float
        What was asked for.
    proposals : tuple of Proposal
        The settings that are expected to be as accurate as asked, the fastest first; without one,
        the most accurate that was found.
    reached : bool
        Whether the accuracy is expected to be reached at `until`, the time up to which settings were tried.
        What comes after it was not looked at: the errors of the proposals there are extrapolations.
    piece : float
        Time from the start to which everything was tried.
    why : str
        The reasons, in one to four sentences.
    """

    problem: Problem
    accuracy: float
    proposals: tuple[Proposal, ...]
    reached: bool
    piece: float
    why: str

    @property
    def until(self) -> float:
        """The time up to which settings were tried; ``reached`` says nothing of later ones."""
        return self.problem.t0 + self.piece

    @property
    def method(self) -> MethodBase:
        """The first proposal's."""
        return self.proposals[0].method

    def __str__(self) -> str:
        return f"{self.method!r}: {self.why}"


@dataclass(frozen=True)
class _Trial:
    """What a method did on the piece."""

    method: MethodBase
    position: float
    grown: float  # position error of the piece over that of its first half
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
    """Say which method and step reach an accuracy at the end of a problem, and at what cost.

    Parameters
    ----------
    problem : Problem
        What is to be integrated, with its ``t_end``.
    accuracy : float
        Largest error of the positions wanted at ``t_end``, relative to the largest position, in (0, 1).

    Returns
    -------
    Advice
        ``advice.method`` is the method to pass to `integrate`.

    Raises
    ------
    problems.errors.InputError
        For an accuracy outside (0, 1), and where `HBVM` cannot run the problem's beginning.

    Notes
    -----
    Tried are `HBVM` with own steps, and Gauss and HBVM with fixed ones. Expected errors are
    extrapolations: where a close encounter comes after the piece, only methods with own steps
    hold; where the piece shows that step lengths vary much, fixed steps are not tried.

    Examples
    --------
    >>> import problems
    >>> from integrators import advise
    >>> advice = advise(problems.load("kepler", e=0.2), 1e-8)
    >>> advice.reached
    True
    """
    check_is_problem(problem)
    piece = _Piece(problem)
    goal = SAFETY * accuracy
    found = list(_candidates(piece, goal))
    meeting = [one for one in found if piece.expected(one) <= goal]
    kept = meeting or [min(found, key=piece.expected)]
    proposals = tuple(sorted(map(piece.proposal, kept), key=lambda made: made.seconds))
    why = _why(piece, proposals, bool(meeting), accuracy)
    return Advice(problem, accuracy, proposals, bool(meeting), piece.end - problem.t0, why)


class _Piece:
    """The beginning of a trajectory: as `HBVM()` computes it, and as others do."""

    def __init__(self, problem: Problem):
        self.problem = problem
        stepper = HBVM().compile(problem.system).start(problem.y0, problem.par, problem.t0)
        forward = np.sign(problem.t_end - problem.t0)
        lengths: list[float] = []
        while len(lengths) < PIECE and (problem.t_end - stepper.t) * forward > 0.0:
            before = stepper.t
            if stepper.step().failed:
                break
            lengths.append(abs(stepper.t - before))
        if not lengths:
            raise InputError(f"HBVM() takes no step from t0={problem.t0!r}: {stepper.status}.")
        self.end = stepper.t if (problem.t_end - stepper.t) * forward > 0.0 else problem.t_end
        self.timed = self.end
        self.chaotic = False
        while self._parting() and len(lengths) > SHORTEST:
            self.chaotic = True
            lengths = lengths[: len(lengths) // 2]
            self.end = problem.t0 + forward * math.fsum(lengths)
        other = self._states(HBVM(k=16, s=10, tol=TOLERANCE), problem.y0)
        self.floor = max(self._distance(other[0])[0], FLOOR) if other else FLOOR
        self.lengths = np.array(lengths)
        self.whole = abs((problem.t_end - problem.t0) / (self.end - problem.t0))

    def _parting(self) -> bool:
        """Run the piece, and beside it a neighbour; return whether they part exponentially."""
        problem = self.problem
        self.times = np.linspace(problem.t0, self.end, SAMPLES + 1)[1:]
        truth = self._states(HBVM(), problem.y0)
        if truth is None:
            raise InputError(f"HBVM() does not reach t={self.end!r}; integrate to there and see its status.")
        self._truth, self._size = self._positions(truth[0]), float(np.abs(self._positions(truth[0])).max())
        beside = self._states(HBVM(), problem.y0 * (1.0 + NEIGHBOUR * (-1.0) ** np.arange(problem.y0.size)))
        if beside is None:
            return False
        far, early = self._distance(beside[0])
        return far > APART * NEIGHBOUR and (far > STEEP * early or far > FAR)

    @property
    def varying(self) -> bool:
        """Whether own steps differ so much that a fixed one is wasted on most of the way."""
        low, high = np.quantile(self.lengths, [0.02, 0.9])
        return bool(high > WIDTH * low)

    def run(self, method: MethodBase) -> _Trial | None:
        """Return what a method does on the piece; ``None`` where it does not get through."""
        reached = self._states(method, self.problem.y0)
        if reached is None:
            return None
        y, steps = reached
        position, half = self._distance(y)
        grown = position / half if half > 0.0 else 2.0
        errors = self.problem.errors(y, self.times).get("energy")
        energy = None if errors is None else float(np.abs(errors).max())
        return _Trial(method, max(position, self.floor), grown, energy, steps)

    def carried(self, trial: _Trial) -> float:
        """Return by what the piece's error is multiplied on the way to the end."""
        if self.chaotic:
            return 1.0
        least = 1.5 if trial.position < NEAR * self.floor else 1.0  # a walk of the energy is integrated
        return float(self.whole ** np.clip(np.log2(max(trial.grown, 1.0)), least, 2.0))

    def expected(self, trial: _Trial) -> float:
        """Return the error of the position expected at the end; of the piece, for chaotic motion."""
        return trial.position * self.carried(trial)

    def proposal(self, trial: _Trial) -> Proposal:
        """Take the time of a trial and carry all to the end."""
        program = trial.method.compile(self.problem.system)
        times = []
        for _ in range(ROUNDS):
            stepper = program.start(self.problem.y0, self.problem.par, self.problem.t0)
            before = perf_counter()
            stepper.advance(np.array([self.timed]))
            times.append(perf_counter() - before)
        start = self.problem.t0
        return Proposal(
            method=trial.method,
            position=self.expected(trial),
            energy=trial.energy,
            seconds=min(times) * abs((self.problem.t_end - start) / (self.timed - start)),
            steps=math.ceil(trial.steps * self.whole),
        )

    def _states(self, method: MethodBase, y0: Array) -> tuple[Array, int] | None:
        stepper = method.compile(self.problem.system).start(y0, self.problem.par, self.problem.t0)
        samples = stepper.advance(self.times)
        if samples.status is not Status.FINISHED or not np.isfinite(samples.y).all():
            return None
        return samples.y, stepper.stats.steps

    def _positions(self, y: Array) -> Array:
        return y[:, : y.shape[1] // 2] if _has_energy(self.problem) else y

    def _distance(self, y: Array) -> tuple[float, float]:
        """Return the largest error of the positions over the piece, and over its first half."""
        error = np.abs(self._positions(y) - self._truth).max(axis=1) / self._size
        return float(error.max()), float(error[: len(error) // 2].max())


def _has_energy(problem: Problem) -> bool:
    return problem.system.kind != "poisson" and problem.system.energy is not None


def _candidates(piece: _Piece, goal: float) -> Iterator[_Trial]:
    """Yield of each method its longest steps that meet the goal, or else its most accurate setting."""
    for tol in TOLERANCES:  # the loosest first
        trial = piece.run(HBVM(tol=tol))
        if trial is not None and (piece.expected(trial) <= goal or tol == TOLERANCES[-1]):
            yield trial
            break
    if piece.varying:
        return
    for k, s in FIXED:
        if k == s or _has_energy(piece.problem):
            trial = _fixed(piece, goal, k, s)
            if trial is not None:
                yield trial


def _fixed(piece: _Piece, goal: float, k: int, s: int) -> _Trial | None:
    """Seek the longest step of HBVM(k, s) that meets the goal, by its order."""
    h = float(np.median(piece.lengths)) * s / LONGEST_S
    best: _Trial | None = None
    for _ in range(SEARCH):
        h = float(f"{h:.3g}")
        trial = piece.run(Gauss(s=s, h=h) if k == s else HBVM(k=k, s=s, h=h))
        if trial is None:
            h *= 0.5
            continue
        ratio = goal / piece.expected(trial)
        meets = best is not None and piece.expected(best) <= goal
        if best is None or (trial.steps < best.steps if meets and ratio >= 1.0 else not meets):
            best = trial
        if 1.0 <= ratio < 4.0:
            break
        h *= float(np.clip((0.5 * ratio) ** (0.5 / s), 0.3, 3.0))
    return best


def _why(piece: _Piece, proposals: tuple[Proposal, ...], reached: bool, accuracy: float) -> str:
    """Return the reasons, with how far they were looked for."""
    first = proposals[0]
    end = piece.end if piece.chaotic else piece.problem.t_end
    words = [f"expected to be off by {first.position:.1g} at t={end:g}, and to take {first.seconds:.2g} s"]
    if not reached:
        far = "out of reach" if first.position > accuracy else "hardly to be relied on"
        words[0] += f", the best that was found: {accuracy:g} is {far} in double precision."
    elif len(proposals) > 1:
        words[0] += f", the fastest of {len(proposals)} settings that meet {accuracy:g}."
    else:
        words[0] += f", the only setting that meets {accuracy:g}."
    if end != piece.end:
        words.append(
            f"Settings were tried up to t={piece.end:g}, {100.0 / piece.whole:.2g} % of the span; what comes "
            "later is extrapolated, and wrong where the motion becomes chaotic or an encounter comes."
        )
    keeping = next((one for one in proposals if (one.energy or 0.0) <= KEPT), None)
    if first.energy is not None and first.energy > KEPT and keeping is not None:
        words.append(
            f"Its energy is off by {first.energy:.1g}; {keeping.method!r} keeps it to {keeping.energy:.1g} "
            f"in {keeping.seconds / first.seconds:.2g} times the time."
        )
    if piece.chaotic:
        words.append(
            f"Neighbouring trajectories part exponentially: positions were compared up to t={piece.end:g}, "
            "beyond which no method keeps them for long; what can be kept is the energy."
        )
    elif piece.varying:
        words.append(
            f"Own steps vary by {np.ptp(np.log10(piece.lengths)):.1f} decades, so fixed steps were not tried."
        )
    return " ".join(words)
