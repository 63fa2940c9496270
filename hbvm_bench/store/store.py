"""The store: one atomic JSON file per case, its series beside it, and an index.

::

    DIR/campaign.json        what was asked for: the campaign and the ids of its cases
    DIR/cases/<id>.json      one record per case
    DIR/cases/<id>.npz       its series, as the integration gave them; see `hbvm_bench.measure.raw`
    DIR/readings/<id>.json   what was computed from them last; see `hbvm_bench.measure.reading`
    DIR/problems/<name>.json what is known of a problem that does not come with the package, or its reference

A file is complete or not there, so that the store is also the cache: a rerun
does what is missing. Nothing is pickled.
"""

import hashlib
import io
import math
import re
import shlex
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from hbvm_bench.campaign import own
from hbvm_bench.campaign.file import Campaign, Case, Goal
from hbvm_bench.campaign.identity import make_method, make_problem, of_method
from hbvm_bench.campaign.spec import Spec, parse_spec
from hbvm_bench.reference import solutions
from hbvm_bench.store.files import atomic, ensure_writable, write_json
from hbvm_bench.store.records import SCHEMA, Outcome, Reading, Record, Result, decoded
from problems import limits, locks
from problems.errors import InputError

INDEX = "campaign.json"
CASES = "cases"
READINGS = "readings"
PROBLEMS = "problems"
NAME_LENGTH = 24  # of the 64 digits of an id; 96 bits
NAME = re.compile(r"\w[\w .-]{0,99}")
SERIES = ("t", "y")  # every trajectory has them
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
    ids: list[Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{64}$")]]  # they are file names, too
    version: str
    command: str
    cases: list[Case] = []
    schema: int = SCHEMA

    def listed(self) -> list[tuple[str, Case]]:
        """Return the ids with their cases, in order."""
        return list(zip(self.ids, self.cases or self.campaign.cases(), strict=True))


class _Version(msgspec.Struct):
    schema: int = SCHEMA


class OtherVersionError(ValueError):
    """A record is sound, but an earlier or later version of this package wrote it."""


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
            yield

    def load(self, case_id: str) -> Record | None:
        """Return the record of a case, or ``None`` if it is missing or unreadable."""
        try:
            return self._read(case_id)
        except (OSError, ValueError):
            return None

    def has(self, case_id: str) -> bool:
        """Whether there is a record of a case, be it readable or not."""
        return self._record_path(case_id).exists()

    def save(self, record: Record, series: Mapping[str, NDArray[np.float64]] | bytes | None = None) -> None:
        """Store a record, its series first so that a record never lacks them."""
        if series is not None:
            encoded = series if isinstance(series, bytes) else encode_series(series)
            with atomic(self._series_path(record.id)) as path:
                path.write_bytes(encoded)
        write_json(self._record_path(record.id), record)

    def series(self, case_id: str) -> dict[str, NDArray[np.float64]]:
        """Return the series of a case by name; empty where it has none."""
        return decode_series(self.series_file(case_id))

    def series_file(self, case_id: str) -> bytes:
        """Return the ``.npz`` file of a case as it is; empty where it has none, or none that can be read."""
        try:
            return self._series_path(case_id).read_bytes()
        except OSError:
            return b""

    def reading(self, case_id: str) -> Reading | None:
        """Return what was computed from a case last, or ``None``."""
        try:
            return decoded(self._reading_path(case_id).read_bytes(), Reading)
        except (OSError, ValueError):
            return None

    def keep_reading(self, case_id: str, reading: Reading) -> None:
        """Store what was computed from a case; it is made again from the series where it is lost."""
        path = self._reading_path(case_id)
        path.parent.mkdir(exist_ok=True)
        with atomic(path) as temporary:
            temporary.write_bytes(msgspec.json.encode(reading))

    def write_index(self, index: Index) -> None:
        """Store what the run was asked to do, and its problems where they do not come with the package."""
        for text in dict.fromkeys(case.problem for _, case in index.listed()):
            with suppress(InputError):  # of a plugin that is not here
                self.keep(text)
        write_json(self.directory / INDEX, index)

    def keep(self, text: str) -> None:
        """Store the formula of a problem of the user's own, and a reference that was made here."""
        known = own.beside(make_problem(text))
        if known != own.Beside():
            name = hashlib.sha256(text.encode()).hexdigest()[:NAME_LENGTH]
            (self.directory / PROBLEMS).mkdir(parents=True, exist_ok=True)
            write_json(self.directory / PROBLEMS / f"{name}.json", known)

    def add_known(self) -> None:
        """Know the problems and references that are stored here, and no other run's; no code is run."""
        solutions.forget()
        for path in (self.directory / PROBLEMS).glob("[!.]*.json"):
            with suppress(OSError, ValueError, LookupError, TypeError):  # damaged: whoever needs it says so
                own.add_known(decoded(path.read_bytes(), own.Beside))

    def goals(self) -> list[Goal]:
        """Return the goals of the run that is here, with their dates; none where there is no run."""
        with suppress(OSError, ValueError):
            return decoded((self.directory / INDEX).read_bytes(), Index).campaign.goals
        return []

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
        self.add_known()
        try:
            index = decoded(content, Index)
            cases = index.cases or index.campaign.cases()
        except ValueError as error:  # msgspec's errors and ours are among them
            words = str(error).rstrip(".")
            raise InputError(f"{self.directory / INDEX} is not the index of a run: {words}.") from None
        if len(index.ids) != len(cases) or len(set(index.ids)) != len(cases):
            raise InputError(
                f"{self.directory / INDEX} is damaged: {len(set(index.ids))} ids of {len(cases)} cases; "
                f"what has run is kept, {again(index, self.directory)}."
            )
        return index

    def records(self) -> list[Record]:
        """Return the records of the run that are there, in the order of the campaign.

        Labels and notes are the campaign's present ones: they are words, and no reason to run again.
        A record that cannot be read is one that says so.
        """
        records: list[Record] = []
        index = self.index()
        for case_id, case in index.listed():
            try:
                record = self._read(case_id)
                if not is_of(record.case, case):
                    raise ValueError("it is the record of another case")
            except FileNotFoundError:
                continue
            except (OSError, ValueError) as error:
                records.append(_unread(case_id, case, error, again(index, self.directory)))
                continue
            words = msgspec.structs.replace(record.case, settings=case.settings, note=case.note)
            records.append(msgspec.structs.replace(record, case=words))
        return records

    def beside(self) -> dict[str, Any]:
        """Return what a study keeps beside its cases, by name: the other JSON files of the directory."""
        contents = {}
        for path in sorted(self.directory.glob("*.json")):
            if path.name != INDEX:
                with suppress(OSError, ValueError):
                    contents[path.stem] = decoded(path.read_bytes(), object)
        return contents

    def everything(self) -> Iterator[Record]:
        """Yield all records in the directory, those of earlier versions and other settings too."""
        for path in sorted(self.cases.glob("[!.]*.json")):
            with suppress(OSError, ValueError):
                yield self._read(path.stem)

    def _read(self, case_id: str) -> Record:
        """Return the record of a case, by its id or as much of it as is in the file's name."""
        content = self._record_path(case_id).read_bytes()
        schema = decoded(content, _Version).schema
        if schema != SCHEMA:
            when = "an earlier" if schema < SCHEMA else "a later"
            raise OtherVersionError(f"measured by {when} version of hbvm-bench")
        record = decoded(content, Record)
        if case_id not in (record.id, record.id[:NAME_LENGTH]):
            raise ValueError("it is the record of another case")
        return record

    def _record_path(self, case_id: str) -> Path:
        return self.cases / f"{case_id[:NAME_LENGTH]}.json"

    def _reading_path(self, case_id: str) -> Path:
        return self.directory / READINGS / f"{case_id[:NAME_LENGTH]}.json"

    def _series_path(self, case_id: str) -> Path:
        return self.cases / f"{case_id[:NAME_LENGTH]}.npz"


def is_of(stored: Case, asked: Case) -> bool:
    """Whether the case of a record is the one asked for; labels and notes are words and do not count."""
    words = msgspec.structs.replace(
        asked, problem=stored.problem, method=stored.method, settings=stored.settings, note=stored.note
    )
    texts = (asked.problem, stored.problem, _problem), (asked.method, stored.method, _method)
    return words == stored and all(
        ours == theirs or _prints_as(ours, theirs, tolerance) for ours, theirs, tolerance in texts
    )


def _prints_as(asked: str, stored: str, printed: Callable[[str], str]) -> bool:
    with suppress(InputError):
        try:
            return printed(asked) == stored
        except InputError:  # of a plugin that is not here
            return parse_spec(asked).name == parse_spec(stored).name
    return False


def _problem(text: str) -> str:
    return repr(make_problem(text))


def _method(text: str) -> str:
    return str(Spec(parse_spec(text).name, make_method(text).options()))


def _unread(case_id: str, case: Case, error: Exception, again: str) -> Record:
    """Return the row of a case whose record cannot be used."""
    outcome: Outcome = "damaged"
    reason = f"its record in the store is damaged ({' '.join(str(error).split())}); {again}"
    if isinstance(error, OtherVersionError):
        outcome, reason = "outdated", f"{error}; {again}"
    with suppress(InputError):
        case = msgspec.structs.replace(case, problem=_problem(case.problem))
    known: dict[str, Any] = {"role": "peer", "library": "", "order": None}  # of a plugin that is not here
    with suppress(InputError):
        case = msgspec.structs.replace(case, method=_method(case.method))
        known = of_method(make_method(case.method))
    return Record(id=case_id, case=case, result=Result(outcome=outcome, reason=reason), **known)


def again(index: Index, directory: Path) -> str:
    """Say how to repair a run; its own command may be a stranger's, and is not for pasting."""
    return f"run the campaign {index.campaign.name!r} again with --out {shlex.quote(str(directory))}"


def damage(record: Record, series: Mapping[str, NDArray[np.float64]], dim: int) -> str:
    """Return what is wrong with the series of a case, ``""`` where they are as a run writes them.

    A record without a trajectory has none; ``dim`` is the length of a state.
    """
    if record.result.outcome in ("damaged", "outdated"):
        return "there is no record of them"
    if record.result.outcome not in ("ok", "stalled"):
        return ""
    if absent := [name for name in SERIES if name not in series]:
        return f"there is no {absent[0]}"
    t, y = series["t"], series["y"]
    lengths = {name: t.size for name in series if name.startswith(("distance", "error.", "guard."))}
    if "position_t" in series:  # of an earlier version, as is the distance
        lengths |= dict.fromkeys(("position", "phase"), series["position_t"].size)
    if t.ndim != 1 or y.shape != (t.size, dim):
        return f"t has the shape {t.shape} and y {y.shape}"
    if "starts.y0" in series and series["starts.y0"].shape[1:] != (dim,):
        return f"its further initial conditions have the shape {series['starts.y0'].shape}"
    states = (len(series.get("starts.y0", ())), t.size, dim)
    if "starts.y0" in series and getattr(series.get("starts.y"), "shape", ()) != states:
        return "the states of its further trajectories do not belong to its times"
    if "reversal.y" in series and series["reversal.y"].shape != (1, dim):
        return f"its way back ends in the shape {series['reversal.y'].shape}"
    sizes = {"chaos.megno": (1,), "chaos.exponent": (3,)}
    if wrong := [name for name, size in sizes.items() if name in series and series[name].shape != size]:
        return f"{wrong[0]} has the shape {series[wrong[0]].shape}"
    subset = series.get("witness.index", np.empty(0))
    if not np.all((subset >= 0) & (subset < t.size)) or any(
        getattr(series.get(f"witness.{part}"), "shape", ()) != (subset.size, dim)
        for part in ("high", "low")
        if subset.size
    ):
        return "its reference subset is not among its trajectories"
    if wrong := [name for name, length in lengths.items() if series[name].shape != (length,)]:
        return f"{wrong[0]} has the shape {series[wrong[0]].shape}, beside {lengths[wrong[0]]} times"
    if drifts := [name for name in series if name.startswith("drift.")]:
        times = series.get("drift.t", np.empty(0))
        if times.ndim != 1 or any(series[name].shape[-1:] != times.shape for name in drifts):
            return "the errors of its drift do not belong to the times of it"
    if series.get("extra.dt_history", np.empty((0, 2))).shape[1:] != (2,):
        return "its step sizes have no times"
    steps = np.diff(t)
    if record.case.ensemble is None:
        if not np.isfinite(t).all() or not (np.all(steps > 0) or np.all(steps < 0)):
            return "its times do not go one way"
        if not np.isfinite(y[:1]).all() or (record.result.status == "finished" and not np.isfinite(y).all()):
            return "its states are not finite"
    return ""


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
    """Return the arrays of a ``.npz`` file by name; empty if it is not one of ours.

    It may be cut or something else; be far larger than it looks; have pickles, texts or complex
    numbers; or have names that are none, for names go into pages and file names.

    Raises
    ------
    problems.errors.InputError
        If the environment's limit of memory is no number.
    """
    most = limits.limit("GIB") * 2**30
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            if sum(member.file_size for member in archive.infolist()) > most:
                return {}
            arrays = {name.removesuffix(".npy"): _array(archive.read(name)) for name in archive.namelist()}
    except Exception:  # zipfile and numpy raise a dozen kinds, and the content is a stranger's
        return {}
    ours = all(NAME.fullmatch(name) and array.dtype.kind in "fiu" for name, array in arrays.items())
    return arrays if ours else {}


@lru_cache(maxsize=128)  # a run's series are alike
def _header(content: bytes) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    stream = io.BytesIO(content)
    np.lib.format.read_magic(stream)
    return np.lib.format.read_array_header_1_0(stream)


def _array(content: bytes) -> NDArray[np.float64]:
    """Read a ``.npy`` file whose header promises no more than follows it."""
    start = 10 + int.from_bytes(content[8:10], "little")
    shape, fortran, dtype = _header(content[:start])
    if math.prod(shape) * dtype.itemsize != len(content) - start:
        raise ValueError("its header says another size")
    array = np.frombuffer(content, dtype, offset=start)  # refuses what would need pickles
    return np.atleast_1d(array.reshape(shape, order="F" if fortran else "C").copy())
