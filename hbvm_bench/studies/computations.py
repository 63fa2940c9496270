"""The computations behind the page of a study: run side by side, stored beside the cases, and read again.

They are no integrations of a campaign: bisections, maps of many initial conditions, sections, orders. What
one returns is stored as MessagePack, in which not-a-number and every bit of a double survive; the type
that its function is annotated with says how it is read again.
"""

import functools
import itertools
import re
import time
import traceback
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_type_hints

import msgspec
import numpy as np

from hbvm_bench.campaign.identity import digest_of
from hbvm_bench.report.document import Block, Claim, Claims, Maker, Section, attempt
from hbvm_bench.run import executors
from hbvm_bench.store.records import Record
from hbvm_bench.store.store import Store
from problems.errors import InputError

POOL = "concurrent.futures:ProcessPoolExecutor"


@dataclass(frozen=True)
class Task:
    """One computation: a top-level function, or a `functools.partial` of one, that says what it returns."""

    key: str  # under which its result is found
    run: Callable[[], Any]
    cost: float = 1.0  # rough seconds, so that the long ones start first
    timed: bool = False  # whether it takes times, so that nothing may run beside it


def each(key: str, run: Callable[..., Any], values: Iterable[Any], cost: float) -> list[Task]:
    """Return the tasks, ``key value``, that each call a function with one of the values."""
    return [Task(f"{key} {value}", functools.partial(run, value), cost) for value in values]


def split(key: str, run: Callable[..., Any], values: Sequence[float], parts: int, cost: float) -> list[Task]:
    """Return the tasks, ``key 0`` to ``key parts-1``, that each call a function with a part of the values."""
    pieces = [piece.tolist() for piece in np.array_split(np.asarray(values), parts)]
    return [Task(f"{key} {i}", functools.partial(run, piece), cost) for i, piece in enumerate(pieces)]


@dataclass(frozen=True)
class Part:
    """One of the experiments of a study, with its name in the store and its heading."""

    key: str
    title: str
    runs: Sequence[Task]
    claims: Callable[["PartResults"], list[Claim]]  # published values and computed ones
    blocks: Callable[["PartResults"], list[Maker]]  # what makes each block that is shown

    @property
    def tasks(self) -> list[Task]:
        """The computations under the names by which they are stored: those of all parts lie side by side."""
        return [replace(task, key=f"{self.key}/{task.key}") for task in self.runs]


class StoredResults(msgspec.Struct, frozen=True):
    """Results by task: the packed result, or why there is none; and by what code."""

    results: dict[str, bytes]
    failed: dict[str, str]
    code: str


class PartResults:
    """What the computations of a part returned, by their names; asking for one that failed says why.

    What `split` divided is put together again. ``records`` are the cases of the run, by method.
    """

    def __init__(
        self, part: Part, stored: StoredResults, records: Mapping[str, Record] | None = None
    ) -> None:
        self.part, self.stored, self.records = part.key, stored, records or {}
        self.tasks = {task.key: task for task in part.tasks}
        self.read: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        key = f"{self.part}/{name}"
        if key not in self.read:
            pieces = [piece for piece in self.tasks if re.fullmatch(rf"{re.escape(key)} \d+", piece)]
            whole = key in self.tasks or not pieces
            self.read[key] = (
                self._result(key) if whole else [row for piece in pieces for row in self._result(piece)]
            )
        return self.read[key]

    def each(self, name: str, values: Iterable[Any]) -> dict[Any, Any]:
        """Return what the tasks of `each` returned, by their values."""
        return {value: self[f"{name} {value}"] for value in values}

    def _result(self, key: str) -> Any:
        if key not in self.stored.results:
            raise InputError(f"the computation {key!r} {self.stored.failed.get(key, 'was not run')}.")
        return unpacked(self.stored.results[key], self.tasks[key].run)


