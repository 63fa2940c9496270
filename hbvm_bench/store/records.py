"""What the store keeps of a case: plain, typed, JSON.

Not-a-number and infinity never enter a record: a value that does not exist is
``None`` with a sentence saying why.
"""

import math
from collections.abc import Sequence
from contextlib import suppress
from datetime import datetime
from statistics import median, quantiles
from typing import Any, Literal, TypeVar

import msgspec

from hbvm_bench.campaign.entries import Limits, Role, TimingPlan
from hbvm_bench.campaign.file import Case
from problems.errors import printable

T = TypeVar("T")
OTHER_WORK = 0.1  # of a core: with more beside the times these are doubtful, and no speed is judged
COMPILING = "compiling"  # the status of a timeout before a case began
DIED = "died"  # the status of a case whose process ended without an answer: it says nothing final of the case

Outcome = Literal["ok", "stalled", "timeout", "killed", "crashed", "refused"]


def decoded(content: bytes, type_: type[T]) -> T:
    """Read JSON that somebody else may have written: its texts lose the characters that command a terminal.

    Raises
    ------
    msgspec.MsgspecError
        If it is no JSON, or not that of the type.
    ValueError
        If it is no UTF-8, or nested too deeply.
    """
    with suppress(ValueError):  # nearly always, and ten times as fast
        text = content.decode()
        if "\\u" not in text and printable(text) == text:
            return msgspec.json.decode(text, type=type_)
    try:
        return msgspec.convert(_printable(msgspec.json.decode(content)), type_)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def _printable(value: Any) -> Any:
    match value:
        case str():
            return printable(value)
        case list():
            return [_printable(item) for item in value]
        case dict():
            return {printable(key): _printable(item) for key, item in value.items()}
    return value


