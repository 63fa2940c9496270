"""What is asked of a process that runs cases, what it answers, and the row that comes of it."""

import platform
import threading
from datetime import UTC, datetime
from pathlib import Path

import msgspec
from msgspec.structs import replace

from hbvm_bench.campaign import folder, own
from hbvm_bench.campaign.file import Case, Limits, TimingPlan
from hbvm_bench.campaign.identity import Resolved, is_ours, kernel_digest, versions_of
from hbvm_bench.measure import machine
from hbvm_bench.measure.computation import Task
from hbvm_bench.run import child
from hbvm_bench.run.child import Child, Ended
from hbvm_bench.store import arrays, records
from hbvm_bench.store.records import COMPILING, DIED, Outcome, Record, Result, Timing
from problems.errors import printable

LOG_LENGTH = 4000  # characters kept of what a crashed process printed
ENDINGS = {"timeout": "the time limit", "compiling": "still compiling", "memory": "the memory limit"}
NO_RESULT = Result(outcome="crashed", reason="the process left no readable result", status=DIED)

idle = child.Idle()
_thread = threading.local()


class InterruptedRunError(Exception):
    """The run was stopped; what finished is in the store."""


class UnfinishedRunError(Exception):
    """Some cases could not be run at all; what finished is in the store."""


class Computation(msgspec.Struct, frozen=True, kw_only=True):
    """One computation of a study.

    Attributes
    ----------
    folder, place : str
        Of the function that lists them, as in ``./blocks.py:tasks``.
    key : str
        Which of them.
    quick : bool
        Whether the run is quick.
    timed : bool
        Whether it takes times: it finds nothing loaded then, and nothing runs beside it.
    """

    folder: str
    place: str
    key: str
    quick: bool
    timed: bool = False

    def tasks(self) -> dict[str, Task]:
        """Return the tasks of the study, by their keys."""
        return {task.key: task for task in folder.named(self.place, Path(self.folder))(self.quick)}


class Request(msgspec.Struct, frozen=True, kw_only=True):
    """What travels to a process, and before that to whichever machine shall start it.

    Attributes
    ----------
    rows : list of Record
        The rows that are to be filled: of one case to be measured, or of several to be timed together. Their
        ids must come out the same there.
    limits : Limits
        Wall time and memory.
    plan : TimingPlan or None
        What to time; ``None`` for the accuracy run.
    beside : own.Beside
        What must be known of their problem.
    rounds : list of int
        Of interleaved times, those that are this process's.
    compilation : int
        Which of the plan's compilations they are of.
    core : int or None
        The core to stay on.
    computation : Computation or None
        What to do instead of an integration.
    """

    rows: list[Record]
    limits: Limits
    plan: TimingPlan | None = None
    beside: own.Beside = own.Beside()
    rounds: list[int] = []
    compilation: int = 0
    core: int | None = None
    computation: Computation | None = None

    @property
    def id(self) -> str:
        """The id of its first row."""
        return self.rows[0].id

    @property
    def case(self) -> Case:
        """The case of its first row."""
        return self.rows[0].case


class Answer(msgspec.Struct, frozen=True, kw_only=True):
    """What a process says of a request.

    Attributes
    ----------
    leaves : bool
        Whether the process is to serve no further case, and what it printed is wanted to the end.
    refusal : str
        Why nothing of it can be done in this place; empty where it was.
    result : bytes
        JSON of the `Result` of the case.
    series : dict of bytes
        Its arrays by name, as `hbvm_bench.store.arrays.packed` makes them.
    timings : bytes
        JSON of the `Timing` of each row.
    """

    leaves: bool = False
    refusal: str = ""
    result: bytes = b""
    series: dict[str, bytes] = {}
    timings: bytes = b""


def request_of(resolved: Resolved, limits: Limits) -> Request:
    """Return what is asked for an accuracy run of a case."""
    method = resolved.method
    row = Record(
        id=resolved.id,
        case=resolved.case,
        role="ours" if is_ours(method) else "peer",
        library=method.library,
        order=method.order,
        result=NO_RESULT,
        limits=limits,
        versions=versions_of(method),
        kernel=kernel_digest() if is_ours(method) else "",
    )
    return Request(rows=[row], limits=limits, beside=resolved.beside)


