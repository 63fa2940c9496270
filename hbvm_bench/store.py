"""The store: one atomic JSON file per case, its series beside it, and an index.

::

    DIR/campaign.json        what was asked for: the campaign and the ids of its cases
    DIR/cases/<id>.json      one record per case
    DIR/cases/<id>.npz       its series

A file is complete or not there, so that the store is also the cache: a rerun
does what is missing. Nothing is pickled.
"""

import fcntl
import io
import os
import tempfile
import threading
import time
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from hbvm_bench.campaign import Campaign, Case
from hbvm_bench.records import SCHEMA, Record
from problems.errors import InputError

INDEX = "campaign.json"
CASES = "cases"
NAME_LENGTH = 24  # of the 64 digits of an id; 96 bits
FORGOTTEN = 3600.0  # seconds after which a half-written file has nobody who writes it


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
    ids: list[str]
    version: str
    command: str
    cases: list[Case] = []
    schema: int = SCHEMA

    def listed(self) -> list[tuple[str, Case]]:
        """Return the ids with their cases, in order."""
        return list(zip(self.ids, self.cases or self.campaign.cases(), strict=True))


class Store:
    """Records and series in a directory; see the module's text."""

    def __init__(self, directory: Path) -> None:
        self.directory = Path(directory)
        self.cases = self.directory / CASES

    def prepare(self) -> None:
        """Make the directories, or refuse a place that cannot be written.

        Raises
        ------
        problems.errors.InputError
            If nothing can be written there; nothing is left behind.
        """
        ensure_writable(self.cases)
        for path in self.cases.glob(".*.part"):  # of a runner that was killed while it wrote
            with suppress(FileNotFoundError):
                if time.time() - path.stat().st_mtime > FORGOTTEN:
                    path.unlink()

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other runs out of the directory; the lock ends with the process, however it ends.

        Raises
        ------
        problems.errors.InputError
            If another run is writing there.
        """
        handle = os.open(self.directory, os.O_RDONLY)
        try:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise InputError(
                    f"another run is writing to {str(self.directory)!r}; "
                    "wait for its end, or give another --out."
                ) from None
            except OSError:  # a file system without locks; two runs there repeat work but harm nothing
                pass
            yield
        finally:
            os.close(handle)

    def load(self, case_id: str) -> Record | None:
        """Return the record of a case, or ``None`` if it is missing or unreadable."""
        try:
            record = msgspec.json.decode(self._record_path(case_id).read_bytes(), type=Record)
        except (FileNotFoundError, msgspec.MsgspecError):
            return None
        return record if record.id == case_id and record.schema == SCHEMA else None

    def save(self, record: Record, series: Mapping[str, NDArray[np.float64]] | bytes | None = None) -> None:
        """Store a record, its series first so that a record never lacks them."""
        if series is not None:
            encoded = series if isinstance(series, bytes) else encode_series(series)
            with atomic(self._series_path(record.id)) as path:
                path.write_bytes(encoded)
        encoded = msgspec.json.format(msgspec.json.encode(record), indent=1)
        with atomic(self._record_path(record.id)) as path:
            path.write_bytes(encoded + b"\n")

    def series(self, case_id: str) -> dict[str, NDArray[np.float64]]:
        """Return the series of a case by name; empty where it has none."""
        return decode_series(self.series_file(case_id))

    def series_file(self, case_id: str) -> bytes:
        """Return the ``.npz`` file of a case as it is; empty where it has none."""
        try:
            return self._series_path(case_id).read_bytes()
        except FileNotFoundError:
            return b""

    def write_index(self, index: Index) -> None:
        """Store what the run was asked to do."""
        with atomic(self.directory / INDEX) as path:
            path.write_bytes(msgspec.json.format(msgspec.json.encode(index), indent=1) + b"\n")

    def index(self) -> Index:
        """Return what the run was asked to do.

        Raises
        ------
        problems.errors.InputError
            If the directory holds no run.
        """
        try:
            content = (self.directory / INDEX).read_bytes()
        except (FileNotFoundError, NotADirectoryError):
            there = "has no results" if self.directory.is_dir() else "does not exist"
            raise InputError(
                f"the directory {str(self.directory)!r} {there}; make some with: hbvm-bench run."
            ) from None
        except OSError as error:
            raise InputError(f"cannot read {str(self.directory)!r}: {error.strerror}.") from None
        try:
            return msgspec.json.decode(content, type=Index)
        except (msgspec.MsgspecError, InputError) as error:
            raise InputError(f"{self.directory / INDEX} is not the index of a run: {error}.") from None

    def records(self) -> list[Record]:
        """Return the records of the run that are there, in the order of the campaign.

        Labels and notes are the campaign's present ones: they are words, and no reason to run again.
        """
        made: list[Record] = []
        for case_id, case in self.index().listed():
            if (record := self.load(case_id)) is not None:
                words = msgspec.structs.replace(record.case, settings=case.settings, note=case.note)
                made.append(msgspec.structs.replace(record, case=words))
        return made

    def everything(self) -> Iterator[Record]:
        """Yield all records in the directory, those of earlier versions and other settings too."""
        for path in sorted(self.cases.glob("[!.]*.json")):
            try:
                record = msgspec.json.decode(path.read_bytes(), type=Record)
            except (OSError, ValueError):
                continue
            if record.schema == SCHEMA and path == self._record_path(record.id):
                yield record

    def _record_path(self, case_id: str) -> Path:
        return self.cases / f"{case_id[:NAME_LENGTH]}.json"

    def _series_path(self, case_id: str) -> Path:
        return self.cases / f"{case_id[:NAME_LENGTH]}.npz"


def progress(record: Record) -> tuple[bool, int, str]:
    """Return what orders records of one case, by which the greatest is kept.

    A measured case before a failure, then the one with more rounds of timing, then the later one.
    """
    rounds = len(record.timing.rounds) if record.timing else 0
    return record.result.outcome == "ok", rounds, record.finished


def encode_series(series: Mapping[str, NDArray[np.float64]]) -> bytes:
    """Return arrays by name as a compressed ``.npz`` file without pickles."""
    stream = io.BytesIO()
    np.savez_compressed(stream, allow_pickle=False, **series)  # pyright: ignore[reportArgumentType]
    return stream.getvalue()


def decode_series(content: bytes) -> dict[str, NDArray[np.float64]]:
    """Return the arrays of a ``.npz`` file by name; empty if it is cut, something else, or has pickles."""
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except (ValueError, TypeError, EOFError, OSError, zipfile.BadZipFile, zlib.error):
        return {}


@contextmanager
def atomic(path: Path) -> Iterator[Path]:
    """Yield a temporary path that becomes ``path`` if the block succeeds, and vanishes if not."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}.part")
    try:
        yield temporary
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def ensure_writable(directory: Path) -> None:
    """Make a directory and try to write in it; on failure leave nothing behind.

    Raises
    ------
    problems.errors.InputError
        With the reason.
    """
    made: list[Path] = []
    try:
        missing = [path for path in (directory, *directory.parents) if not path.exists()]
        for path in reversed(missing):
            path.mkdir(exist_ok=True)
            made.append(path)
        with tempfile.TemporaryFile(dir=directory):
            pass
    except OSError as error:
        for path in reversed(made):
            path.rmdir()
        raise InputError(f"cannot write to the directory {str(directory)!r}: {error.strerror}.") from None
