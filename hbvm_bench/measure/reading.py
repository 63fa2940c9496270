"""Readings: errors, their growth and metrics, computed from the stored series by pure functions.

A reading is kept in the user's cache under a digest of all that it depends on: the record, its reference, and
what is installed; a change makes it anew and runs no integration.
"""

from functools import cache
from pathlib import Path

import msgspec

import problems
from hbvm_bench.campaign import folder
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.campaign.own import NOTHING, Known
from hbvm_bench.measure import measured, metrics
from hbvm_bench.measure.measured import Measured, Series
from hbvm_bench.reference import solutions
from hbvm_bench.store.records import Reading, Record
from hbvm_bench.store.store import Store
from integrators.kernel.native import store as kept
from problems.errors import InputError


def records(store: Store) -> list[Record]:
    """Return the records of a run as `Store.records` does, with their readings."""
    known = store.known()
    return [up_to_date(store, record, known) for record in store.records()]


def up_to_date(store: Store, record: Record, known: Known = NOTHING) -> Record:
    """Return a record of a store with its reading: the one that is kept, or a new one, which is then kept."""
    if record.result.outcome not in ("ok", "stalled") or record.result.metrics:
        return record
    try:
        reference = solutions.find_file(make_problem(record.case.problem, known), known.references)
    except InputError:  # of a plugin that is not here
        return record
    content = msgspec.json.encode(["" if reference is None else reference.digest, record])
    arrays = (part for named in store.packed_series(record.id).items() for part in named)
    key = kept.key("reading", rule(), content, *arrays)
    if (there := kept.get(key)) is not None:
        return with_reading(record, msgspec.json.decode(there, type=Reading))
    try:
        reread = read(record, store.series(record.id), known)
    except (LookupError, ValueError, TypeError) as error:
        raise InputError(
            f"the arrays of {record.case.method} on {record.case.problem} cannot be read "
            f"({type(error).__name__}: {error}); {store.again()}."
        ) from error
    kept.put(key, msgspec.json.encode(msgspec.convert(reread.result, Reading, from_attributes=True)))
    return reread


def read(record: Record, series: Series, known: Known = NOTHING) -> Record:
    """Return a record with its error growth and metrics, and whether it follows another trajectory."""
    case_measured = case_of(record, series, known)
    if case_measured is None:
        return record
    case_measured = measured.with_growth(case_measured, record.case.checks)
    reading = Reading(
        metrics=metrics.evaluate(case_measured),
        violation=metrics.guard_violation(case_measured),
        growth=case_measured.growth,
    )
    return with_reading(record, reading)


def case_of(record: Record, series: Series, known: Known = NOTHING) -> Measured | None:
    """Return what is measured on a case, without error growth; ``None`` where it has no trajectory.

    A report has of a case only what is drawn: errors and distances, and not what a worker returned.
    """
    returned = {"t", "y"} <= {*series} and "distance" not in series
    if record.result.outcome not in ("ok", "stalled") or not returned:
        return None
    problem = make_problem(record.case.problem, known)
    reference = solutions.find(problem, known.references)
    asked = record.case.ensemble
    return measured.measure(problem, record.result, series, reference, record.timing, ensemble=asked)


def drawn(record: Record, series: Series, known: Known = NOTHING) -> Series:
    """Return the series that figures are drawn from: errors, distances and positions beside the states."""
    case_measured = case_of(record, series, known)
    return series if case_measured is None else case_measured.series()


def with_reading(record: Record, reading: Reading) -> Record:
    """Return a record with a reading in the place of its own."""
    result = msgspec.structs.replace(record.result, **msgspec.structs.asdict(reading))
    return msgspec.structs.replace(record, result=result)


@cache
def rule() -> str:
    """Return the digest of the sources that make readings of series."""
    return folder.digest(Path(__file__).parent) + folder.digest(Path(problems.__file__).parent)
