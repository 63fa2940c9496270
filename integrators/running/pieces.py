"""The pieces of an ensemble: who integrates them, what is gathered of them, and what is kept in a file."""

import hashlib
import pickle
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import BrokenExecutor, Executor, Future
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.events.event import Event
from integrators.events.finder import started_with_events
from integrators.events.members import begun, follow, one_by_one, own_times
from integrators.protocol import (
    Array,
    Batches,
    BatchesAlong,
    BatchesEvents,
    MethodBase,
    Program,
    Status,
    Threads,
    Trajectories,
    offers,
    telling,
)
from integrators.reduce import Reducer
from integrators.running.integrate import prepared
from integrators.solution.ensemble import Solutions
from integrators.solution.occurrences import Occurrences
from integrators.solution.segments import Segments
from problems.errors import InputError, shown
from problems.problem import Problem

TRIES = 2  # of a piece whose worker has died
WINDOW = 64  # pieces that an executor has at a time

Numbers = NDArray[np.int64]


def alone(
    program: Program,
    starts: Array,
    par: Array,
    times: Array,
    t0: float,
    threads: int,
    sample: str | None,
    directions: tuple[Array, Array] | None = None,
) -> Trajectories:
    """Integrate trajectories one by one as `integrate` does, or as many at once as there are threads.

    Parameters
    ----------
    program : Program
        The compiled method.
    starts, par : ndarray, shapes (n, dim), (n, n_par)
        Starts and parameters.
    times : ndarray, shape (m,) or (n, m)
        Times asked for.
    t0 : float
        Time of the starts.
    threads : int
        How many.
    sample : str or None
        As for `integrate`; with ``"steps"`` the times are those of each trajectory's steps.
    directions : pair of ndarray, shapes (n, dim, k), (n, n_par, k), optional
        Tangent vectors at the start of each trajectory.

    Returns
    -------
    Trajectories
        Rows that are shorter than others end with NaN.
    """

    def member(i: int, stop: threading.Event) -> Trajectories:
        along = None if directions is None else (directions[0][i], directions[1][i])
        return _single(program, starts[i], par[i], own_times(times, i), t0, sample, stop, along)

    return joined(one_by_one(member, len(starts), threads), times)


def joined(members: list[Trajectories], times: Array) -> Trajectories:
    """Return batches of one trajectory as one; rows that are shorter than others end with NaN."""
    width = max(member.y.shape[1] for member in members)
    t, y = (
        np.full((len(members), width), np.nan),
        np.full((len(members), width, members[0].y.shape[2]), np.nan),
    )
    for i, member in enumerate(members):
        t[i, : member.t.size], y[i, : member.y.shape[1]] = member.t, member.y[0]
    shared = np.ndim(times) == 1 and all(member.t is times for member in members)
    return Trajectories(
        times if shared else t,
        y,
        [member.status[0] for member in members],
        [member.reason[0] for member in members],
        np.concatenate([member.t_stop for member in members]),
        np.concatenate([member.steps for member in members]),
        extra={i: extra for i, member in enumerate(members) for extra in member.extra.values()},
        variations=_joined_variations(members, y),
    )


def _joined_variations(members: list[Trajectories], y: Array) -> Array | None:
    """Return the variations of batches of one as those of one batch, where they have any."""
    count = max(
        (member.variations.shape[-1] for member in members if member.variations is not None), default=0
    )
    if not count:
        return None
    vectors = np.full((*y.shape, count), np.nan)
    for i, member in enumerate(members):
        if member.variations is not None:
            vectors[i, : member.variations.shape[1]] = member.variations[0]
    return vectors


def _single(
    program: Any,
    y0: Array,
    par: Array,
    times: Array,
    t0: float,
    sample: str | None,
    stop: threading.Event,
    along: tuple[Array, Array] | None,
) -> Trajectories:
    stepper, known = begun(lambda: program.start(y0, par, t0), y0, times, t0, stop)
    if stepper is None:
        return known
    if along is not None:
        stepper.follow(*along)
    if sample == "steps":
        samples = stepper.advance(np.array([t0, times[-1]]) if times[0] == t0 else times[-1:], sample=sample)
        t, y = samples.t, samples.y[np.newaxis]
    else:
        samples = stepper.advance(times, sample=sample)
        t, y = times, known.y
        y[0, : samples.t.size] = samples.y
    end = times[-1] if samples.status is Status.FINISHED else stepper.t
    steps = np.array([stepper.stats.steps])
    vectors = None if along is None else stepper.variations[np.newaxis]
    result = Trajectories(
        t, y, [samples.status], [samples.reason], np.array([end]), steps, variations=vectors
    )
    result.extra[0] = telling(stepper.stats)
    return result


