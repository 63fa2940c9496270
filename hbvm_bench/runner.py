"""Run cases: each in a process of its own, under hard limits, by any executor."""

import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np

from hbvm_bench import machine, measure, reference, supervise
from hbvm_bench.campaign import Campaign, Case, Limits, TimingPlan
from hbvm_bench.identity import Resolved, is_ours, resolve, versions_of
from hbvm_bench.metrics import TIMING_KEYS, evaluate
from hbvm_bench.records import Outcome, Record, Result, Timing
from hbvm_bench.store import Store
from hbvm_bench.supervise import Ended
from hbvm_bench.worker import ENVIRONMENT, STALE, Request, TimingReply
from problems.errors import InputError

T = TypeVar("T")
LOG_LENGTH = 4000  # characters kept of what a crashed process printed


class InterruptedRunError(Exception):
    """The run was stopped; what finished is in the store."""


def plan(campaign: Campaign) -> list[Resolved]:
    """Return the cases of a campaign, every name and option checked.

    Raises
    ------
    problems.errors.InputError
        For the first one that cannot be used, or for a case given twice.
    """
    cases = [resolve(case) for case in campaign.cases()]
    seen: set[str] = set()
    for resolved in cases:
        if resolved.id in seen:
            raise InputError(f"{resolved.case.method} on {resolved.case.problem} is given twice.")
        seen.add(resolved.id)
    return cases


def is_done(record: Record | None, limits: Limits) -> bool:
    """Whether a stored case need not run again under these limits."""
    if record is None:
        return False
    stopped_by = {"timeout": "wall_seconds", "killed": "memory_gib"}.get(record.result.outcome)
    return stopped_by is None or getattr(limits, stopped_by) <= getattr(record.limits, stopped_by)


def run_case(case: Case, directory: str, limits: Limits) -> Record:
    """Measure one case in a process of its own and store it.

    Top-level and with plain arguments, so that any `concurrent.futures.Executor`
    can run it, on this machine or another.

    Parameters
    ----------
    case : Case
        What to run.
    directory : str
        The store.
    limits : Limits
        Wall time and memory of the process.

    Returns
    -------
    Record
        Whatever happens to the process: a failure is a record with its reason.

    Raises
    ------
    InterruptedRunError
        If the run was stopped meanwhile; nothing is stored then.
    problems.errors.InputError
        If the sources changed meanwhile; nothing is stored then either.
    """
    resolved = resolve(case)
    store = Store(Path(directory))
    with tempfile.TemporaryDirectory(prefix="hbvm-bench-") as scratch:
        request = Request(case=resolved.case, id=resolved.id, runner=os.getpid())
        ended = _start(Path(scratch), request, limits)
        result = _result(Path(scratch), ended, limits)
        if result.reason == STALE:
            raise InputError(STALE)
        series = _series(Path(scratch)) if result.outcome in ("ok", "stalled") else None
    record = Record(
        id=resolved.id,
        case=resolved.case,
        role="ours" if is_ours(resolved.method) else "peer",
        library=resolved.method.library,
        order=resolved.method.order,
        result=result,
        limits=limits,
        seconds=round(ended.seconds, 3),
        peak_memory_gib=round(ended.peak_gib, 3),
        log=ended.output[-LOG_LENGTH:] if result.outcome == "crashed" else "",
        versions=versions_of(resolved.method),
        machine=machine.describe(),
        finished=datetime.now(UTC).isoformat(timespec="seconds"),
    )
    store.save(record, series)
    return record


def run_accuracy(
    cases: Sequence[Resolved],
    store: Store,
    limits: Limits,
    executor: Executor,
) -> Iterator[Record]:
    """Run cases side by side and yield their records as they finish.

    Raises
    ------
    InterruptedRunError
        If the run was stopped; the executor's waiting cases are given up.
    """
    futures: list[Future[Record]] = [
        executor.submit(run_case, resolved.case, str(store.directory), limits) for resolved in cases
    ]
    try:
        for future in as_completed(futures):
            yield future.result()
    finally:
        for future in futures:
            future.cancel()


def local_executor(jobs: int) -> Executor:
    """Return the executor for this machine: threads, each of which waits for its child process."""
    return ThreadPoolExecutor(max_workers=jobs, thread_name_prefix="case")


