"""What lies beside a report: its rows as they were read, and the curves that its figures are drawn from."""

from collections.abc import Sequence
from pathlib import Path

from hbvm_bench.measure import machine, reading
from hbvm_bench.report.page import Results
from hbvm_bench.store.records import Record, machine_of
from hbvm_bench.store.store import Store
from problems.errors import InputError


def contents(results: Results, stores: Sequence[Store]) -> Store:
    """Return the store that is kept of the runs that a page is made of."""
    kept = Store()
    for number, (store, run) in enumerate(zip(stores, results.runs, strict=True), 1):
        kept.run = number
        kept.write_index(run.index, store.known())
        for record in run.records:
            kept.save(record, results.series.get(record.id, {}), compress=False)
        for record in store.computed().values():
            kept.save(record, store.series(record.id), compress=False)
    return kept


def joined(store: Store, before: Path) -> list[Store]:
    """Return a run with those of an earlier report that it stands beside, in the order they were measured.

    They are those of other kinds of processor, and on the same kind those of problems that were not run
    this time; each keeps the machine, the versions, the command and the date that it was measured with.
    """
    records = reading.records(store)
    if not before.is_file() or not records:
        return [store]
    kind, again = machine.kind(machine_of(records)), {record.case.problem for record in records}
    runs = []
    for old in Store(before).runs():
        if old.index().campaign.name != store.index().campaign.name:
            raise InputError(
                f"{str(before)!r} has results of {old.index().campaign.name!r}; give another place."
            )
        left = [record for record in old.records() if record.case.problem not in again]
        kept = old.records() if machine.kind(machine_of(old.records())) != kind else left
        if kept:
            runs.append(old if len(kept) == len(old.records()) else _with_records(old, kept))
    return [*runs, store]


def _with_records(store: Store, records: Sequence[Record]) -> Store:
    """Return a run with some of its records only; those that it lacks then have not run."""
    part = Store()
    part.write_index(store.index(), store.known())
    for record in records:
        part.save(record, store.packed_series(record.id))
    return part
