"""The timing pass: one case at a time, alone and without output, round by round; or a problem's in turn."""

import tempfile
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from hbvm_bench.campaign import own
from hbvm_bench.campaign.file import Limits, TimingPlan
from hbvm_bench.campaign.identity import Resolved
from hbvm_bench.measure import machine
from hbvm_bench.measure import measured as measure
from hbvm_bench.measure.metrics import TIMING_KEYS, evaluate
from hbvm_bench.reference import solutions
from hbvm_bench.run.task import decoded, start
from hbvm_bench.run.worker import REPLY, Request
from hbvm_bench.store.records import Record, Timing
from hbvm_bench.store.store import Store

Tell = Callable[[int, Resolved], None]
OFF = "on another trajectory, so that its time has no meaning"


def time_cases(
    cases: Sequence[Resolved],
    store: Store,
    plan: TimingPlan,
    limits: Limits,
    tell: Tell = lambda round_, resolved: None,
) -> None:
    """Take what is missing of the timing pass: one case at a time, alone, round by round.

    With ``plan.interleaved`` one process takes all rounds of all cases of a problem, in turn;
    a problem that has them of one such process is not timed again.

    Parameters
    ----------
    cases : sequence of Resolved
        Those that did not reach their end are left out, with the reason.
    store : Store
        Holds their records, which are extended after every visit.
    plan : TimingPlan
        Rounds and samples.
    limits : Limits
        Of each visit; of an interleaved one, times the number of its cases.
    tell : callable, optional
        Called before each visit with the round and the case.

    Raises
    ------
    hbvm_bench.run.task.InterruptedRunError
        If the run was stopped; every visit that ended is in the store.
    """
    here = machine.describe(measure=True)
    failed: set[str] = set()  # in this pass; the next one tries them again
    with machine.leaving_a_core() as core:
        if plan.interleaved:
            for group in _missing_together(cases, store, plan, here):
                _visit_together(group, store, plan, limits, core, here, tell)
            return
        for number in range(plan.rounds):
            for resolved in cases:
                record = store.load(resolved.id)
                if record is None or not timeable(record) or resolved.id in failed:
                    continue
                timing = _timing_of(record, here)
                if len(timing.rounds) > number:
                    continue
                tell(number, resolved)
                timing = _visit(resolved, timing, plan, limits, core)
                failed |= {resolved.id} if timing.why else set()
                store.save(_with_timing(store, record, resolved, timing))


def missing_visits(cases: Sequence[Resolved], store: Store, plan: TimingPlan) -> list[str]:
    """Return the ids that `time_cases` has to visit, each as often as it does, at most."""
    here = machine.describe()
    if plan.interleaved:
        return [group[0].id for group in _missing_together(cases, store, plan, here)]
    records = [record for case in cases if (record := store.load(case.id)) and timeable(record)]
    timings = {record.id: _timing_of(record, here) for record in records}
    return [
        key
        for number in range(plan.rounds)
        for key, timing in timings.items()
        if len(timing.rounds) <= number
    ]


def timeable(record: Record) -> bool:
    """Whether a case reached its end, so that its time has a meaning."""
    return record.result.outcome == "ok" and record.result.status == "finished"


def _with_timing(store: Store, record: Record, resolved: Resolved, timing: Timing) -> Record:
    series = store.series(record.id)
    known = solutions.find(resolved.problem)
    measured = measure.restore(resolved.problem, series, record.result, known, timing)
    result = msgspec.structs.replace(
        record.result, metrics=record.result.metrics | evaluate(measured, TIMING_KEYS)
    )
    return msgspec.structs.replace(record, result=result, timing=timing)


def _missing_together(
    cases: Sequence[Resolved], store: Store, plan: TimingPlan, here: dict[str, str | int]
) -> list[list[Resolved]]:
    """Return the cases to be timed, problem by problem: all of those that reached their end, or none.

    Rounds of different processes do not belong together, so that one missing case has all of them visited.
    """
    groups: dict[object, list[Resolved]] = {}
    for resolved in cases:
        record = store.load(resolved.id)
        if record is not None and timeable(record) and plan.rounds:
            groups.setdefault((resolved.case.problem, resolved.case.ensemble), []).append(resolved)
    return [group for group in groups.values() if not _timed_together(group, store, plan, here)]


def _timed_together(
    group: Sequence[Resolved], store: Store, plan: TimingPlan, here: dict[str, str | int]
) -> bool:
    kept = [record.timing for one in group if (record := store.load(one.id)) is not None]
    timings = [timing for timing in kept if timing is not None and machine.same(timing.machine, here)]
    processes = {timing.process for timing in timings}
    enough = any(len(timing.rounds) >= plan.rounds for timing in timings)
    return len(timings) == len(group) and len(processes) == 1 and "" not in processes and enough


def _visit_together(
    group: Sequence[Resolved],
    store: Store,
    plan: TimingPlan,
    limits: Limits,
    core: int | None,
    here: dict[str, str | int],
    tell: Tell,
) -> None:
    tell(0, group[0])
    records = {one.id: record for one in group if (record := store.load(one.id)) is not None}
    on = [one for one in group if not records[one.id].result.violation]
    timings = dict.fromkeys((one.id for one in group), Timing(why=OFF))
    process = datetime.now(UTC).isoformat()
    if on:
        together = msgspec.structs.replace(
            limits,
            wall_seconds=limits.wall_seconds * len(on),
            compile_seconds=limits.compile_seconds * len(on),
        )
        timings |= zip((one.id for one in on), _asked(on, plan, together, core), strict=True)
    for one in group:
        timing = msgspec.structs.replace(timings[one.id], machine=here, process=process)
        store.save(_with_timing(store, records[one.id], one, timing))


def _visit(resolved: Resolved, timing: Timing, plan: TimingPlan, limits: Limits, core: int | None) -> Timing:
    (made,) = _asked([resolved], plan, limits, core)
    return Timing(rounds=[*timing.rounds, *made.rounds], why=made.why, machine=timing.machine)


def _asked(cases: Sequence[Resolved], plan: TimingPlan, limits: Limits, core: int | None) -> list[Timing]:
    """Return what a worker process answers; without an answer each timing says why."""
    asked, beside = {one.id: one.case for one in cases}, own.beside(cases[0].problem)
    request = Request(cases=asked, limits=limits, plan=plan, beside=beside, core=core)
    with tempfile.TemporaryDirectory(prefix="hbvm-bench-") as scratch:
        ended = start(Path(scratch), request)
        reply = decoded(Path(scratch) / REPLY, list[Timing])
    if reply is not None and len(reply) == len(cases):
        return reply
    words = {
        "timeout": "the time limit",
        "compiling": "still compiling",
        "memory": "the memory limit",
    }.get(ended.cause, ended.words)
    return [Timing(why=f"not timed: {words}")] * len(cases)


def _timing_of(record: Record, here: dict[str, str | int]) -> Timing:
    """Return what was timed on this machine; seconds of another one are no rounds of the same pass.

    Why a round failed is forgotten: it is tried again.
    """
    if record.timing is None or (record.timing.machine and not machine.same(record.timing.machine, here)):
        return Timing(machine=here)
    return msgspec.structs.replace(record.timing, why="")