def time_cases(
    cases: Sequence[Resolved],
    store: Store,
    plan: TimingPlan,
    limits: Limits,
    tell: Callable[[int, Resolved], None] = lambda round_, resolved: None,
) -> None:
    """Take what is missing of the timing pass: one case at a time, alone, round by round.

    Parameters
    ----------
    cases : sequence of Resolved
        Those that did not reach their end are left out, with the reason.
    store : Store
        Holds their records, which are extended after every visit.
    plan : TimingPlan
        Rounds and samples.
    limits : Limits
        Of each visit.
    tell : callable, optional
        Called before each visit with the round and the case.
    """
    for number in range(plan.rounds):
        for resolved in cases:
            record = store.load(resolved.id)
            if record is None or not timeable(record):
                continue
            timing = record.timing or Timing()
            if timing.why or len(timing.rounds) > number:
                continue
            tell(number, resolved)
            timing = _visit(resolved, timing, plan, limits)
            store.save(_with_timing(store, record, resolved, timing))


def missing_visits(cases: Sequence[Resolved], store: Store, plan: TimingPlan) -> int:
    """Return how many visits `time_cases` has to make at most."""
    records = [store.load(resolved.id) for resolved in cases]
    timings = [record.timing or Timing() for record in records if record and timeable(record)]
    return sum(max(0, plan.rounds - len(timing.rounds)) for timing in timings if not timing.why)


def timeable(record: Record) -> bool:
    """Whether a case reached its end, so that its time has a meaning."""
    return record.result.outcome == "ok" and record.result.status == "finished"


def _with_timing(store: Store, record: Record, resolved: Resolved, timing: Timing) -> Record:
    series = store.series(record.id)
    known = reference.find(resolved.problem)
    measured = measure.restore(resolved.problem, series, record.result, known, timing)
    result = msgspec.structs.replace(
        record.result, metrics=record.result.metrics | evaluate(measured, TIMING_KEYS)
    )
    return msgspec.structs.replace(record, result=result, timing=timing)


def _visit(resolved: Resolved, timing: Timing, plan: TimingPlan, limits: Limits) -> Timing:
    with tempfile.TemporaryDirectory(prefix="hbvm-bench-") as scratch:
        core = max(machine.cores(), default=None)
        request = Request(
            case=resolved.case, id=resolved.id, mode="time", plan=plan, core=core, runner=os.getpid()
        )
        ended = _start(Path(scratch), request, limits)
        reply = _decoded(Path(scratch) / "timing.json", TimingReply)
    if ended.cause == "stopped":
        raise InterruptedRunError
    if reply is None:
        words = {"timeout": "the time limit", "memory": "the memory limit"}.get(ended.cause, ended.words)
        return msgspec.structs.replace(timing, why=f"not timed: {words}")
    if reply.round is None:
        return msgspec.structs.replace(timing, why=reply.why)
    return Timing(rounds=[*timing.rounds, reply.round])


def _start(scratch: Path, request: Request, limits: Limits) -> Ended:
    path = scratch / "request.json"
    path.write_bytes(msgspec.json.encode(request))
    ended = supervise.run([sys.executable, "-m", "hbvm_bench.worker", str(path)], ENVIRONMENT, limits)
    if ended.cause == "stopped":
        raise InterruptedRunError
    return ended


def _result(scratch: Path, ended: Ended, limits: Limits) -> Result:
    def failed(outcome: Outcome, reason: str) -> Result:
        return Result(outcome=outcome, reason=reason)

    if ended.cause == "timeout":
        return failed("timeout", f"did not end within {limits.wall_seconds:g} s")
    if ended.cause == "memory":
        return failed("killed", f"used more than {limits.memory_gib:g} GiB of memory")
    if ended.code == -9:
        return failed("killed", "ended by signal SIGKILL from outside, perhaps for want of memory")
    if ended.code != 0:
        return failed("crashed", f"the process {ended.words}")
    result = _decoded(scratch / "result.json", Result)
    if result is None:
        return failed("crashed", "the process left no readable result")
    return result


def _decoded(path: Path, type_: type[T]) -> T | None:
    try:
        return msgspec.json.decode(path.read_bytes(), type=type_)
    except (FileNotFoundError, msgspec.MsgspecError):
        return None


def _series(scratch: Path) -> dict[str, Any]:
    with np.load(scratch / "series.npz", allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}
