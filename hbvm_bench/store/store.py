"""The store of a run: one SQLite file with a row for every case and its arrays.

::

    runs       what was asked for: the campaign and the ids of its cases
    results    one row per case: its `Record` as JSON, and the columns that one looks for
    arrays     those of a case by name, compressed ``.npy``; see `hbvm_bench.measure.raw`
    problems   what is known of a problem that does not come with the package, or its reference

The runner alone writes. A row and its arrays are one transaction, so that the end of a process at any moment
loses and doubles nothing, and a rerun does what is missing. ``runs/NAME`` has ``results.sqlite`` with all
arrays; beside a report lies ``results.sqlite.xz``, with the rows as they were read, of one or several
machines, and those arrays that its page asks for. Nothing is pickled.
"""

import lzma
import shlex
import sqlite3
import weakref
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
import psutil
from numpy.typing import NDArray

from hbvm_bench.campaign import own
from hbvm_bench.campaign.file import Campaign, Case, Goal
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.store import arrays as packing
from hbvm_bench.store.files import ensure_writable
from hbvm_bench.store.records import Record, decoded
from problems import limits, locks
from problems.errors import InputError

FILE, PACKED = "results.sqlite", "results.sqlite.xz"
VERSION = 3
FORMER = ("campaign.json", "results.json.xz")  # of version 0.1
SHARED = ("nfs", "cifs", "smb", "fuse", "9p", "lustre", "gpfs", "beegfs", "ceph", "afs")
"""How file systems of a network are called, whose machines share no memory, which a write-ahead log needs."""

TABLES = """
CREATE TABLE runs (run INTEGER PRIMARY KEY, asked TEXT NOT NULL);
CREATE TABLE results (
    run INTEGER NOT NULL, id TEXT NOT NULL, problem TEXT NOT NULL, method TEXT NOT NULL,
    library TEXT NOT NULL, outcome TEXT NOT NULL, status TEXT NOT NULL, finished TEXT NOT NULL,
    record TEXT NOT NULL,
    PRIMARY KEY (run, id));
CREATE TABLE arrays (
    run INTEGER NOT NULL, id TEXT NOT NULL, name TEXT NOT NULL, data BLOB NOT NULL,
    PRIMARY KEY (run, id, name));
CREATE TABLE problems (run INTEGER NOT NULL, problem TEXT NOT NULL, known TEXT NOT NULL,
    PRIMARY KEY (run, problem));
"""


