"""Readings: errors, their growth and metrics, computed from the stored series by pure functions.

A reading is kept beside the records, in ``readings/``, until the record, its reference, or a source that
makes it changes; a change makes it anew and runs no integration.
"""

import hashlib
from contextlib import suppress
from functools import cache

import msgspec

from hbvm_bench.campaign.identity import digest_of, make_problem
from hbvm_bench.measure import measured, metrics
from hbvm_bench.measure.measured import Measured, Series
from hbvm_bench.reference import solutions
from hbvm_bench.store.archive import Archive
from hbvm_bench.store.records import Reading, Record
from hbvm_bench.store.store import Store, damage
from problems.errors import InputError


def records(store: Store | Archive) -> list[Record]:
    """Return the records of a run as `Store.records` does, with their readings.

    Raises
    ------
    problems.errors.InputError
        If the directory holds no run.
    """
    stored = store.records()
    return stored if isinstance(store, Archive) else [up_to_date(store, record) for record in stored]


def up_to_date(store: Store, record: Record) -> Record:
    """Return a record of a store with its reading: the one that is kept, or a new one, which is then kept."""
    if record.result.outcome not in ("ok", "stalled") or record.result.metrics:
        return record
    reading = store.reading(record.id)
    try:
        reference = solutions.digest(make_problem(record.case.problem))
    except InputError:  # of a plugin that is not here
        return record if reading is None else with_reading(record, reading)
    content = msgspec.json.encode([rule(), reference, record.id, record.finished, record.timing])
    digest = hashlib.sha256(content).hexdigest()
    if reading is None or reading.digest != digest:
        reread = read(record, store.series(record.id))
        reading = Reading(
            metrics=reread.result.metrics,
            violation=reread.result.violation,
            growth=reread.result.growth,
            digest=digest,
        )
        with suppress(InputError, OSError):  # where nothing can be written it is read again next time
            store.keep_reading(record.id, reading)
    return with_reading(record, reading)


def read(record: Record, series: Series) -> Record:
    """Return a record with its error growth and metrics, and whether it follows another trajectory."""
    case_measured = case_of(record, series)
    if case_measured is None:
        return record
    case_measured = measured.with_growth(case_measured, record.case.checks)
    reading = Reading(
        metrics=metrics.evaluate(case_measured),
        violation=metrics.guard_violation(case_measured),
        growth=case_measured.growth,
    )
    return with_reading(record, reading)


def case_of(record: Record, series: Series) -> Measured | None:
    """Return what is measured on a case, without error growth; ``None`` where it has no trajectory.

    A case that was read by an earlier version, which kept too little to read it again, has none either.
    """
    problem = make_problem(record.case.problem)
    unusable = record.result.outcome not in ("ok", "stalled") or damage(record, series, problem.system.dim)
    if unusable or is_read(series):
        return None
    known = solutions.find(problem)
    asked = record.case.ensemble
    return measured.measure(problem, record.result, series, known, record.timing, ensemble=asked)


def drawn(record: Record, series: Series) -> Series:
    """Return the series that figures are drawn from: errors, distances and positions beside the states."""
    case_measured = case_of(record, series)
    return series if case_measured is None else case_measured.series()


def is_read(series: Series) -> bool:
    """Whether these series are a reading of an earlier version, and not what a worker returned."""
    return "distance" in series


def with_reading(record: Record, reading: Reading) -> Record:
    """Return a record with a reading in the place of its own."""
    result = msgspec.structs.replace(
        record.result, metrics=reading.metrics, violation=reading.violation, growth=reading.growth
    )
    return msgspec.structs.replace(record, result=result)


@cache
def rule() -> str:
    """Return the digest of the sources that make readings of series."""
    return digest_of((metrics.__name__,))