def claims_of(
    parts: Sequence[tuple[Part, PartResults]], title: str, nav: str, given: str = "paper"
) -> Section:
    """Return every claim of the parts with the published value, called ``given``, and the computed one."""

    def claims(part: Part, results: PartResults) -> Claims:
        return Claims([(part.title, part.key, part.claims(results))])

    makers = [
        (f"the claims of {part.title}", functools.partial(claims, part, results)) for part, results in parts
    ]
    blocks = attempt(*makers)
    groups = [group for block in blocks if isinstance(block, Claims) for group in block.groups if group[2]]
    failed: list[Block] = [block for block in blocks if not isinstance(block, Claims)]
    return Section(title, [Claims(groups, given), *failed], "all-claims", nav=nav)


def sections_of(parts: Sequence[tuple[Part, PartResults]]) -> list[Section]:
    """Return the section of each part."""
    return [
        Section(part.title, attempt(*part.blocks(results)), part.key, nav=part.title)
        for part, results in parts
    ]


def computing(
    name: str, parts: Callable[[bool], Sequence[Part]]
) -> Callable[[Store, int, Callable[[str], None]], None]:
    """Return the function that computes what a store lacks of a study, as ``COMPUTATIONS`` name it.

    ``parts`` returns the experiments, given whether the run is quick.
    """

    def compute(store: Store, jobs: int, tell: Callable[[str], None]) -> None:
        quick = store.index().campaign.quick
        tasks = [task for part in parts(quick) for task in part.tasks]
        ended = itertools.count(1)

        def done(key: str, said: str) -> None:
            tell(f"  computation {next(ended)} of at most {len(tasks)}, {key}: {said}")

        run_all(name, tasks, jobs, store, done, variant="quick" * quick)

    return compute


def run_all(
    name: str,
    tasks: Sequence[Task],
    jobs: int,
    store: Store,
    done: Callable[[str, str], None],
    variant: str = "",
) -> StoredResults:
    """Run tasks in so many processes, or here; keep each result at once, so that an end loses no other.

    Those that this code has computed for the store, in the same variant, are not run again. ``name`` is that
    of what the store keeps, and ``done`` is called with the key of each task that has ended and what to say
    of it.
    """
    code = digest_of(tuple({function_of(task.run).__module__ for task in tasks})) + variant
    stored = StoredResults({}, {}, code)
    with suppress(InputError):
        before = load(name, store.studies())
        stored = StoredResults(before.results, {}, code) if before.code == code else stored
    left = sorted((task for task in tasks if task.key not in stored.results), key=lambda task: -task.cost)
    for key, data, why, seconds in _outcomes(left, jobs):
        if why:
            stored.failed[key] = why
        else:
            stored.results[key] = data
        store.keep_study(name, stored)
        done(key, why or f"{seconds:.1f} s")
    return stored


def _outcomes(tasks: Sequence[Task], jobs: int) -> Iterator[tuple[str, bytes, str, float]]:
    """Yield key, packed result, why there is none, and seconds, as they come."""
    together = [task for task in tasks if not task.timed] if jobs > 1 else []
    yield from _side_by_side(together, jobs)
    for task in tasks:
        if task not in together:
            yield (task.key, *_outcome(task.run))


def _side_by_side(tasks: Sequence[Task], jobs: int) -> Iterator[tuple[str, bytes, str, float]]:
    if not tasks:
        return
    with executors.opened(POOL, jobs) as pool:
        futures = {pool.executor.submit(_outcome, task.run): task.key for task in tasks}
        for future in as_completed(futures):
            try:
                yield (futures[future], *future.result())
            except Exception as error:
                yield futures[future], b"", f"ended with {type(error).__name__}: {error}", 0.0


def load(name: str, beside: Mapping[str, object]) -> StoredResults:
    """Return what a store keeps of a study beside its cases.

    Raises
    ------
    problems.errors.InputError
        If there is nothing, or something else.
    """
    if name not in beside:
        raise InputError(f"the computations of {name} were not run; run hbvm-bench {name} first.")
    try:
        return msgspec.convert(beside[name], StoredResults)
    except msgspec.ValidationError as error:
        raise InputError(f"what is kept of the computations of {name} is damaged: {error}.") from None


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
