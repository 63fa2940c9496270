"""Where cases run: threads that wait for child processes here, a dask cluster, or any other executor."""

import concurrent.futures
import inspect
import multiprocessing
import os
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from queue import SimpleQueue
from typing import Any

from hbvm_bench.measure import machine
from hbvm_bench.run.task import stay_on
from problems.errors import InputError, MissingLibraryError

LOCAL = "local"
DASK = "dask://"
CONNECT = 10.0  # seconds to wait for a scheduler


@dataclass(frozen=True)
class Pool:
    """An executor, and how many cases it runs side by side.

    Attributes
    ----------
    executor : concurrent.futures.Executor
        Takes the cases.
    slots : callable
        Returns how many it runs at once, at the moment; 0 while there is no worker.
    lost : callable
        Returns why it will never answer again, or ``""``.
    where : str
        For a sentence: "on this machine".
    """

    executor: Executor
    slots: Callable[[], int]
    lost: Callable[[], str] = lambda: ""
    where: str = "on this machine"


@contextmanager
def opened(name: str = LOCAL, jobs: int | None = None) -> Iterator[Pool]:
    """Make the executor called ``name``, and shut it down afterwards.

    Parameters
    ----------
    name : str
        ``"local"``; ``"dask://HOST:PORT"``, a scheduler of dask.distributed; or
        ``"MODULE:NAME"``, a `concurrent.futures.Executor` class (or a function that
        returns an executor) such as ``"mpi4py.futures:MPIPoolExecutor"``.
    jobs : int, optional
        Cases side by side. Default: one per core, or what the executor has.

    Raises
    ------
    problems.errors.InputError
        If there is no such executor.
    """
    if name == LOCAL:
        with _local(jobs or len(machine.cores())) as pool:
            yield pool
    elif name.startswith(DASK):
        with _dask(name.removeprefix(DASK), jobs) as pool:
            yield pool
    elif ":" in name:
        executor = _imported(name, jobs)
        try:
            yield pool_of(executor, jobs)
        finally:
            executor.shutdown(wait=True, cancel_futures=True)
    else:
        raise InputError(
            f"there is no executor {name!r}; give local, dask://HOST:PORT, or MODULE:NAME of an executor."
        )


def pool_of(executor: Executor, jobs: int | None = None) -> Pool:
    """Return the pool of any executor; without ``jobs`` it has as many slots as the executor says."""
    slots = jobs or getattr(executor, "_max_workers", None) or os.cpu_count() or 1
    return Pool(executor, lambda: slots, where=f"by {type(executor).__name__}")


@contextmanager
def _local(jobs: int) -> Iterator[Pool]:
    cores = machine.cores()
    free: SimpleQueue[int] = SimpleQueue()
    for core in cores:
        free.put(core)

    def settle() -> None:
        if jobs <= len(cores):  # with more, the system shares the cores better
            stay_on(free.get_nowait())

    with ThreadPoolExecutor(max_workers=jobs, thread_name_prefix="case", initializer=settle) as executor:
        yield Pool(executor, lambda: jobs)


@contextmanager
def _dask(address: str, jobs: int | None) -> Iterator[Pool]:
    try:
        from distributed import Client
    except ImportError:
        raise MissingLibraryError(
            "dask:// needs the library distributed; install it with: pip install 'hbvm-bench[dask]'."
        ) from None
    host, separator, port = address.rpartition(":")
    if not (host and separator and port.isdigit()):
        raise InputError(f"dask://{address} must be dask://HOST:PORT, as in dask://localhost:8786.")
    try:
        client = Client(f"tcp://{address}", timeout=CONNECT, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(
            f"no dask scheduler answers at {address} ({type(error).__name__}); start one with: "
            f"dask scheduler --port {port}."
        ) from None

    def lost() -> str:
        return "" if client.status == "running" else f"the dask scheduler at {address} is gone"

    def slots() -> int:
        try:
            threads: Any = client.nthreads()
        except (OSError, TimeoutError):
            return 0
        there = sum(threads.values())
        return min(there, jobs) if jobs else there

    try:
        # retries: a case that has lost its worker goes to another one
        yield Pool(client.get_executor(pure=False), slots, lost, f"on the dask cluster at {address}")
    finally:
        client.close(timeout=2 if lost() else 10)


def _imported(name: str, jobs: int | None) -> Executor:
    module, _, attribute = name.partition(":")
    try:
        factory = getattr(import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise InputError(f"there is no executor {name!r}: {error}.") from None
    options: dict[str, Any] = {"max_workers": jobs} if jobs else {}
    if inspect.isclass(factory) and issubclass(factory, ProcessPoolExecutor):
        options["mp_context"] = multiprocessing.get_context("spawn")  # a fork would copy half-held locks
    try:
        executor = factory(**options)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} cannot be made: {error}.") from None
    if not isinstance(executor, concurrent.futures.Executor):
        raise InputError(f"{name} is no concurrent.futures.Executor but {type(executor).__name__}.")
    return executor