class Index(msgspec.Struct, frozen=True, kw_only=True):
    """What a run was asked to do.

    Attributes
    ----------
    campaign : Campaign
        As read.
    ids : list of str
        The ids of its cases, in order.
    version : str
        Of this package.
    command : str
        How to run it again.
    cases : list of Case
        The cases, in the order of their ids; empty where they are the campaign's own.
    """

    campaign: Campaign
    ids: list[Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{64}$")]]
    version: str
    command: str
    cases: list[Case] = []

    def listed(self) -> list[tuple[str, Case]]:
        """Return the ids with their cases, in order."""
        return list(zip(self.ids, self.cases or self.campaign.cases(), strict=True))


class StoredRun(msgspec.Struct, frozen=True, kw_only=True):
    """A run as pages are made of it: what was asked for, and the results in the order of the campaign."""

    index: Index
    records: list[Record]


class Store:
    """The rows and arrays of one run in a file; see the module's text.

    Parameters
    ----------
    place : Path, optional
        A directory, in which the file is `FILE`, or `PACKED` where there is only that; or such a file.
        ``None`` for a store in memory, which `packed` returns as bytes.
    run : int
        Which of its runs; only a report has several.
    """

    def __init__(self, place: Path | None = None, run: int = 1) -> None:
        self.directory = Path(place or "memory")
        self.run = run
        self._open: sqlite3.Connection | None = None
        self._owner: Store | None = None  # of the connection, which is closed with it
        if place is None:
            self._keep_open(sqlite3.connect(":memory:"))
            self._database.executescript(TABLES)

    @property
    def path(self) -> Path:
        """Where the file is, or will be."""
        if self.directory.is_file():
            return self.directory
        path, packed = self.directory / FILE, self.directory / PACKED
        return packed if packed.is_file() and not path.is_file() else path

    def prepare(self) -> None:
        """Make the file, or refuse a place that cannot be written."""
        ensure_writable(self.directory)
        with self._told():
            if not self.path.is_file():
                self._keep_open(sqlite3.connect(self.path))
                self._database.executescript(f"BEGIN; {TABLES} PRAGMA user_version={VERSION}; COMMIT;")
            self._database.execute(f"PRAGMA journal_mode={_journal(self.directory)}")
            self._database.execute("PRAGMA synchronous=NORMAL")

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other runs out of the directory; the lock ends with the process, however it ends.

        Raises
        ------
        problems.errors.InputError
            If another run is writing there.
        """
        with ExitStack() as stack:
            try:
                stack.enter_context(locks.held(self.directory, wait=False))
            except BlockingIOError:
                raise InputError(
                    f"another run is writing to {str(self.directory)!r}; "
                    "wait for its end, or give another --out."
                ) from None
            except OSError:  # a file system without locks; two runs there repeat work but harm nothing
                pass
            try:
                yield
            finally:
                with suppress(sqlite3.Error):  # one file remains, unless somebody reads it now
                    self._database.execute("PRAGMA journal_mode=DELETE")

    def load(self, case_id: str) -> Record | None:
        """Return the record of a case, or ``None`` if it is missing or unreadable."""
        if self._open is None and not self.path.is_file():
            return None
        for (text,) in self._rows("SELECT record FROM results WHERE run=? AND id=?", case_id):
            with suppress(ValueError):
                return decoded(text.encode(), Record)
        return None

    def has(self, case_id: str) -> bool:
        """Whether there is a record of a case, be it readable or not."""
        return bool(self._rows("SELECT 1 FROM results WHERE run=? AND id=?", case_id))

    def save(
        self,
        record: Record,
        arrays: Mapping[str, NDArray[np.float64]] | Mapping[str, bytes] | None = None,
        *,
        compress: bool = True,
    ) -> None:
        """Store a record, and its arrays in the same transaction; those that it has stay without.

        Arrays are not compressed for a file that is compressed as a whole.
        """
        with self._writing() as database:
            self._put(database, record)
            if arrays is not None:
                database.execute("DELETE FROM arrays WHERE run=? AND id=?", (self.run, record.id))
                blobs = (
                    (name, data if isinstance(data, bytes) else packing.packed(data, compress=compress))
                    for name, data in arrays.items()
                )
                rows = ((self.run, record.id, *blob) for blob in blobs)
                database.executemany("INSERT INTO arrays VALUES (?,?,?,?)", rows)

    def renew(self, records: Sequence[Record]) -> None:
        """Store records whose arrays stay, all of them in one transaction."""
        with self._writing() as database:
            for record in records:
                self._put(database, record)

    def _put(self, database: sqlite3.Connection, record: Record) -> None:
        result, text = record.result, msgspec.json.encode(record).decode()
        row = (self.run, record.id, record.case.problem, record.case.method, record.library)
        row += (result.outcome, result.status, record.finished, text)
        database.execute("INSERT OR REPLACE INTO results VALUES (?,?,?,?,?,?,?,?,?)", row)

    def series(self, case_id: str) -> dict[str, NDArray[np.float64]]:
        """Return the arrays of a case by name; empty where it has none.

        Raises
        ------
        problems.errors.InputError
            If one is damaged.
        """
        try:
            return {name: packing.unpacked(data) for name, data in self.packed_series(case_id).items()}
        except ValueError as error:
            raise InputError(f"{str(self.path)!r} is damaged: {error}; {self.again()}.") from None

    def packed_series(self, case_id: str) -> dict[str, bytes]:
        """Return the arrays of a case as they are stored, by name."""
        rows = self._rows("SELECT name, data FROM arrays WHERE run=? AND id=? ORDER BY rowid", case_id)
        return {name: data for name, data in rows if packing.NAME.fullmatch(name)}

    def write_index(self, index: Index, known: own.Known = own.NOTHING) -> None:
        """Store what the run was asked to do, and what is ``known`` of its problems."""
        for text in dict.fromkeys(case.problem for _, case in index.listed()):
            with suppress(InputError):  # of a plugin that is not here
                self.keep(text, known)
        with self._writing() as database:
            asked = msgspec.json.encode(index).decode()
            database.execute("INSERT OR REPLACE INTO runs VALUES (?,?)", (self.run, asked))

    def keep(self, text: str, known: own.Known) -> None:
        """Store the formula of a problem of the user's own, and a reference that was made for the run."""
        beside = known.beside(make_problem(text, known))
        if beside != own.Beside():
            row = self.run, text, msgspec.json.encode(beside).decode()
            with self._writing() as database:
                database.execute("INSERT OR REPLACE INTO problems VALUES (?,?,?)", row)

    def known(self) -> own.Known:
        """Return the problems and references that are stored here; no code is run."""
        known = own.NOTHING
        if self._open is not None or self.path.is_file():
            for (text,) in self._rows("SELECT known FROM problems WHERE run=?"):
                with suppress(ValueError, LookupError, TypeError):  # damaged: whoever needs it says so
                    known |= own.known_from(decoded(text.encode(), own.Beside))
        return known

    def goals(self) -> list[Goal]:
        """Return the goals of the run that is here, with their dates; none where there is no run."""
        with suppress(InputError):
            return self.index().campaign.goals
        return []

    def index(self) -> Index:
        """Return what the run was asked to do.

        Raises
        ------
        problems.errors.InputError
            If the place holds no run.
        """
        self._require()
        rows = self._rows("SELECT asked FROM runs WHERE run=?")
        if not rows:
            raise self._no_run()
        try:
            index = decoded(rows[0][0].encode(), Index)
            cases = index.cases or index.campaign.cases()
            if len(index.ids) != len(cases) or len(set(index.ids)) != len(cases):
                raise ValueError(f"{len(set(index.ids))} ids of {len(cases)} cases")
        except ValueError as error:  # msgspec's errors and ours are among them
            words = str(error).rstrip(".")
            raise InputError(f"{str(self.path)!r} has no index of a run: {words}.") from None
        return index

    def records(self) -> list[Record]:
        """Return the records of the run that are there, in the order of the campaign.

        Labels and notes are the campaign's present ones: they are words, and no reason to run again.

        Raises
        ------
        problems.errors.InputError
            If there is no run, or one of its rows is damaged.
        """
        listed = self.index().listed()
        rows = dict(self._rows("SELECT id, record FROM results WHERE run=?"))
        records: list[Record] = []
        for case_id, case in listed:
            if case_id not in rows:
                continue
            try:
                record = decoded(rows[case_id].encode(), Record)
            except ValueError as error:
                words = f"the row of {case.method} on {case.problem} in {str(self.path)!r} is damaged"
                raise InputError(f"{words}: {error}; {self.again()}.") from None
            words = msgspec.structs.replace(record.case, settings=case.settings, note=case.note)
            records.append(msgspec.structs.replace(record, case=words))
        return records

    def computed(self) -> dict[str, Record]:
        """Return the rows of the computations of a study, by their keys: the last of each."""
        rows = self._rows("SELECT record FROM results WHERE run=? AND problem='' ORDER BY finished, rowid")
        records = (decoded(text.encode(), Record) for (text,) in rows)
        return {record.case.method: record for record in records}

    def everything(self) -> Iterator[Record]:
        """Yield all records of the run, those of earlier sources and other settings too."""
        for (text,) in self._rows("SELECT record FROM results WHERE run=? ORDER BY rowid"):
            with suppress(ValueError):
                yield decoded(text.encode(), Record)

    def again(self) -> str:
        """Say how to repair a run; its own command may be a stranger's, and is not for pasting."""
        return f"run its campaign again with --out {shlex.quote(str(self.directory))}"

    def runs(self) -> list["Store"]:
        """Return the store of each run in the file, in the order in which they were measured."""
        self._require()
        numbers = [number for (number,) in self._all("SELECT run FROM runs ORDER BY run")]
        if not numbers:
            raise self._no_run()
        stores = [Store(self.directory, number) for number in numbers]
        for store in stores:
            store._open, store._owner = self._database, self
        return stores

    def packed(self) -> bytes:
        """Return the file as bytes, compressed; what was stored in the same order gives the same bytes."""
        self._database.execute(f"PRAGMA user_version={VERSION}")
        content = self._database.serialize()
        return lzma.compress(content, preset=9 | lzma.PRESET_EXTREME)

    @property
    def _database(self) -> sqlite3.Connection:
        if self._open is None:
            self._keep_open(_connected(self.path))
        assert self._open is not None
        return self._open

    def _keep_open(self, database: sqlite3.Connection) -> None:
        self._open = database
        weakref.finalize(self, database.close)

    def _rows(self, query: str, *given: str) -> list[tuple[Any, ...]]:
        return self._all(query, self.run, *given)

    def _all(self, query: str, *given: object) -> list[tuple[Any, ...]]:
        with self._told():
            return self._database.execute(query, given).fetchall()

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        with self._told(), self._database as database:
            yield database

    @contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.OperationalError as error:
            full = "No space left on device" if "full" in str(error) else str(error)
            raise InputError(f"cannot read or write {str(self.path)!r}: {full}.") from error
        except sqlite3.DatabaseError as error:
            raise InputError(f"{str(self.path)!r} is no store of results: {error}.") from error

    def _no_run(self) -> InputError:
        return InputError(f"{str(self.path)!r} has no run yet; make one with: hbvm-bench run.")

    def _require(self) -> None:
        """Refuse a place without a store, in one sentence."""
        if self._open is not None or self.path.is_file():
            return
        if any((self.directory / name).is_file() for name in FORMER):
            raise InputError(
                f"{str(self.directory)!r} has results of hbvm-bench 0.1; read them with that version "
                "(pip install 'hbvm-bench==0.1.*'), or run the campaign again."
            )
        there = "has no results" if self.directory.is_dir() else "does not exist"
        raise InputError(f"the directory {str(self.directory)!r} {there}; make some with: hbvm-bench run.")


def _connected(path: Path) -> sqlite3.Connection:
    """Open a file that may be a stranger's, and that of another version.

    Raises
    ------
    problems.errors.InputError
        If it is something else, or damaged.
    """
    try:
        if path.suffix == ".xz":
            database = sqlite3.connect(":memory:")
            database.deserialize(_decompressed(path))
        else:
            database = sqlite3.connect(f"{path.resolve().as_uri()}?mode=rw", uri=True)
        database.execute("PRAGMA trusted_schema=OFF")
        (version,) = database.execute("PRAGMA user_version").fetchone()
        tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type='table'")}
    except (OSError, sqlite3.Error, lzma.LZMAError, ValueError) as error:
        raise InputError(f"{str(path)!r} is no store of results: {error}.") from None
    if "results" in tables and version == VERSION:
        return database
    database.close()
    if "results" in tables:
        raise InputError(f"{str(path)!r} was written by another version; run its campaign again.")
    raise InputError(f"{str(path)!r} is no store of results: it has no table of them.")


def _decompressed(path: Path) -> bytes:
    most = int(limits.limit("GIB") * 2**30)
    unpacking = lzma.LZMADecompressor(memlimit=2**28)
    content = unpacking.decompress(path.read_bytes(), most)
    if not unpacking.eof:
        raise ValueError(f"it is cut, or has more than {most} bytes")
    return content


def _journal(directory: Path) -> str:
    """Return how SQLite keeps transactions in a directory: by a log, beside which others read, or not."""
    place = directory.resolve()
    mounts = {Path(part.mountpoint): part.fstype.lower() for part in psutil.disk_partitions(all=True)}
    kind = next((mounts[folder] for folder in (place, *place.parents) if folder in mounts), "")
    return "DELETE" if kind.startswith(SHARED) else "WAL"


def opened(places: Sequence[Path]) -> list[Store]:
    """Return the runs at some places."""
    return [store for place in places for store in Store(place).runs()]


def progress(record: Record) -> tuple[bool, int, str]:
    """Return what orders records of one case, by which the greatest is kept.

    A measured case before a failure, then the one with more rounds of timing, then the later one.
    """
    rounds = len(record.timing.rounds) if record.timing else 0
    return record.result.outcome == "ok", rounds, record.finished
