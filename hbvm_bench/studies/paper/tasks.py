"""The computations of a report, side by side in processes."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any

Results = Mapping[str, Any]


@dataclass(frozen=True)
class Task:
    """One computation: a picklable call without arguments.

    Attributes
    ----------
    key : str
        Under which its result is found.
    run : callable
        A top-level function or a `functools.partial` of one.
    cost : float
        Rough seconds, so that the long ones start first.
    """

    key: str
    run: Callable[[], Any]
    cost: float = 1.0


def run_all(tasks: Sequence[Task], jobs: int, done: Callable[[str, float], None]) -> dict[str, Any]:
    """Run all tasks and return their results by key.

    Parameters
    ----------
    tasks : sequence of Task
        Independent of one another.
    jobs : int
        Processes; 1 runs everything here.
    done : callable
        Called with the key and the seconds of each task when it has ended.
    """
    ordered = sorted(tasks, key=lambda task: -task.cost)
    if jobs == 1:
        return {task.key: _report(task.key, *_timed(task), done) for task in ordered}
    results: dict[str, Any] = {}
    with _pool(jobs) as pool:
        futures = {pool.submit(_timed, task): task.key for task in ordered}
        for future in as_completed(futures):
            key = futures[future]
            results[key] = _report(key, *future.result(), done)
    return results


@contextmanager
def _pool(jobs: int) -> Iterator[Executor]:
    # spawn: a forked child would inherit the threads' locks of the libraries
    pool = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"))
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    pool.shutdown()


def _timed(task: Task) -> tuple[Any, float]:
    start = time.perf_counter()
    return task.run(), time.perf_counter() - start


def _report(key: str, value: Any, seconds: float, done: Callable[[str, float], None]) -> Any:
    done(key, seconds)
    return value