class Value(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One metric of one case.

    Attributes
    ----------
    value : float or None
        The number; ``None`` where there is none.
    excluded : bool
        Whether the number exists but must not be compared.
    why : str
        Why there is no number, or why it is excluded.
    """

    value: float | None = None
    excluded: bool = msgspec.field(default=False, name="void")
    why: str = ""

    def __post_init__(self) -> None:
        if self.value is not None and not math.isfinite(self.value):
            raise ValueError(f"a metric must be finite, not {self.value!r}")

    @property
    def counts(self) -> bool:
        """Whether the number may be compared with other cases'."""
        return self.value is not None and not self.excluded


class Compile(msgspec.Struct, frozen=True, kw_only=True):
    """Seconds of one compilation, and whether it came from a cache (``None``: nothing to compile)."""

    seconds: float
    cached: bool | None


class TimingRound(msgspec.Struct, frozen=True, kw_only=True):
    """What one visit of the timing pass measured, in a process of its own.

    Attributes
    ----------
    samples : list of float
        Seconds per whole integration.
    repeats : int
        Integrations in one sample.
    compile : Compile
        The compilation in this process.
    calibration : list of float
        Seconds of the calibration loop before each sample and after the last.
    number : int or None
        Of the interleaved round, from 0; ``None`` for a visit by itself.
    compilation : int
        Of interleaved rounds: which of the plan's processes, each with a compilation of its own.
    """

    samples: list[float]
    repeats: int
    compile: Compile
    calibration: list[float] = []
    number: int | None = None
    compilation: int = 0

    def __post_init__(self) -> None:
        if not self.samples or not all(0.0 < s < math.inf for s in [*self.samples, *self.calibration]):
            raise ValueError("a timing has samples, and all of them are positive")

    @property
    def calibrated(self) -> list[float]:
        """Return the samples in units of the calibration loop; empty where it was not taken."""
        return [sample / median(self.calibration) for sample in self.samples] if self.calibration else []


class Load(msgspec.Struct, frozen=True, kw_only=True):
    """What else went on while interleaved times were taken, as shares of one core's time.

    Attributes
    ----------
    others : float
        Other processes of this machine, over all cores.
    steal : float
        Steal time: CPU time that the machine's host gave to others.
    """

    others: float
    steal: float = msgspec.field(name="stolen")

    @property
    def most(self) -> float:
        """The larger of the two."""
        return max(self.others, self.steal)

    def verdict(self) -> str:
        """Return why times beside this load are not judged; ``""`` where they are."""
        return f"other work took {self.most:.0%} of a core" if self.most > OTHER_WORK else ""


class Timing(msgspec.Struct, frozen=True, kw_only=True):
    """All samples of the timing pass; nothing is thrown away.

    Attributes
    ----------
    rounds : list of TimingRound
        Round by round.
    why : str
        Why there are none, or fewer than planned.
    plan : TimingPlan or None
        Under which rules; ``None`` where an earlier version took them, and did not say.
    machine : dict
        Where all the rounds were taken; the case may have been measured on another one.
    process : str
        What the cases share that one process timed in turn, whose rounds belong together.
    call : float or None
        Seconds of a call that goes next to nowhere (one step included): the overhead in each
        run is at most this. Of interleaved times only, as is the next.
    load : Load or None
        What else the machine did; ``None`` where it does not tell.
    """

    rounds: list[TimingRound] = []
    why: str = ""
    plan: TimingPlan | None = None
    machine: dict[str, str | int] = {}
    process: str = ""
    call: float | None = None
    load: Load | None = None

    @property
    def samples(self) -> list[float]:
        return [sample for round_ in self.rounds for sample in round_.samples]

    @property
    def summary(self) -> dict[str, float]:
        """Return ``median``, ``min``, ``q1``, ``q3`` in seconds; empty without samples."""
        samples = sorted(self.samples)
        if not samples:
            return {}
        q1, _, q3 = quantiles(samples, n=4, method="inclusive") if len(samples) > 1 else samples * 3
        return {"median": median(samples), "min": samples[0], "q1": q1, "q3": q3}

    @property
    def compile(self) -> Compile | None:
        """Return the compilation with the median seconds, of those not from a cache if there are any."""
        compiles = sorted((round_.compile for round_ in self.rounds), key=lambda c: c.seconds)
        compiles = [compile_ for compile_ in compiles if not compile_.cached] or compiles
        return compiles[(len(compiles) - 1) // 2] if compiles else None


class Counters(msgspec.Struct, frozen=True, kw_only=True):
    """Work done; ``None`` where a library has no such counter."""

    steps: int | None = None
    rejections: int | None = None
    evaluations: int | None = None
    iterations: int | None = None
    solver: str | None = None


class ErrorGrowth(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """How an invariant's error grows with time; numbers that do not exist are ``None``.

    Attributes
    ----------
    kind : str or None
        A key of `hbvm_bench.measure.drift.KINDS`; ``None`` where the samples do not say.
    why : str
        Why there is none.
    slope, slope_low, slope_high : float or None
        Power of t, with its 95 % interval.
    floor : float
        What is there before the growth.
    exponential_rate : float or None
        Rate of an exponential, in 1/t.
    rate, rate_low, rate_high : float or None
        Mean signed drift per unit of time, with its 95 % interval over the initial conditions;
        for the energy only, the other invariants' errors have no sign.
    mean, mean_error : float or None
        Mean over the initial conditions at the end, without the offset of each
        (`hbvm_bench.measure.drift.mean`); its standard error where there are several.
    positive : int or None
        How many of the errors end above 0.
    reached : float
        What the growth alone reached at the end.
    end : float
        The end of the interval, from the start on.
    starts : int
        Trajectories it was found from.
    """

    kind: str | None = msgspec.field(default=None, name="law")
    why: str = ""
    slope: float | None = None
    slope_low: float | None = None
    slope_high: float | None = None
    floor: float = 0.0
    exponential_rate: float | None = msgspec.field(default=None, name="growth")
    rate: float | None = None
    rate_low: float | None = None
    rate_high: float | None = None
    mean: float | None = None
    mean_error: float | None = None
    positive: int | None = None
    reached: float = 0.0
    end: float = 0.0
    starts: int = 0


class Result(msgspec.Struct, frozen=True, kw_only=True):
    """What a worker process reports of the case it ran.

    Attributes
    ----------
    outcome : str
        ``ok``, ``stalled``, ``refused`` or ``crashed``; ``timeout`` and ``killed`` are seen from
        outside.
    status : str
        The solution's own status; empty without a solution, but for `COMPILING` and `DIED`.
    reason : str
        One sentence where something did not go as asked.
    t_stop : float or None
        Where the integration stopped.
    counters, compile
        What the integration cost.
    metrics, growth, violation
        What is computed from the series: metrics, how the error of each invariant grows, and where a symmetry
        guard says that this is another trajectory than the one asked for. Empty as a worker returns it and
        as a run's store keeps it: `hbvm_bench.measure.reading` fills them. The store of a report has them.
    warnings : list of str
        What the solution says of itself although it did not fail.
    reversal : Value
        Why there is no way back; without a reason the series have where it arrived.
    chaos : dict
        Why there is no ``megno`` and no ``exponent``, where they were asked for; what there is, is in the
        series.
    peak_gib : float or None
        Largest resident memory of the process.
    trajectories : int
        More than one for an ensemble.
    """

    outcome: Outcome
    status: str = ""
    reason: str = ""
    t_stop: float | None = None
    violation: str = ""
    counters: Counters = Counters()
    metrics: dict[str, Value] = {}
    compile: Compile | None = None
    growth: dict[str, ErrorGrowth] = msgspec.field(default_factory=dict, name="laws")
    trajectories: int = 1
    warnings: list[str] = []
    reversal: Value = Value(why="not asked for")
    chaos: dict[str, str] = {}
    peak_gib: float | None = None


class Reading(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """What was computed from the series of a case; see `Result`."""

    metrics: dict[str, Value] = {}
    violation: str = ""
    growth: dict[str, ErrorGrowth] = msgspec.field(default_factory=dict, name="laws")


class Record(msgspec.Struct, frozen=True, kw_only=True):
    """One case in the store.

    Attributes
    ----------
    id : str
        See `hbvm_bench.campaign.identity`.
    case : Case
        What was run.
    role, library, order
        Of the method.
    result : Result
        The results.
    timing : Timing or None
        From the serial timing pass.
    limits : Limits
        Under which it ran.
    seconds, peak_memory_gib : float
        Of the process of the accuracy run, start and imports included.
    log : str
        The end of what the process printed, where it crashed.
    versions, machine, finished
        Where and when it was measured.
    kernel : str
        The digest of the kernel's sources (`hbvm_bench.campaign.identity.kernel_digest`), of a case of HBVM,
        Gauss or LineIntegral; ``""`` of others, and where an earlier version of this package ran it.
    """

    id: str
    case: Case
    role: Role
    library: str
    order: int | None
    result: Result
    timing: Timing | None = None
    limits: Limits = Limits()
    seconds: float = 0.0
    peak_memory_gib: float = 0.0
    log: str = ""
    versions: dict[str, str] = {}
    machine: dict[str, str | int] = {}
    finished: str = ""
    kernel: str = ""

    def __post_init__(self) -> None:
        if self.finished:
            datetime.fromisoformat(self.finished)


def machine_of(records: Sequence[Record]) -> dict[str, str | int]:
    """Return where records were timed, or else measured."""
    timed = [record.timing.machine for record in records if record.timing is not None]
    return (timed or [record.machine for record in records])[0]
