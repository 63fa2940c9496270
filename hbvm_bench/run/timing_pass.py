"""The timing pass: one case at a time, alone and without output, round by round; or a problem's in turn."""

import math
import tempfile
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from statistics import median
from typing import Any

from msgspec.structs import replace

from hbvm_bench.campaign import own
from hbvm_bench.campaign.file import Limits, TimingPlan
from hbvm_bench.campaign.identity import Resolved
from hbvm_bench.measure import machine, reading
from hbvm_bench.measure.timing import shared
from hbvm_bench.run import front
from hbvm_bench.run.task import decoded, empty_caches, start
from hbvm_bench.run.worker import REPLY, Request
from hbvm_bench.store.records import Record, Timing
from hbvm_bench.store.store import Store

Tell = Callable[[int, Resolved], None]
Machine = dict[str, str | int]
OFF = "on another trajectory, so that its time is not meaningful"
ENDINGS = {"timeout": "the time limit", "compiling": "still compiling", "memory": "the memory limit"}


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
        for number, group in _missing(cases, store, plan, here):
            loaded = [record for case in group if (record := store.load(case.id)) is not None]
            records = [reading.up_to_date(store, record) for record in loaded]
            if len(records) < len(group) or group[0].id in failed:
                continue
            tell(number, group[0])
            if plan.interleaved:
                timings = _together(group, records, plan, limits, core, here)
            else:
                (more,) = _asked(group, plan, limits, core)
                before = _timing_of(records[0], plan, here)
                timings = [replace(before, rounds=[*before.rounds, *more.rounds], why=more.why)]
                failed |= {group[0].id} if more.why else set()
            for record, timing in zip(loaded, timings, strict=True):
                store.save(replace(record, timing=timing))


def missing_visits(cases: Sequence[Resolved], store: Store, plan: TimingPlan) -> int:
    """Return how many visits `time_cases` has to make, at most."""
    return len(_missing(cases, store, plan, machine.describe()))


def outdated(cases: Sequence[Resolved], store: Store, plan: TimingPlan) -> int:
    """Return how many cases have times that were taken by another plan, or do not say by which."""
    records = (store.load(case.id) for case in cases)
    timings = [record.timing for record in records if record is not None and record.timing is not None]
    return sum(bool(timing.rounds) and timing.plan != plan for timing in timings)


def timeable(record: Record) -> bool:
    """Whether a case reached its end, so that its time has a meaning."""
    return record.result.outcome == "ok" and record.result.status == "finished"


def _missing(
    cases: Sequence[Resolved], store: Store, plan: TimingPlan, here: Machine
) -> list[tuple[int, list[Resolved]]]:
    """Return the visits: of what round each is, and whom one process times in it.

    Rounds of different processes do not belong together: where one case of a problem is missing among its
    interleaved times, all of them are visited.
    """
    loaded = ((case, store.load(case.id)) for case in cases)
    known = [(case, record) for case, record in loaded if record is not None and timeable(record)]
    if not plan.interleaved:
        taken = {case.id: len(_timing_of(record, plan, here).rounds) for case, record in known}
        rounds = range(plan.rounds)
        return [(number, [case]) for number in rounds for case, _ in known if taken[case.id] <= number]
    groups: dict[object, list[tuple[Resolved, Record]]] = {}
    for case, record in known if plan.rounds else ():
        groups.setdefault((case.case.problem, case.case.ensemble), []).append((case, record))
    return [
        (0, [case for case, _ in group])
        for group in groups.values()
        if not _is_timed([record for _, record in group], plan, here)
    ]


def _is_timed(group: Sequence[Record], plan: TimingPlan, here: Machine) -> bool:
    """Whether one process has timed all cases of a problem in turn, by this plan and on this machine."""
    timings = [record.timing for record in group if record.timing and _stands(record.timing, plan, here)]
    processes = {timing.process for timing in timings}
    enough = any(len(timing.rounds) >= plan.rounds for timing in timings)
    return len(timings) == len(group) and len(processes) == 1 and "" not in processes and enough


def _together(
    group: Sequence[Resolved],
    records: Sequence[Record],
    plan: TimingPlan,
    limits: Limits,
    core: int | None,
    here: Machine,
) -> list[Timing]:
    """Time the cases of a problem in turn, but for those on another trajectory."""
    on = [item for item, record in zip(group, records, strict=True) if not record.result.violation]
    process = datetime.now(UTC).isoformat()
    together = replace(
        limits,
        wall_seconds=limits.wall_seconds * len(on),
        compile_seconds=limits.compile_seconds * len(on),
    )
    taken: dict[str, list[Timing]] = {item.id: [] for item in on}
    going = on
    for place, numbers in enumerate(shared(plan.rounds, plan.compilations)):
        parts = _asked(going, plan, together, core, rounds=numbers, compilation=place) if going else []
        for item, part in zip(going, parts, strict=True):
            taken[item.id].append(part)
        if plan.front and not place:
            there = [record for record in records if not record.result.violation]
            left = zip(on, front.behind(going, there, parts), strict=True)
            going = []
            for item, is_behind in left:
                if is_behind:
                    taken[item.id].append(Timing(why=front.WHY))
                else:
                    going.append(item)
    timings = {item.id: Timing(why=OFF) for item in group}
    timings |= {key: _joined(parts) for key, parts in taken.items()}
    return [replace(item, plan=plan, machine=here, process=process) for item in timings.values()]


def _joined(parts: Sequence[Timing]) -> Timing:
    """Return the times of several processes as one, round by round."""
    rounds = sorted(
        (round_ for part in parts for round_ in part.rounds), key=lambda round_: round_.number or 0
    )
    loads = [part.load for part in parts if part.load is not None]
    return Timing(
        rounds=rounds,
        why="; ".join(dict.fromkeys(part.why for part in parts if part.why)),
        call=median([part.call for part in parts if part.call is not None] or [math.nan]) if rounds else None,
        load=max(loads, key=lambda load: max(load.others, load.steal), default=None),
    )


def _asked(
    cases: Sequence[Resolved], plan: TimingPlan, limits: Limits, core: int | None, **part: Any
) -> list[Timing]:
    """Return what a worker process answers; without an answer each timing says why."""
    asked, beside = {case.id: case.case for case in cases}, own.beside(cases[0].problem)
    request = Request(cases=asked, limits=limits, plan=plan, beside=beside, core=core, **part)
    with tempfile.TemporaryDirectory(prefix="hbvm-bench-") as scratch:
        caches = empty_caches(Path(scratch) / "caches") if plan.compilations > 1 else {}
        ended = start(Path(scratch), request, environment=caches)
        reply = decoded(Path(scratch) / REPLY, list[Timing])
    if reply is not None and len(reply) == len(cases):
        return reply
    return [Timing(why=f"not timed: {ENDINGS.get(ended.cause, ended.words)}")] * len(cases)


def _timing_of(record: Record, plan: TimingPlan, here: Machine) -> Timing:
    """Return what was timed by this plan and on this machine; other seconds are no rounds of the same pass.

    Why a round failed is forgotten: it is tried again.
    """
    if record.timing is None or not _stands(record.timing, plan, here):
        return Timing(plan=plan, machine=here)
    return replace(record.timing, why="")


def _stands(timing: Timing, plan: TimingPlan, here: Machine) -> bool:
    return timing.plan == plan and machine.same(timing.machine, here)