def in_batches(
    program: Program, times: Array, sample: str | None, directions: tuple[Array, Array] | None
) -> bool:
    """Whether a program integrates such trajectories, with such tangent vectors, together."""
    if sample is not None or times.ndim != 1 or not offers(program, Batches):
        return False
    along: Any = program
    return directions is None or (offers(program, BatchesAlong) and along.goes_along(directions))


def integrate_with(
    program: Any,
    starts: Array,
    par: Array,
    times: Array,
    t0: float,
    threads: int,
    sample: str | None,
    directions: tuple[Array, Array] | None = None,
) -> Trajectories:
    """Integrate some trajectories: in lanes where the program can and the times are those of all."""
    if not in_batches(program, times, sample, directions):
        return alone(program, starts, par, times, t0, threads, sample, directions)
    if directions is not None:
        return program.batch_along(starts, par, times=times, t0=t0, directions=directions, threads=threads)
    options = {"threads": threads} if offers(program, Threads) and program.threaded else {}
    return program.batch(starts, par, times=times, t0=t0, **options)


def finds_in_batches(start: Any, times: Array) -> bool:
    """Whether what `started_with_events` returned finds the events of such trajectories together."""
    return times.ndim == 1 and offers(start, BatchesEvents) and start.goes_in_batches()


def find_with(
    start: Any, starts: Array, par: Array, times: Array, t0: float, threads: int
) -> tuple[Trajectories, list[dict[str, Occurrences]]]:
    """Integrate some trajectories and look for their events: in lanes where that can be, or one by one."""
    if finds_in_batches(start, times):
        return start.find_in_batch(starts, par, times, t0, threads)
    members = follow(start, starts, par, times, t0, threads)
    return joined([item for item, _ in members], times), [happened for _, happened in members]


def integrate_piece(problem: Problem, method: MethodBase, *piece: Any) -> Trajectories:
    """Integrate some trajectories in a worker: `integrate_with` its own program."""
    return integrate_with(prepared(method, problem.system)[0], *piece)


@dataclass(eq=False)
class Search:
    """What a worker looks for; the functions are compiled once, where the first piece arrives."""

    problem: Problem
    method: MethodBase
    events: Mapping[str, Event]

    @cached_property
    def start(self) -> Callable[..., Any]:
        """What starts a trajectory that looks for the events."""
        program = prepared(self.method, self.problem.system)[0]
        return started_with_events(program, self.method, self.problem, self.events)


def find_in_piece(
    problem: Problem, method: MethodBase, search: Search, *piece: Any
) -> tuple[Trajectories, list[dict[str, Occurrences]]]:
    """Integrate some trajectories in a worker and look for their events: starts, par, times, t0, threads."""
    return find_with(search.start, *piece)


