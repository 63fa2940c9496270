"""What a race leaves behind: plain, typed, JSON; reports are drawn from it without running anything.

::

    DIR/<contest>.json      one file per contest, written when it has ended
"""

from pathlib import Path
from statistics import median

import msgspec

from hbvm_bench.measure import machine
from hbvm_bench.measure.timing import Spread
from hbvm_bench.store.files import ensure_writable, write_json
from hbvm_bench.store.records import decoded
from problems.errors import InputError

SCHEMA = 2
READABLE = (1, SCHEMA)  # 1 had another definition of the position error

# The accuracy at which times are compared first.
ENERGY = 1e-13
POSITION = 1e-10


class Goal(msgspec.Struct, frozen=True, kw_only=True):
    """A ratio that the project set itself, declared before it was measured.

    Attributes
    ----------
    family : str
        The peer.
    ratio : float
        Its best time over ours, at least.
    energy, position : float
        Errors that both may have at most; without a position ours may have no
        larger a position error than the peer's best.
    """

    family: str
    ratio: float
    energy: float = ENERGY
    position: float | None = POSITION


class Contest(msgspec.Struct, frozen=True, kw_only=True):
    """One problem of the race, declared before the run.

    Attributes
    ----------
    key, title : str
        A file name; a line for readers.
    problem : str
        As `hbvm_bench.campaign.spec` reads it; its ``t_end`` is the span.
    energy, position : float
        The errors at which times are compared first.
    goals : tuple of Goal
        What the project set itself.
    note : str
        What to know when reading the numbers.
    """

    key: str
    title: str
    problem: str
    energy: float = ENERGY
    position: float = POSITION
    goals: tuple[Goal, ...] = ()
    note: str = ""


class Setting(msgspec.Struct, frozen=True, kw_only=True):
    """One method with its options, declared before the run.

    Attributes
    ----------
    family : str
        Key of `hbvm_bench.studies.race.settings.FAMILIES`.
    method : str
        As it prints.
    default : bool
        Whether these are the library's own defaults.
    """

    family: str
    method: str
    default: bool = False


class Outcome(msgspec.Struct, frozen=True, kw_only=True):
    """What one setting did.

    Attributes
    ----------
    setting : Setting
        Which.
    status : str
        ``"finished"``, the integration's own status, ``"refused"`` or ``"crashed"``.
    reason : str
        One sentence where it did not finish.
    void : str
        Why its errors and times must not be compared (another trajectory); else empty.
    energy : float or None
        Largest relative error of the energy over the samples and at the end.
    position : float or None
        Error of the positions at the end; see `hbvm_bench.measure.measured.POSITION`.
    guard : float or None
        Largest value of what a symmetry keeps at 0, where the problem has such.
    samples : int
        States at which the energy was evaluated.
    steps, rejections, evaluations, iterations : int or None
        Of one run.
    solver : str or None
        The nonlinear solver.
    caveat : str
        What the method's authors or its adapter say about this problem.
    compile_seconds, from_cache
        Of this process; see `Probe` for cold and cached.
    call_seconds : float or None
        What a call that goes next to nowhere takes (one step included): the overhead
        in each run is at most this.
    repeats : int
        Runs in one timing sample.
    seconds : list of float or None
        Seconds per run, one entry per round; ``None`` in rounds it was left out of.
    untimed : str
        Why there are no samples, or fewer than rounds.
    """

    setting: Setting
    status: str
    reason: str = ""
    void: str = ""
    energy: float | None = None
    position: float | None = None
    guard: float | None = None
    samples: int = 0
    steps: int | None = None
    rejections: int | None = None
    evaluations: int | None = None
    iterations: int | None = None
    solver: str | None = None
    caveat: str = ""
    compile_seconds: float | None = None
    from_cache: bool | None = None
    call_seconds: float | None = None
    repeats: int = 0
    seconds: list[float | None] = []
    untimed: str = ""

    @property
    def taken(self) -> list[float]:
        """The samples that were taken."""
        return [value for value in self.seconds if value is not None]

    @property
    def median(self) -> float | None:
        """Median seconds of a run."""
        return median(self.taken) if self.taken else None

    @property
    def time(self) -> Spread | None:
        """The same with its quartiles."""
        return Spread.of(self.taken) if self.taken else None

    @property
    def counts(self) -> bool:
        """Whether it may be compared: finished, on the trajectory that was asked for, and timed."""
        return (
            self.status == "finished"
            and not self.void
            and bool(self.taken)
            and self.energy is not None
            and self.position is not None
        )