Made = tuple[Record, dict[str, bytes]]
"""A row, whatever happens to its process, and its packed arrays by name."""


def execute(request: Request) -> Made:
    """Measure one case in a process under hard limits.

    Top-level and without a directory, so that any `concurrent.futures.Executor` can run it, on this machine
    or another. The process serves the next case of the same library, too.

    Raises
    ------
    InterruptedRunError
        If the run was stopped meanwhile.
    UnfinishedRunError
        If the case could not be run here at all.
    """
    (row,) = request.rows
    computation = request.computation
    serves, fresh = (row.library, False) if computation is None else (computation.folder, computation.timed)
    with idle.one(serves, fresh=fresh) as process:
        ended, answer = asked(process, replace(request, core=getattr(_thread, "core", None)))
    result, series = _result(ended, answer, request.limits)
    made = replace(
        row,
        result=result,
        seconds=round(ended.seconds, 3),
        peak_memory_gib=round(ended.peak_gib, 3),
        log=printable(ended.output[-LOG_LENGTH:]) if result.outcome == "crashed" else "",
        machine=machine.describe(),
        finished=datetime.now(UTC).isoformat(timespec="seconds"),
    )
    return made, series


def asked(process: Child, request: Request) -> tuple[Ended, Answer]:
    """Ask a process, and return how that ended and what it answered.

    Raises
    ------
    InterruptedRunError
        If the run was stopped.
    UnfinishedRunError
        If it is not possible in this place.
    """
    compiles = request.computation is None
    ended = process.ask(msgspec.json.encode(request), request.limits, compiles=compiles)
    if ended.cause == "stopped":
        raise InterruptedRunError
    answer = msgspec.msgpack.decode(ended.reply, type=Answer) if ended.reply else Answer()
    if answer.refusal:
        raise UnfinishedRunError(f"{platform.node()} {answer.refusal}")
    return ended, answer


def stay_on(core: int) -> None:
    """Let the cases that this thread starts stay on one core."""
    _thread.core = core


def _result(ended: Ended, answer: Answer, limits: Limits) -> tuple[Result, dict[str, bytes]]:
    def failed(outcome: Outcome, reason: str, status: str = "") -> tuple[Result, dict[str, bytes]]:
        return Result(outcome=outcome, reason=reason, status=status), {}

    if ended.cause == "timeout":
        return failed("timeout", f"did not end within {limits.wall_seconds:g} s")
    if ended.cause == "compiling":
        reason = f"was still compiling after {limits.compile_seconds:g} s; it is tried again in the next run"
        return failed("timeout", reason, COMPILING)
    if ended.cause == "memory":
        return failed("killed", f"used more than {limits.memory_gib:g} GiB of memory")
    if ended.code == child.KILLED:
        return failed("killed", "ended by signal SIGKILL from outside, perhaps for want of memory", DIED)
    if ended.code != 0:
        return failed("crashed", f"the process {ended.words}", DIED)
    try:
        result = records.decoded(answer.result, Result)
        arrays.check(answer.series)
    except ValueError:  # msgspec's errors and bad UTF-8 are among these
        return NO_RESULT, {}
    return result, answer.series


def timed(request: Request, caches: Path | None = None) -> list[Timing]:
    """Return the times of the cases of a request, which one new process takes in turn, or why it has none.

    With ``caches`` it looks for compiled code in that directory, and keeps it there.

    Raises what `asked` does.
    """
    process = Child(child.caches_in(caches) if caches else {})
    try:
        ended, answer = asked(process, request)
    finally:
        process.close()
    if answer.timings:
        return records.decoded(answer.timings, list[Timing])
    return [Timing(why=f"not timed: {ENDINGS.get(ended.cause, ended.words)}")] * len(request.rows)
