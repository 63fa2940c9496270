"""The computations behind the report on the paper: run side by side, kept, and read again.

What a computation returns is kept as MessagePack, in which not-a-number and every bit of a
double survive; the type that its function is annotated with says how it is read again.
"""

import functools
import re
import time
import traceback
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_type_hints

import msgspec
import numpy as np

from hbvm_bench.campaign.identity import digest_of
from hbvm_bench.report.document import Claim, Maker
from hbvm_bench.run import executors
from hbvm_bench.store.files import atomic
from problems.errors import InputError

POOL = "concurrent.futures:ProcessPoolExecutor"
NAME = "data/results.msgpack"  # beside the report
SCHEMA = 1


@dataclass(frozen=True)
class Task:
    """One computation: a top-level function, or a `functools.partial` of one, that says what it returns."""

    key: str  # under which its result is found
    run: Callable[[], Any]
    cost: float = 1.0  # rough seconds, so that the long ones start first


def each(key: str, run: Callable[..., Any], values: Iterable[Any], cost: float) -> list[Task]:
    """Return the tasks, ``key value``, that each call a function with one of the values."""
    return [Task(f"{key} {value}", functools.partial(run, value), cost) for value in values]


def split(key: str, run: Callable[..., Any], values: Sequence[float], parts: int, cost: float) -> list[Task]:
    """Return the tasks, ``key 0`` to ``key parts-1``, that each call a function with a part of the values."""
    pieces = [piece.tolist() for piece in np.array_split(np.asarray(values), parts)]
    return [Task(f"{key} {i}", functools.partial(run, piece), cost) for i, piece in enumerate(pieces)]


@dataclass(frozen=True)
class Part:
    """One of the paper's experiments, with its name on the command line and its heading."""

    key: str
    title: str
    runs: Sequence[Task]
    claims: Callable[["Results"], list[Claim]]  # what the paper says and what came out
    blocks: Callable[["Results"], list[Maker]]  # what makes each block that is shown

    @property
    def tasks(self) -> list[Task]:
        """The computations under the names by which they are kept: those of all parts lie side by side."""
        return [Task(f"{self.key}/{task.key}", task.run, task.cost) for task in self.runs]


class Kept(msgspec.Struct, frozen=True):
    """What came out, by task: the packed result, or why there is none; and how it was made."""

    results: dict[str, bytes]
    failed: dict[str, str]
    command: str
    code: str
    schema: int = SCHEMA


class Results:
    """What the computations of a part returned, by their names; asking for one that failed says why.

    What `split` divided is put together again.
    """

    def __init__(self, part: Part, kept: Kept) -> None:
        self.part, self.kept = part.key, kept
        self.tasks = {task.key: task for task in part.tasks}
        self.read: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        key = f"{self.part}/{name}"
        if key not in self.read:
            pieces = [one for one in self.tasks if re.fullmatch(rf"{re.escape(key)} \d+", one)]
            whole = key in self.tasks or not pieces
            self.read[key] = self._one(key) if whole else [row for one in pieces for row in self._one(one)]
        return self.read[key]

    def each(self, name: str, values: Iterable[Any]) -> dict[Any, Any]:
        """Return what the tasks of `each` returned, by their values."""
        return {value: self[f"{name} {value}"] for value in values}

    def _one(self, key: str) -> Any:
        if key not in self.kept.results:
            raise InputError(f"the computation {key!r} {self.kept.failed.get(key, 'was not run')}.")
        return unpacked(self.kept.results[key], self.tasks[key].run)


