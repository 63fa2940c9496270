"""The timing pass: one case at a time, alone and without output, round by round."""

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec

from hbvm_bench.campaign.file import Limits, TimingPlan
from hbvm_bench.campaign.identity import Resolved
from hbvm_bench.measure import machine
from hbvm_bench.measure import measured as measure
from hbvm_bench.measure.metrics import TIMING_KEYS, evaluate
from hbvm_bench.reference import solutions
from hbvm_bench.run.task import decoded, start
from hbvm_bench.run.worker import Request, TimingReply
from hbvm_bench.store.records import Record, Timing
from hbvm_bench.store.store import Store


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

    Raises
    ------
    hbvm_bench.run.task.InterruptedRunError
        If the run was stopped; every visit that ended is in the store.
    """
    here = machine.describe(measure=True)
    failed: set[str] = set()  # in this pass; the next one tries them again
    with machine.leaving_a_core() as core:
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
    records = [record for case in cases if (record := store.load(case.id)) and timeable(record)]
    here = machine.describe()
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


def _visit(resolved: Resolved, timing: Timing, plan: TimingPlan, limits: Limits, core: int | None) -> Timing:
    with tempfile.TemporaryDirectory(prefix="hbvm-bench-") as scratch:
        request = Request(case=resolved.case, id=resolved.id, mode="time", plan=plan, core=core)
        ended = start(Path(scratch), request, limits)
        reply = decoded(Path(scratch) / "timing.json", TimingReply)
    if reply is None:
        words = {
            "timeout": "the time limit",
            "compiling": "still compiling",
            "memory": "the memory limit",
        }.get(ended.cause, ended.words)
        return msgspec.structs.replace(timing, why=f"not timed: {words}")
    if reply.round is None:
        return msgspec.structs.replace(timing, why=reply.why)
    return Timing(rounds=[*timing.rounds, reply.round], machine=timing.machine)


def _timing_of(record: Record, here: dict[str, str | int]) -> Timing:
    """Return what was timed on this machine; seconds of another one are no rounds of the same pass.

    Why a round failed is forgotten: it is tried again.
    """
    if record.timing is None or (record.timing.machine and not machine.same(record.timing.machine, here)):
        return Timing(machine=here)
    return msgspec.structs.replace(record.timing, why="")