class Gathered:
    """What is known of the trajectories of an ensemble.

    Parameters
    ----------
    problem, method
        What is integrated, and how.
    starts, par : ndarray, shapes (n, dim), (n, n_par)
        Starts and parameters.
    times : ndarray, shape (m,) or (n, m)
        Times asked for.
    sample : str or None
        With ``"steps"`` each trajectory has times of its own.
    reducer : Reducer or None
        What goes through the states, of which only the last ones are kept then.
    directions : pair of ndarray, or None
        Tangent vectors at the starts; see `alone`.
    """

    def __init__(
        self, problem: Problem, method: MethodBase, starts: Array, par: Array, times: Array,
        sample: str | None, reducer: Reducer | None, directions: tuple[Array, Array] | None,
    ):  # fmt: skip
        n = len(starts)
        self._problem, self._method, self._starts, self._par = problem, method, starts, par
        self._times, self._reducer, self._directions = times, reducer, directions
        width = 1 if reducer is not None else 0 if sample == "steps" else times.shape[-1]
        nothing: tuple[Array, Array] = np.empty(0), np.empty((0, starts.shape[1]))
        self._rows = [nothing] * n if sample == "steps" and reducer is None else None
        self._same = times.ndim == 1 and sample != "steps"  # whether all have the same times
        self._last = np.full(n, np.nan)  # the last time of each, where their states are reduced
        if reducer is not None and sample != "steps":
            rows = np.broadcast_to(times, (n, times.shape[-1]))
            self._last = rows[np.arange(n), np.isfinite(rows).sum(axis=1) - 1]
        self._y = np.full((n, width, starts.shape[1]), np.nan)
        self._variations: Array | None = None
        if directions is not None:
            self._variations = np.full((*self._y.shape, directions[0].shape[2]), np.nan)
        self._status = [Status.INTERRUPTED] * n
        self._reason = ["Ctrl-C was pressed before it was at its end."] * n
        self._stop, self._steps = np.full(n, problem.t0), np.zeros(n, dtype=np.int64)
        self._extra: dict[int, dict[str, Any]] = {}
        self._events: dict[int, dict[str, Occurrences]] = {}

    def missing(self, size: int) -> list[Numbers]:
        """Return the numbers of what is not integrated, in pieces."""
        numbers = np.flatnonzero([status is Status.INTERRUPTED for status in self._status])
        return [numbers[i : i + size] for i in range(0, len(numbers), size)]

    def __len__(self) -> int:
        return len(self._status)

    @property
    def share(self) -> float:
        """The part that is integrated."""
        return 1.0 - self._status.count(Status.INTERRUPTED) / len(self._status)

    @property
    def steps(self) -> int:
        """Steps of all."""
        return int(self._steps.sum())

    def take(self, numbers: Numbers, result: Any, events: list[dict[str, Occurrences]] | None = None) -> None:
        """Take the trajectories of these numbers, or a text on why there are none."""
        if isinstance(result, str):
            for i in numbers.tolist():
                self._reason[i] = (
                    f"its worker ended ({result}); resume it from a checkpoint, or run it again."
                )
            return
        chosen = numbers.tolist()
        if self._reducer is not None:
            self._reduce(self._reducer, numbers, result.t, result.y, events or [])
        elif self._rows is not None:
            for i, t, y in zip(chosen, np.broadcast_to(result.t, result.y.shape[:2]), result.y, strict=True):
                there = ~np.isnan(t)
                self._rows[i] = t[there], y[there]
        else:
            self._y[numbers, : result.y.shape[1]] = result.y
        if self._variations is not None and result.variations is not None:
            self._variations[numbers, : result.variations.shape[1]] = result.variations
        for i, status, reason in zip(chosen, result.status, result.reason, strict=True):
            self._status[i], self._reason[i] = status, reason
        self._stop[numbers], self._steps[numbers] = result.t_stop, result.steps
        self._extra.update({chosen[i]: extra for i, extra in result.extra.items() if extra})
        self._events.update(zip(chosen, events or (), strict=False))

    def _reduce(
        self, reducer: Reducer, numbers: Numbers, t: Array, y: Array, events: list[dict[str, Occurrences]]
    ) -> None:
        """Take the states of some trajectories, and keep the last one of each."""
        t = np.broadcast_to(t, y.shape[:2])
        missing = self._times.shape[-1] - t.shape[1] if self._times.ndim == 2 else 0
        if missing > 0:  # each of these has fewer times than others
            t = np.pad(t, ((0, 0), (0, missing)), constant_values=np.nan)
            y = np.pad(y, ((0, 0), (0, missing), (0, 0)), constant_values=np.nan)
        reducer.take(numbers, t, y, self._parameters(numbers, t, y, events))
        some = np.flatnonzero(np.isfinite(t).any(axis=1))
        last = np.isfinite(t[some]).sum(axis=1) - 1
        self._y[numbers[some], 0], self._last[numbers[some]] = y[some, last], t[some, last]

    def _parameters(
        self, numbers: Numbers, t: Array, y: Array, events: list[dict[str, Occurrences]]
    ) -> Array:
        """Return the parameters of some trajectories, or of each of their samples if events change them."""
        if not any(hits.par is not None for happened in events for hits in happened.values()):
            return self._par[numbers]
        par = np.repeat(self._par[numbers][:, np.newaxis], t.shape[1], axis=1)
        t0 = self._problem.t0
        for i, (j, happened) in enumerate(zip(numbers.tolist(), events, strict=True)):
            there = np.isfinite(t[i])
            sign = 1.0 if (t[i, there] >= t0).all() else -1.0
            segments = Segments.from_events(t0, self._starts[j], self._par[j], happened, sign)
            par[i, there] = segments.par[segments.places(t[i, there], y[i, there])]
        return par

    _kept = ("_rows", "_y", "_variations", "_status", "_reason", "_stop", "_steps", "_extra", "_events")

    def checkpoint(self) -> dict[str, Any]:
        """Return all that is known, for `restore`."""
        known = {name: getattr(self, name) for name in self._kept}
        if self._reducer is not None:
            known["reduced"] = self._reducer.gathered, self._reducer.numbers
            known["last"] = self._last
        return known

    def restore(self, known: dict[str, Any]) -> None:
        """Know what `checkpoint` has returned."""
        for name in self._kept:
            setattr(self, name, known[name])
        if self._reducer is not None:
            self._reducer.gathered, self._reducer.numbers = known["reduced"]
            self._last = known.get("last", self._last)

    def solutions(self, compile_seconds: float, from_cache: bool | None, *, events: bool) -> Solutions:
        """Return what is known."""
        t, y, n = self._times, self._y, len(self._status)
        if self._rows is not None:
            width = max(row.size for row, _ in self._rows)
            t, y = np.full((n, width), np.nan), np.full((n, width, self._starts.shape[1]), np.nan)
            for i, (row, states) in enumerate(self._rows):
                t[i, : row.size], y[i, : row.size] = row, states
        elif self._reducer is not None:
            t = t[-1:] if self._same else self._last[:, np.newaxis]
        return Solutions(
            t=t, y=y, status=self._status, reason=self._reason, t_stop=self._stop, steps=self._steps,
            starts=self._starts, par=self._par, compile_seconds=compile_seconds, from_cache=from_cache,
            problem=self._problem, method=self._method, extra=self._extra,
            events=[self._events.get(i, {}) for i in range(n)] if events else [],
            reduced={} if self._reducer is None else self._reducer.results(n),
            variations=self._variations, directions=self._directions,
        )  # fmt: skip