def run_all(
    tasks: Sequence[Task], jobs: int, command: str, directory: Path, done: Callable[[str, str], None]
) -> Kept:
    """Run tasks in so many processes, or here; keep each result at once, so that an end loses no other.

    Where an earlier run of the same code did not come to its end, this one goes on. ``command`` is printed
    as the way to get it all again, ``directory`` is the report's, and ``done`` is called with the key of
    each task that has ended and what to say of it.
    """
    code = digest_of(tuple({function_of(task.run).__module__ for task in tasks}))
    kept = _unfinished(directory, tasks, code) or Kept({}, {}, command, code)
    for key in kept.results:
        done(key, "kept from the run before")
    left = sorted((task for task in tasks if task.key not in kept.results), key=lambda task: -task.cost)
    for key, data, why, seconds in _outcomes(left, jobs):
        if why:
            kept.failed[key] = why
        else:
            kept.results[key] = data
        save(kept, directory)
        done(key, why or f"{seconds:.1f} s")
    return kept


def _unfinished(directory: Path, tasks: Sequence[Task], code: str) -> Kept | None:
    try:
        kept = load(directory)
    except InputError:
        return None
    whole = {task.key for task in tasks} <= set(kept.results)
    return None if whole or kept.code != code else msgspec.structs.replace(kept, failed={})


def _outcomes(tasks: Sequence[Task], jobs: int) -> Iterator[tuple[str, bytes, str, float]]:
    """Yield key, packed result, why there is none, and seconds, as they come."""
    if jobs == 1:
        for task in tasks:
            yield (task.key, *_outcome(task.run))
        return
    with executors.opened(POOL, jobs) as pool:
        futures = {pool.executor.submit(_outcome, task.run): task.key for task in tasks}
        for future in as_completed(futures):
            try:
                yield (futures[future], *future.result())
            except Exception as error:
                yield futures[future], b"", f"ended with {type(error).__name__}: {error}", 0.0


def save(kept: Kept, directory: Path) -> None:
    """Write the results beside their report, all of them or nothing."""
    with atomic(directory / NAME) as temporary:
        temporary.write_bytes(msgspec.msgpack.encode(kept))


def load(directory: Path) -> Kept:
    """Read the results that lie beside a report.

    Raises
    ------
    problems.errors.InputError
        If there are none, or they were written by another version.
    """
    path = directory / NAME
    try:
        kept = msgspec.msgpack.decode(path.read_bytes(), type=Kept)
    except OSError as error:
        raise InputError(
            f"cannot read {str(path)!r}: {error.strerror}; run hbvm-bench paper first."
        ) from None
    except msgspec.MsgspecError as error:
        raise InputError(f"{str(path)!r} does not hold the paper's results: {error}.") from None
    if kept.schema != SCHEMA:
        raise InputError(f"{str(path)!r} was written by another version; run hbvm-bench paper again.")
    return kept


def packed(value: Any) -> bytes:
    """Return a result as bytes."""
    return zlib.compress(msgspec.msgpack.encode(value, enc_hook=_array_out), 9)


def unpacked(data: bytes, run: Callable[[], Any]) -> Any:
    """Return the result of a computation from its bytes."""
    kind = get_type_hints(function_of(run))["return"]
    return msgspec.msgpack.decode(zlib.decompress(data), type=kind, dec_hook=_array_in)


def function_of(run: Callable[[], Any]) -> Callable[..., Any]:
    """Return the function that a task calls."""
    return run.func if isinstance(run, functools.partial) else run


def _outcome(run: Callable[[], Any]) -> tuple[bytes, str, float]:
    start = time.perf_counter()
    try:
        return packed(run()), "", time.perf_counter() - start
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = f"({Path(last.filename).name}, line {last.lineno})"
        why = f"failed with {type(error).__name__}: {error} {where}"
        return b"", " ".join(why.split()), time.perf_counter() - start


def _array_out(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return (value.shape, np.ascontiguousarray(value, dtype="<f8").tobytes())
    if isinstance(value, np.generic):
        return value.item()
    raise NotImplementedError(f"{type(value).__name__} is no result.")


def _array_in(kind: type, value: Any) -> Any:
    shape, data = value
    return np.frombuffer(data, dtype="<f8").reshape(shape).copy()
