"""A report's archive: the records as a table, and the figures of series as they were drawn.

A page made from it has the same tables, sentences and figures; a figure of series is drawn anew only from a
store, which has the series.
"""

from collections.abc import Sequence

from hbvm_bench.measure import reading
from hbvm_bench.report.document import Document, Section
from hbvm_bench.report.figures.canvas import Picture
from hbvm_bench.store import archive
from hbvm_bench.store.archive import Archive, Contents, Drawing
from hbvm_bench.store.store import Store
from hbvm_bench.summaries.table import Table

PLACE = "problem-"  # how the anchors of the sections begin whose figures are of series


def contents(document: Document, stores: Sequence[Store] | Sequence[Archive]) -> Contents:
    """Return what is kept of the runs that a document is made of, and of its figures."""
    sections = [one for one in document.walk() if isinstance(one, Section) and one.key.startswith(PLACE)]
    return Contents(
        runs=[archive.table(store.index(), reading.records(store)) for store in stores],
        drawings=[
            _drawing(section.key, picture)
            for section in sections
            for picture in section.blocks
            if isinstance(picture, Picture)
        ],
    )


def pictures(drawings: Sequence[Drawing], place: str) -> list[Picture]:
    """Return the figures that were drawn in one section of a page."""
    return [_picture(one) for one in drawings if one.place == place]


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
