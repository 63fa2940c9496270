"""What lies beside a report: its rows as they were read, and the figures of arrays that it does not keep.

A page made from it has the same tables, sentences and figures; a figure of arrays is drawn anew only from a
run, which has the arrays.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import msgspec

from hbvm_bench.measure import machine, reading
from hbvm_bench.report.document import Document, Section
from hbvm_bench.report.figures.canvas import Picture
from hbvm_bench.store.records import Record
from hbvm_bench.store.store import Store
from hbvm_bench.store.stored_run import StoredRun
from problems.errors import InputError

PLACE = "problem-"  # how the anchors of the sections begin whose figures are of arrays


def contents(document: Document, runs: Sequence[StoredRun], stores: Sequence[Store]) -> Store:
    """Return the store that is kept of the runs that a document is made of, and of its figures."""
    kept = Store()
    for number, (store, run) in enumerate(zip(stores, runs, strict=True), 1):
        kept.run = number
        store.add_known()
        kept.write_index(run.index)
        named = run.index.campaign.page.series
        for record in run.records:
            arrays = reading.drawn(record, store.series(record.id)) if named else {}
            kept.save(record, {name: arrays[name] for name in named if name in arrays}, compress=False)
        for record in store.computed().values():
            kept.save(record, store.series(record.id), compress=False)
    for section, picture in _drawn(document):
        kept.keep_figure(section.key, encoded(picture))
    return kept


def _drawn(document: Document) -> Iterator[tuple[Section, Picture]]:
    for part in document.walk():
        if isinstance(part, Section) and part.key.startswith(PLACE):
            yield from ((part, block) for block in part.blocks if isinstance(block, Picture))


def joined(store: Store, before: Path) -> list[Store]:
    """Return a run with those of an earlier report that it stands beside, in the order they were measured.

    They are those of other kinds of processor, and on the same kind those of problems that were not run
    this time; each keeps the machine, the versions, the command and the date that it was measured with.
    """
    records = reading.records(store)
    if not before.is_file() or not records:
        return [store]
    kind, again = machine.kind(_machine(records)), {record.case.problem for record in records}
    runs = []
    for old in Store(before).runs():
        if old.index().campaign.name != store.index().campaign.name:
            raise InputError(
                f"{str(before)!r} has results of {old.index().campaign.name!r}; give another place."
            )
        left = [record for record in old.records() if record.case.problem not in again]
        kept = old.records() if machine.kind(_machine(old.records())) != kind else left
        if kept:
            runs.append(old if len(kept) == len(old.records()) else _with_records(old, kept))
    return [*runs, store]


def _with_records(store: Store, records: Sequence[Record]) -> Store:
    """Return a run with some of its records only; those that it lacks then have not run."""
    part = Store()
    part.write_index(store.index())
    for record in records:
        part.save(record, store.packed_series(record.id))
    return part


def _machine(records: Sequence[Record]) -> dict[str, str | int]:
    return StoredRun.machine_of(records)


def encoded(picture: Picture) -> str:
    """Return a figure as JSON."""
    return msgspec.json.encode(picture, enc_hook=list).decode()


def pictures(stored: Sequence[tuple[str, str]], place: str) -> list[Picture]:
    """Return the figures that were drawn in one section of a page."""
    return [msgspec.json.decode(text, type=Picture) for where, text in stored if where == place]
