"""HBVM that chooses everything itself against heyoka's Taylor method: no setting on our side.

``python -m hbvm_bench.studies.automatic.runs REQUEST.json`` measures. Results of several kinds of
processor lie side by side, one file each::

    DIR/<kind>.json     e.g. znver4-256bit.json, znver4-256bit-avx2.json
    DIR/README.md       all of them, one column for each kind, and index.html the same
"""

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import version
from pathlib import Path

import msgspec
import numpy as np

from hbvm_bench.campaign.identity import make_method, make_problem
from hbvm_bench.measure import machine
from hbvm_bench.measure.timing import Run, Spread, interleaved
from hbvm_bench.measure.timing import ratios as per_round
from hbvm_bench.run import processes
from hbvm_bench.store.files import ensure_writable, write_json
from hbvm_bench.store.records import decoded
from hbvm_bench.studies.race import truth
from hbvm_bench.studies.race.accuracy import sample_times
from hbvm_bench.studies.race.contests import chosen
from integrators.protocol import MethodBase, Status
from problems.errors import InputError
from problems.problem import Problem

OURS = "HBVM()"
THEIRS = "Taylor(tol=1e-15)"

GOALS = {"outer_solar_system": 6.0, "sitnikov": 5.0, "kepler": 2.0, "henon_heiles": 1.5}
"""How many times as long the Taylor method should take, declared before it was measured."""


SCHEMA = 2
LIBRARIES = ("hbvm-bench", "numpy", "numba", "heyoka")