class Probe(msgspec.Struct, frozen=True, kw_only=True):
    """What a fresh process pays before its first result.

    Attributes
    ----------
    family, method : str
        Of the setting that was compiled.
    caches : {"empty", "kernel", "full"}
        What was on disk before: nothing; our kernel but not this problem; everything.
    compile_seconds : list of float
        The method's own ``compile``.
    process_seconds : list of float
        From the start of Python to the first integrated state, imports included.
    from_cache : bool or None
        What the method says of the compilation.
    reason : str
        Why there are no seconds.
    """

    family: str
    method: str
    caches: str
    compile_seconds: list[float] = []
    process_seconds: list[float] = []
    from_cache: bool | None = None
    reason: str = ""


class Load(msgspec.Struct, frozen=True, kw_only=True):
    """What else went on while the times were taken, as shares of one core's time.

    Attributes
    ----------
    others : float
        Other processes of this machine, over all cores.
    stolen : float
        Time that the machine's host kept to itself.
    """

    others: float
    stolen: float


class Race(msgspec.Struct, frozen=True, kw_only=True):
    """The result of one contest.

    Attributes
    ----------
    contest : Contest
        What was declared.
    t_end : float
        The span that was run.
    quick : bool
        Whether it was the short run.
    outcomes : list of Outcome
        One per setting, in the order of declaration.
    rounds : int
        Interleaved rounds of timing.
    calibration : list of float
        Seconds of a fixed computation, one per round.
    probes : list of Probe
        Compile times; empty where they were not measured.
    reference : dict of str
        Where the true end state comes from.
    load : Load or None
        What else the machine did.
    machine, versions : dict
        Where and with what.
    command, started : str
        How to run it again, and when it ran.
    seconds : float
        That it took.
    """

    contest: Contest
    t_end: float
    quick: bool
    outcomes: list[Outcome]
    rounds: int
    calibration: list[float]
    reference: dict[str, str]
    machine: dict[str, str | int]
    versions: dict[str, str]
    command: str
    started: str
    seconds: float
    probes: list[Probe] = []
    load: Load | None = None
    schema: int = SCHEMA


def save(race: Race, directory: Path) -> Path:
    """Write the result of a contest, all of it or nothing, and return its path."""
    ensure_writable(directory)
    target = directory / f"{race.contest.key}.json"
    write_json(target, race)
    return target


def load(directory: Path, order: list[str]) -> list[Race]:
    """Read the results in a directory, in the given order of contests.

    Raises
    ------
    problems.errors.InputError
        If there are none, or a file is not a result.
    """
    found = _in(directory, order)
    if not found:
        raise InputError(
            f"there is no result of a race in {str(directory)!r}; run: hbvm-bench race --out DIR."
        )
    return found


def by_kind(directory: Path, order: list[str]) -> dict[str, list[Race]]:
    """Read the results in a directory and in the directories in it, by the kind of processor.

    Several kinds lie side by side as ``DIR/*.json`` and ``DIR/<kind>/*.json``. Of two results of
    one contest on one kind the outer directory's counts.

    Raises
    ------
    problems.errors.InputError
        If a file is not a result.
    """
    found: dict[str, list[Race]] = {}
    for folder in [directory, *sorted(path for path in directory.glob("*") if path.is_dir())]:
        for race in _in(folder, order):
            of_kind = found.setdefault(machine.kind(race.machine), [])
            if race.contest.key not in {one.contest.key for one in of_kind}:
                of_kind.append(race)
    return found


def _in(directory: Path, order: list[str]) -> list[Race]:
    found: list[Race] = []
    for key in order:
        path = directory / f"{key}.json"
        if not path.is_file():
            continue
        try:
            race = decoded(path.read_bytes(), Race)
        except (msgspec.MsgspecError, ValueError) as error:
            raise InputError(f"{str(path)!r} is not the result of a race: {error}.") from None
        if race.schema not in READABLE:
            raise InputError(f"{str(path)!r} was written by another version; run the race again.")
        if race.contest.key != key:  # files are named after it
            raise InputError(f"{str(path)!r} is the result of another contest, {race.contest.key!r}.")
        found.append(race)
    return found
