"""Run cases side by side: each in a process of its own, under hard limits, by any executor."""

import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait

from hbvm_bench.campaign.file import Campaign, Limits
from hbvm_bench.campaign.identity import Resolved, resolve
from hbvm_bench.campaign.own import NOTHING, Known
from hbvm_bench.run.executors import Pool
from hbvm_bench.run.task import InterruptedRunError, Made, Request, UnfinishedRunError, execute
from hbvm_bench.store.records import COMPILING, DIED, Record
from hbvm_bench.store.store import Store
from problems.errors import InputError

ATTEMPTS = 3  # of a case whose process dies, or that an executor loses with the machine that had it
PATIENCE = 1.0  # seconds between two looks at how many slots there are


def plan(campaign: Campaign, known: Known = NOTHING) -> list[Resolved]:
    """Return the cases of a campaign, every name and option checked.

    Raises
    ------
    problems.errors.InputError
        For the first one that cannot be used, or for a case given twice.
    """
    cases = [resolve(case, known) for case in campaign.cases()]
    seen: set[str] = set()
    for resolved in cases:
        if resolved.id in seen:
            raise InputError(f"{resolved.case.method} on {resolved.case.problem} is given twice.")
        seen.add(resolved.id)
    return cases


def is_done(record: Record | None, limits: Limits) -> bool:
    """Whether a stored case need not run again under these limits."""
    if record is None or record.result.status == COMPILING or died(record):
        return False
    stopped_by = {"timeout": "wall_seconds", "killed": "memory_gib"}.get(record.result.outcome)
    return stopped_by is None or getattr(limits, stopped_by) <= getattr(record.limits, stopped_by)


def died(record: Record) -> bool:
    """Whether the process of a case ended without an answer, as when it is killed from outside."""
    return record.result.status == DIED


def run_accuracy(
    requests: Sequence[Request],
    store: Store,
    pool: Pool,
    tell: Callable[[Sequence[Request]], None] = lambda running: None,
) -> Iterator[Record]:
    """Run cases side by side, store each as it finishes, and yield its record.

    This process alone writes in the store; the executor's may be other machines. The executor has as many
    cases as it has slots, and never a long queue, so that what runs is known, and little is left
    behind where the run is stopped. Those of one library follow each other, whose processes serve many.
    ``tell`` is called with the running cases, whenever they change and about once a second. A case whose
    process died runs again, after the others; `ATTEMPTS` times in all, then its record is stored as it is.

    Raises
    ------
    InterruptedRunError
        If the run was stopped.
    UnfinishedRunError
        If the executor is gone, or one of its machines has other sources or versions (it would
        refuse one case after the other); and after all others, if it could not run some cases.
    """
    libraries = list(dict.fromkeys(request.rows[0].library for request in requests))
    waiting = deque(sorted(requests, key=lambda request: libraries.index(request.rows[0].library)))
    running: dict[Future[Made], Request] = {}
    attempts: Counter[str] = Counter()
    failures: list[str] = []
    try:
        while waiting or running:
            slots = pool.slots()
            while waiting and len(running) < slots:
                request = waiting.popleft()
                running[_submitted(pool, request)] = request
            tell(list(running.values()))
            if why := pool.lost():
                raise UnfinishedRunError(why)
            if not running:  # a cluster that has no worker at the moment
                time.sleep(PATIENCE)
                continue
            done, _ = wait(running, timeout=PATIENCE, return_when=FIRST_COMPLETED)
            for future in done:
                request = running.pop(future)
                measured, series, failure = None, {}, ""
                try:
                    measured, series = future.result()
                except (InterruptedRunError, InputError, UnfinishedRunError):
                    raise
                except (Exception, CancelledError) as error:  # of the executor, not of the case
                    failure = f"{type(error).__name__}: {error}".rstrip(": ")
                attempts[request.id] += 1
                if (measured is None or died(measured)) and attempts[request.id] < ATTEMPTS:
                    waiting.append(request)
                elif measured is None:
                    failures.append(failure)
                else:
                    store.save(measured, series or None)
                    yield measured
    finally:
        for future in running:
            future.cancel()
    if failures:
        reasons = "; ".join(dict.fromkeys(failures))
        count = "1 case" if len(failures) == 1 else f"{len(failures)} cases"
        raise UnfinishedRunError(f"{count} could not be run: {reasons}")


def _submitted(pool: Pool, request: Request) -> Future[Made]:
    try:
        return pool.executor.submit(execute, request)
    except Exception as error:  # broken or shut down, each executor in its own words
        raise UnfinishedRunError(
            f"the executor takes no more cases: {type(error).__name__}: {error}"
        ) from None
