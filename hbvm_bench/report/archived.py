"""A report's archive: the records as a table, and the figures of series as they were drawn.

A page made from it has the same tables, sentences and figures; a figure of series is drawn anew only from a
store, which has the series.
"""

from collections.abc import Sequence
from pathlib import Path

from hbvm_bench.measure import machine, reading
from hbvm_bench.report.document import Document, Section
from hbvm_bench.report.figures.canvas import Picture
from hbvm_bench.store import archive
from hbvm_bench.store.archive import Archive, Contents, Drawing
from hbvm_bench.store.records import Record
from hbvm_bench.store.store import Store
from hbvm_bench.store.stored_run import StoredRun
from hbvm_bench.summaries.table import Table
from problems.errors import InputError

FORMER_HEADS = {"law": "growth"}  # of the tables of figures, in archives that are older
PLACE = "problem-"  # how the anchors of the sections begin whose figures are of series


def contents(document: Document, stores: Sequence[Store | Archive]) -> Contents:
    """Return what is kept of the runs that a document is made of, and of its figures."""
    sections = [part for part in document.walk() if isinstance(part, Section) and part.key.startswith(PLACE)]
    beside = {name: value for store in stores for name, value in store.beside().items()}
    return Contents(
        runs=[_table(store) for store in stores],
        drawings=[
            _drawing(section.key, picture)
            for section in sections
            for picture in section.blocks
            if isinstance(picture, Picture)
        ],
        beside=beside,
    )


def joined(store: Store, before: Path) -> list[Store | Archive]:
    """Return a run with those of an earlier archive that it stands beside, in the order they were measured.

    They are those of other kinds of processor, and on the same kind those of problems that were not run
    this time; each keeps the machine, the versions, the command and the date that it was measured with.
    """
    records = reading.records(store)
    if not before.is_file() or not records:
        return [store]
    kind, again = machine.kind(_machine(records)), {record.case.problem for record in records}
    runs = []
    for old in archive.read(before):
        if old.index().campaign.name != store.index().campaign.name:
            raise InputError(
                f"{str(before)!r} has results of {old.index().campaign.name!r}; give another place."
            )
        left = [record for record in old.records() if record.case.problem not in again]
        kept = old.records() if machine.kind(_machine(old.records())) != kind else left
        runs += [old.with_records(kept)] if kept else []
    return [*runs, store]


def _machine(records: Sequence[Record]) -> dict[str, str | int]:
    return StoredRun.machine_of(records)


def _table(store: Store | Archive) -> archive.RunColumns:
    index, records = store.index(), reading.records(store)
    store.add_known()
    named = tuple(index.campaign.page.series)
    series = {
        record.id: {
            name: values
            for name, values in (
                store.series(record.id)
                if isinstance(store, Archive)
                else reading.drawn(record, store.series(record.id))
            ).items()
            if name in named
        }
        for record in (records if named else [])
    }
    return archive.table(index, records, series)


def pictures(drawings: Sequence[Drawing], place: str) -> list[Picture]:
    """Return the figures that were drawn in one section of a page."""
    return [_picture(drawing) for drawing in drawings if drawing.place == place]


def _drawing(place: str, picture: Picture) -> Drawing:
    table = picture.numbers
    return Drawing(
        place=place,
        key=picture.key,
        title=picture.title,
        caption=picture.caption,
        summary=picture.summary,
        svg=picture.svg,
        numbers=[] if table is None else [list(table.head), *map(list, table.rows)],
        words=0 if table is None else len(table.words),
        motion=picture.motion,
        values=picture.values,
    )


def _picture(drawing: Drawing) -> Picture:
    head, *rows = [tuple(row) for row in drawing.numbers] or [()]
    head = tuple(FORMER_HEADS.get(name, name) for name in head)
    return Picture(
        drawing.key,
        drawing.title,
        drawing.caption,
        drawing.summary,
        drawing.svg,
        Table("", head, rows, words=range(drawing.words)) if head else None,
        drawing.motion,
        values=drawing.values,
    )
