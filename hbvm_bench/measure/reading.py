"""Metrics of stored cases: evaluated from the series when read, and kept until their rule changes."""

from contextlib import suppress
from functools import cache

import msgspec
import numpy as np
from numpy.typing import NDArray

from hbvm_bench.campaign.identity import digest_of, make_problem
from hbvm_bench.measure import metrics
from hbvm_bench.measure.measured import restore
from hbvm_bench.reference import solutions
from hbvm_bench.store.records import Record
from hbvm_bench.store.store import Store, damage
from problems.errors import InputError


def records(store: Store) -> list[Record]:
    """Return the records of a run as `Store.records` does, all with the metrics of today.

    Those that an earlier rule evaluated are evaluated again from their series, and written where
    no run is writing, so that this is done once.

    Raises
    ------
    problems.errors.InputError
        If the directory holds no run.
    """
    read = store.records()
    stale = {record.id for record in read if _is_stale(record)}
    if not stale:
        return read
    made = {record.id: evaluated(record, store.series(record.id)) for record in read if record.id in stale}
    with suppress(InputError, OSError), store.locked():  # else the next reader evaluates them again
        for key in stale:
            stored = store.load(key)
            if stored is not None and _is_stale(stored):  # with the words of its own time
                store.save(msgspec.structs.replace(made[key], case=stored.case))
    return [made.get(record.id, record) for record in read]


def evaluated(record: Record, series: dict[str, NDArray[np.float64]]) -> Record:
    """Return a record with its metrics, and where its trajectory is another one than was asked for."""
    problem = make_problem(record.case.problem)
    if record.result.outcome not in ("ok", "stalled") or damage(record, series, problem.system.dim):
        return record
    measured = restore(problem, series, record.result, solutions.find(problem), record.timing)
    result = msgspec.structs.replace(
        record.result, metrics=metrics.evaluate(measured), violation=metrics.guard_violation(measured)
    )
    return msgspec.structs.replace(record, result=result, evaluated_by=rule())


@cache
def rule() -> str:
    """Return the digest of the sources that make metrics of series."""
    return digest_of((metrics.__name__,))


def _is_stale(record: Record) -> bool:
    # without a digest it is a record of an earlier version, which kept too little to evaluate it again
    return record.evaluated_by not in ("", rule())