class Remote:
    """Pieces that an executor integrates.

    Parameters
    ----------
    executor : Executor
        Any of `concurrent.futures`.
    problem, method
        What is integrated, and how; they are sent to the workers.
    task : callable
        ``task(problem, method, *more, *piece)`` returns the trajectories of a piece, or also what happened
        in each; importable by the workers.
    more
        What else every piece needs.

    Raises
    ------
    problems.errors.InputError
        For what is no executor, and a problem that cannot be sent.
    """

    def __init__(
        self, executor: Executor, problem: Problem, method: MethodBase, task: Callable[..., Any], *more: Any
    ):
        if not callable(getattr(executor, "submit", None)):
            raise InputError(
                f"executor={shown(executor)} is none; give one as concurrent.futures has, such as "
                "ProcessPoolExecutor(4) or a dask Client's get_executor()."
            )
        self._executor, self._task = executor, task
        try:
            self._sent = pickle.dumps((problem, method, *more))
        except Exception as error:
            what = f"{problem!s} with its events, which must be functions of a module," if more else problem
            raise InputError(f"{what!s} cannot be sent to workers: {shown(str(error))}.") from None

    def run(self, pieces: list[tuple[Numbers, tuple[Any, ...]]]) -> Iterator[tuple[Numbers, Any, Any]]:
        """Yield of each piece its numbers, trajectories and events, in order; or a text why there are none.

        A piece whose worker dies is sent again, once. After an executor is broken nothing is sent.
        """
        waiting: deque[tuple[Numbers, tuple[Any, ...], Any]] = deque()
        todo = iter(pieces)
        try:
            while True:
                while len(waiting) < WINDOW and (following := next(todo, None)) is not None:
                    waiting.append((*following, self._submit(following[1])))
                if not waiting:
                    return
                numbers, piece, future = waiting.popleft()
                result = self._result(piece, future)
                yield (numbers, *result) if isinstance(result, tuple) else (numbers, result, None)
        finally:
            for *_, future in waiting:
                if isinstance(future, Future) or hasattr(future, "cancel"):
                    future.cancel()

    def _submit(self, piece: tuple[Any, ...]) -> Any:
        try:
            return self._executor.submit(_at_worker, self._task, self._sent, piece)
        except (BrokenExecutor, RuntimeError) as error:
            return f"{type(error).__name__}: {error}"

    def _result(self, piece: tuple[Any, ...], future: Any) -> Any:
        why = future if isinstance(future, str) else ""
        for attempt in range(TRIES):
            if isinstance(future, str):
                return why or future
            try:
                return future.result()
            except InputError:
                raise
            except Exception as error:  # whatever an executor raises where a worker has died
                why = f"{type(error).__name__}: {error}"
            if attempt + 1 < TRIES:
                future = self._submit(piece)
        return why


def _at_worker(task: Callable[..., Any], sent: bytes, piece: tuple[Any, ...]) -> Any:
    return task(*_received(sent), *piece)


@lru_cache(maxsize=4)
def _received(sent: bytes) -> tuple[Any, ...]:
    """Return what was sent: the same objects for every piece, so that a program is prepared once."""
    return pickle.loads(sent)


def digest(*arrays: Array) -> str:
    """Return a text that tells arrays from others."""
    hash_ = hashlib.sha256()
    for array in arrays:
        hash_.update(f"{array.shape}".encode() + np.ascontiguousarray(array).tobytes())
    return hash_.hexdigest()
