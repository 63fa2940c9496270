"""Runs in one file, small enough for git: a table with a column for everything that is known of a case.

The file is JSON, compressed by ``xz``::

    runs[i].index       what was asked for
    runs[i].beside      what must be known of problems that do not come with the package
    runs[i].columns     lists of equal length by the names of `hbvm_bench.store.records.Record`'s fields
    runs[i].series      the few series that the campaign's page asks for, by case
    drawings            figures of the other series: these have a thousand times the numbers that are shown
    beside              what a study keeps beside its cases

What was computed from the series is in the columns, as it was read when the file was written.
"""

import lzma
from collections.abc import Mapping, Sequence
from copy import copy
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from hbvm_bench.campaign import own
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.reference import solutions
from hbvm_bench.store.records import SCHEMA, Record, decoded
from hbvm_bench.store.store import Index, Store
from problems import limits
from problems.errors import InputError

NAME = "results.json.xz"


class Drawing(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A figure as it was drawn; the fields are those of `hbvm_bench.report.figures.canvas.Picture`.

    ``place`` is the name of the part of the page that it stands in.
    """

    place: str
    key: str
    title: str
    caption: str
    summary: str
    svg: str
    numbers: list[list[str]] = []  # the head, then the rows
    words: int = 0  # how many columns of these hold words
    motion: dict[str, Any] | None = None
    values: bool = False


class Array(msgspec.Struct, frozen=True, kw_only=True):
    """Doubles: their shape, and their bytes, the least significant of each last."""

    shape: list[int]
    data: bytes

    @classmethod
    def packed(cls, values: NDArray[np.float64]) -> "Array":
        """Pack an array; all first bytes of its numbers stand together, which compresses."""
        numbers = np.ascontiguousarray(values, dtype=">f8")
        return cls(shape=list(values.shape), data=numbers.view(np.uint8).reshape(-1, 8).T.tobytes())

    @property
    def values(self) -> NDArray[np.float64]:
        """The array."""
        numbers = np.frombuffer(self.data, np.uint8).reshape(8, -1).T
        return np.ascontiguousarray(numbers).view(">f8").astype(np.float64).reshape(self.shape)


class RunColumns(msgspec.Struct, frozen=True, kw_only=True):
    """One run: what was asked for, its records column by column, and those series that its page keeps."""

    index: Index
    columns: dict[str, list[Any]]
    series: dict[str, dict[str, Array]] = {}
    beside: list[own.Beside] = []


class Contents(msgspec.Struct, frozen=True, kw_only=True):
    """A whole file."""

    runs: list[RunColumns]
    drawings: list[Drawing] = []
    beside: dict[str, Any] = {}
    schema: int = SCHEMA


class Archive:
    """A run that can be read as a `Store` is; it has drawings in the place of series."""

    def __init__(self, path: Path, table: RunColumns, contents: Contents) -> None:
        self.directory = path
        self._kept_beside = contents.beside
        self.drawings = contents.drawings
        self._index = table.index
        rows = zip(*table.columns.values(), strict=True)
        named = [dict(zip(table.columns, row, strict=True)) for row in rows]
        self._records = msgspec.convert(named, list[Record])
        self._beside = table.beside
        self._series = {
            key: {name: array.values for name, array in named.items()} for key, named in table.series.items()
        }

    def series(self, case_id: str) -> dict[str, NDArray[np.float64]]:
        """Return the series of a case that its page keeps, by name."""
        return self._series.get(case_id, {})

    def add_known(self) -> None:
        """Know the problems and references that are stored here, and no other run's."""
        solutions.forget()
        for known in self._beside:
            own.add_known(known)

    def with_records(self, records: list[Record]) -> "Archive":
        """Return the run with some of its records only."""
        part = copy(self)
        part._records = records
        return part

    def beside(self) -> dict[str, Any]:
        """Return what a study keeps beside its cases, by name."""
        return self._kept_beside

    def index(self) -> Index:
        """Return what the run was asked to do."""
        self.add_known()
        return self._index

    def records(self) -> list[Record]:
        """Return the records with what was computed from them, in the order of the campaign."""
        return self._records


def table(
    index: Index, records: Sequence[Record], series: Mapping[str, Mapping[str, NDArray[np.float64]]]
) -> RunColumns:
    """Return records, as `hbvm_bench.measure.reading` reads them, column by column, with series of them."""
    kept = {
        key: {name: Array.packed(v) for name, v in named.items()} for key, named in series.items() if named
    }
    rows = [msgspec.to_builtins(record) for record in records]
    columns = {name: [row[name] for row in rows] for name in Record.__struct_fields__}
    known = [own.beside(make_problem(text)) for text in dict.fromkeys(r.case.problem for r in records)]
    return RunColumns(
        index=index, columns=columns, series=kept, beside=[entry for entry in known if entry != own.Beside()]
    )


def packed(contents: Contents) -> bytes:
    """Return the bytes of an archive; the same contents give the same."""
    return lzma.compress(msgspec.json.encode(contents), preset=9 | lzma.PRESET_EXTREME)


def read(path: Path) -> list[Archive]:
    """Read the runs of an archive, in the order in which they were measured.

    Raises
    ------
    problems.errors.InputError
        If it is something else, or damaged.
    """
    most = int(limits.limit("GIB") * 2**30)
    try:
        unpacking = lzma.LZMADecompressor(memlimit=2**28)
        unpacked = unpacking.decompress(path.read_bytes(), most)
        if not unpacking.eof:
            raise ValueError(f"it is cut, or has more than {most} bytes")
        contents = decoded(unpacked, Contents)
        if contents.schema != SCHEMA:
            raise InputError(f"{str(path)!r} was written by another version; run its campaign again.")
        return [Archive(path, run, contents) for run in contents.runs]
    except InputError:
        raise
    except (OSError, lzma.LZMAError, msgspec.MsgspecError, ValueError, LookupError, TypeError) as error:
        raise InputError(f"{str(path)!r} is no archive of results: {error}.") from None


def opened(places: Sequence[Path]) -> list[Store] | list[Archive]:
    """Return the runs at some places: directories with a store, or one archive, or the directory of one.

    Raises
    ------
    problems.errors.InputError
        For an archive among several places: it has no series to draw together with others.
    """
    archives = [path for place in places for path in (place, place / NAME) if path.is_file()]
    if not archives:
        return [Store(place) for place in places]
    if len(places) > 1:
        raise InputError(f"{str(archives[0])!r} is an archive, which makes a report by itself alone.")
    return read(archives[0])