@dataclass(frozen=True)
class Side:
    """One method's errors and samples on one problem.

    Attributes
    ----------
    method : str
        As it prints.
    energy, position : float
        Largest relative error of the energy along the way; geometric mean of the position
        errors (`hbvm_bench.measure.measured.POSITION`) at the ten times at which the true solution is
        stored. At round-off a single one of them would be a matter of luck.
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
    def ratio(self) -> Spread:
        """Their time over ours within each round."""
        return Spread.of(per_round(self.theirs.seconds, self.ours.seconds))

    @property
    def as_accurate(self) -> bool:
        """Whether neither of our errors is larger."""
        return self.ours.energy <= self.theirs.energy and self.ours.position <= self.theirs.position

    @property
    def verdict(self) -> str:
        """``reached``, ``missed``, or ``not as accurate``."""
        return "reached" if self.reached else "missed" if self.as_accurate else "not as accurate"

    @property
    def reached(self) -> bool:
        """Whether the goal is: fast enough, and as accurate."""
        return self.as_accurate and self.ratio.median >= self.goal


class Result(msgspec.Struct, frozen=True, kw_only=True):
    """What one run of the command measured.

    Attributes
    ----------
    duels : list of Duel
        One per problem.
    machine, versions : dict
        Where and with what.
    command, started : str
        How to run it again, and when it ran.
    """

    duels: list[Duel]
    machine: dict[str, str | int]
    versions: dict[str, str]
    command: str
    started: str


class Kept(msgspec.Struct, frozen=True, kw_only=True):
    """What was measured on one kind of processor: no problem twice, each with the run it came from."""

    runs: list[Result]
    schema: int = SCHEMA


class Request(msgspec.Struct, frozen=True, kw_only=True):
    """What the measuring process is asked to do, and where its `Result` goes."""

    problems: list[str]
    rounds: int
    command: str
    out: str


def main(path: Path) -> int:
    """Run a request; return the exit code, 2 after an error that a user can mend."""
    described = machine.describe(measure=True)
    processes.settle()
    request = msgspec.json.decode(path.read_bytes(), type=Request)
    started = datetime.now(UTC).isoformat(timespec="seconds")
    try:
        found = duels(request.problems, request.rounds, lambda key: print(f"running {key}", file=sys.stderr))
    except InputError as error:
        print(f"hbvm-bench: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    result = Result(
        duels=found,
        machine=described,
        versions={name: version(name) for name in LIBRARIES},
        command=request.command,
        started=started,
    )
    save([result], Path(request.out))
    return 0


def save(results: Sequence[Result], path: Path) -> None:
    """Write results of one kind of processor, all of them or nothing."""
    write_json(path, Kept(runs=list(results)))


def load(path: Path) -> list[Result]:
    """Read the results of one kind of processor, in the order in which they were measured.

    Raises
    ------
    problems.errors.InputError
        If the file is something else.
    """
    try:
        kept = decoded(path.read_bytes(), Kept)
    except (OSError, msgspec.MsgspecError, ValueError) as error:
        raise InputError(f"{str(path)!r} is not the result of automatic: {error}.") from None
    if kept.schema != SCHEMA:
        raise InputError(f"{str(path)!r} was written by another version; run automatic again.")
    return kept.runs


def keep(result: Result, directory: Path) -> None:
    """Write a result beside those of other kinds of processor.

    Problems that were not run this time are kept from the file of the same kind, with the
    machine, the versions, the command and the date that they were measured with.

    Raises
    ------
    problems.errors.InputError
        If the directory cannot be written, or what lies there is no result.
    """
    ensure_writable(directory)
    path = directory / f"{machine.kind(result.machine)}.json"
    again = {duel.problem for duel in result.duels}
    old = [
        msgspec.structs.replace(one, duels=[duel for duel in one.duels if duel.problem not in again])
        for one in (load(path) if path.is_file() else [])
    ]
    save([*(one for one in old if one.duels), result], path)


def by_kind(directory: Path) -> dict[str, list[Result]]:
    """Return the results in a directory by the kind of processor."""
    return {path.stem: load(path) for path in sorted(directory.glob("*.json"))}


def asked(keys: Sequence[str], rounds: int) -> list[str]:
    """Return the problems to run, checked; all for none.

    Raises
    ------
    problems.errors.InputError
        For an unknown key, or fewer than two rounds.
    """
    if rounds < 2:
        raise InputError(f"rounds must be at least 2, not {rounds}.")
    found = [contest.key for contest in chosen(list(keys) or list(GOALS))]
    for key in found:
        if key not in GOALS:
            raise InputError(f"{key!r} is not among {', '.join(GOALS)}.")
    return found


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
    found = []
    for contest in chosen(asked(keys, rounds)):
        tell(contest.key)
        problem = make_problem(contest.problem)
        found.append(_duel(contest.key, problem, rounds))
    return found


def _duel(key: str, problem: Problem, rounds: int) -> Duel:
    true = truth.known(problem)
    methods = [make_method(text) for text in (OURS, THEIRS)]
    runs = [Run.of(problem, method) for method in methods]
    errors = [_errors(problem, method, run, true) for method, run in zip(methods, runs, strict=True)]

    def sample(i: int) -> float:
        spent, reached = runs[i].seconds(clock=time.thread_time)
        if reached.status is not Status.FINISHED:
            raise InputError(f"{methods[i]!r} did not finish: {reached.reason}")
        return spent

    theirs, ours = interleaved([partial(sample, 1), partial(sample, 0)], rounds)
    ours, theirs = (
        Side(repr(method), *error, seconds=samples)
        for method, error, samples in zip(methods, errors, (ours, theirs), strict=True)
    )
    return Duel(key, GOALS[key], ours, theirs)


def _errors(
    problem: Problem, method: MethodBase, run: Run, true: truth.reference.Reference
) -> tuple[float, float, int]:
    """Return the errors of the energy and of the positions, and the number of steps."""
    stepper = run.program.start(run.y0, run.par, run.t0)
    times = np.union1d(sample_times(run.t0, run.t_end, None), true.t[1:])
    samples = stepper.advance(times)
    if samples.status is not Status.FINISHED:
        raise InputError(f"{method!r} did not finish: {samples.reason}")
    for name, values in problem.guards(samples.y, samples.t).items():
        if np.any(values):  # its times and errors would be of another trajectory
            raise InputError(f"{method!r} loses what a symmetry of {problem.system.name} keeps at 0: {name}.")
    energy = float(np.max(problem.errors(samples.y, samples.t)["energy"]))
    positions = [
        truth.position_error(problem, true, float(t), y)
        for t, y in zip(samples.t, samples.y, strict=True)
        if t in true.t[1:]
    ]
    return energy, float(np.exp(np.mean(np.log(positions)))), stepper.stats.steps


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
