"""The timing pass: one process takes the cases of a problem in turn, alone and without output."""

import math
import tempfile
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from statistics import median
from types import MappingProxyType

from msgspec.structs import replace

from hbvm_bench.campaign.entries import Accuracy, Limits, TimingPlan
from hbvm_bench.campaign.identity import Resolved
from hbvm_bench.measure import machine, reading
from hbvm_bench.measure.timing import chooses, shared
from hbvm_bench.run.task import NO_RESULT, Request, timed
from hbvm_bench.store.records import Record, Timing
from hbvm_bench.store.store import Store
from hbvm_bench.summaries import front
from hbvm_bench.summaries.rows import status_of

Machine = dict[str, str | int]
Group = list[tuple[Resolved, Record]]
OFF = "on another trajectory, so that its time is not meaningful"


def time_cases(
    cases: Sequence[Resolved],
    store: Store,
    plan: TimingPlan,
    limits: Limits,
    tell: Callable[[Resolved], None] = lambda resolved: None,
    asked: Mapping[str, Sequence[Accuracy]] = MappingProxyType({}),
) -> None:
    """Take what is missing of the timing pass, problem by problem.

    Parameters
    ----------
    cases : sequence of Resolved
        Those that did not reach their end are left out, with the reason.
    store : Store
        Holds their records, which are extended after every problem.
    plan : TimingPlan
        Rounds and samples.
    limits : Limits
        Of each visit, times the number of its cases.
    tell : callable, optional
        Called before each visit with the first case.
    asked : mapping, optional
        The errors that are asked for by problem, as cases have its text; see `hbvm_bench.summaries.front`.

    Raises
    ------
    hbvm_bench.run.task.InterruptedRunError
        If the run was stopped; every problem that was timed is in the store.
    """
    here, known = machine.describe(measure=True), store.known()
    with machine.leaving_a_core() as core:
        for group in _missing(cases, store, plan, here):
            tell(group[0][0])
            read = [reading.up_to_date(store, row, known) for _, row in group]
            errors = asked.get(group[0][0].case.problem, ())
            with tempfile.TemporaryDirectory(prefix="hbvm-bench-") as scratch:
                caches = Path(scratch) if plan.compilations > 1 else None
                timings = _together(group, read, plan, limits, core, errors, caches)
            process = datetime.now(UTC).isoformat()
            taken = [replace(timing, plan=plan, machine=here, process=process) for timing in timings]
            store.renew([replace(row, timing=t) for (_, row), t in zip(group, taken, strict=True)])


def missing_visits(cases: Sequence[Resolved], store: Store, plan: TimingPlan) -> int:
    """Return how many visits `time_cases` has to make."""
    return len(_missing(cases, store, plan, machine.describe()))


def outdated(cases: Sequence[Resolved], store: Store, plan: TimingPlan) -> int:
    """Return how many cases have times that were taken by another plan, or do not say by which."""
    records = (store.load(case.id) for case in cases)
    timings = [record.timing for record in records if record is not None and record.timing is not None]
    return sum(bool(timing.rounds) and timing.plan != plan for timing in timings)


def _missing(cases: Sequence[Resolved], store: Store, plan: TimingPlan, here: Machine) -> list[Group]:
    """Return whom one process times together.

    Rounds of different processes do not belong together: where one case of a problem is missing among its
    times, all of them are visited.
    """
    groups: dict[object, Group] = {}
    for case in cases if plan.rounds else ():
        if (record := store.load(case.id)) is not None and status_of(record) == "ok":
            groups.setdefault((case.case.problem, case.case.ensemble), []).append((case, record))
    return [group for group in groups.values() if not _is_timed([record for _, record in group], plan, here)]


def _is_timed(group: Sequence[Record], plan: TimingPlan, here: Machine) -> bool:
    """Whether one process has timed all cases of a problem in turn, by this plan and on this machine."""
    timings = [timing for record in group if (timing := record.timing) is not None and timing.plan == plan]
    stand = [timing for timing in timings if machine.same(timing.machine, here)]
    processes = {timing.process for timing in stand}
    enough = any(len(timing.rounds) >= plan.rounds for timing in stand)
    return len(stand) == len(group) and len(processes) == 1 and "" not in processes and enough


def _together(
    group: Group,
    records: Sequence[Record],
    plan: TimingPlan,
    limits: Limits,
    core: int | None,
    asked: Sequence[Accuracy],
    caches: Path | None,
) -> list[Timing]:
    """Time the cases of a problem in turn, but for those on another trajectory.

    Where several processes share the rounds, the first begins with empty ``caches``. The others load from
    them what a library keeps: the same machine code, at another place in memory.
    """
    pairs = zip((case for case, _ in group), records, strict=True)
    on = [(case, record) for case, record in pairs if not record.result.violation]
    together = replace(
        limits, wall_seconds=limits.wall_seconds * len(on), compile_seconds=limits.compile_seconds * len(on)
    )
    taken: dict[str, list[Timing]] = {case.id: [] for case, _ in on}
    left: set[str] = set()  # what takes no part in further rounds
    compares = False
    for place, numbers in enumerate(shared(plan.rounds, plan.compilations)):
        if plan.front and place and not compares and not chooses(numbers[0]):
            compares = True
            left -= front.chosen([replace(row, timing=_joined(taken[row.id])) for _, row in on], asked)
        going = [(case, record) for case, record in on if case.id not in left]
        if not going:
            continue
        request = Request(
            rows=[replace(record, result=NO_RESULT, timing=None) for _, record in going],
            limits=together,
            plan=plan,
            beside=going[0][0].beside,
            rounds=numbers,
            compilation=place,
            core=core,
        )
        parts = timed(request, caches)
        for (case, _), part in zip(going, parts, strict=True):
            taken[case.id].append(part)
        if plan.front and not place:
            left = front.behind([record for _, record in on], parts)
    for key in left:
        taken[key].append(Timing(why=front.WHY))
    return [_joined(taken[case.id]) if case.id in taken else Timing(why=OFF) for case, _ in group]


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
        load=max(loads, key=lambda load: load.most, default=None),
    )
