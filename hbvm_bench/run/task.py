"""One case, measured in a process of its own under hard limits: the task that executors run."""

import contextlib
import os
import platform
import sys
import tempfile
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TypeVar

import msgspec
from msgspec.structs import replace

from hbvm_bench.campaign import own
from hbvm_bench.campaign.file import Case, Limits
from hbvm_bench.campaign.identity import (
    Resolved,
    is_ours,
    kernel_digest,
    of_method,
    resolve,
    version_of,
    versions_of,
)
from hbvm_bench.campaign.spec import parse_spec
from hbvm_bench.measure import machine
from hbvm_bench.reference import solutions
from hbvm_bench.run import ending, supervise, warm
from hbvm_bench.run.supervise import Ended
from hbvm_bench.run.worker import COMPILED, ENVIRONMENT, NO_ROOM, REPLY, STALE, Computation, Request
from hbvm_bench.store import arrays, records
from hbvm_bench.store.records import COMPILING, DIED, Outcome, Record, Result
from problems.errors import InputError

T = TypeVar("T")
LOG_LENGTH = 4000  # characters kept of what a crashed process printed
NO_RESULT = "the process left no readable result"

_thread = threading.local()


class InterruptedRunError(Exception):
    """The run was stopped; what finished is in the store."""


class UnfinishedRunError(Exception):
    """Some cases could not be run at all; what finished is in the store."""


@dataclass(frozen=True)
class Planned:
    """A computation of a study that is to run, as `Resolved` is a case."""

    case: Case  # whose method is the key
    id: str
    computation: Computation


def task_of(resolved: Resolved | Planned, limits: Limits) -> bytes:
    """Return the JSON of the `Request` for an accuracy run, which `execute` takes."""
    if isinstance(resolved, Planned):
        cases = {resolved.id: resolved.case}
        limits = replace(limits, wall_seconds=resolved.computation.limit)
        return msgspec.json.encode(Request(cases=cases, limits=limits, computation=resolved.computation))
    request = Request(
        cases={resolved.id: resolved.case},
        limits=limits,
        versions=versions_of(resolved.method),
        beside=own.beside(resolved.problem),
    )
    return msgspec.json.encode(request)


def execute(task: bytes) -> tuple[bytes, bytes]:
    """Measure one case in a process of its own.

    Top-level, from bytes to bytes and without a directory, so that any
    `concurrent.futures.Executor` can run it, on this machine or another.

    Parameters
    ----------
    task : bytes
        JSON of a `Request`.

    Returns
    -------
    record : bytes
        JSON of a `Record`: whatever happens to the process is one, with its reason.
    series : bytes
        As `hbvm_bench.store.arrays.encode` makes them; empty where there are none.

    Raises
    ------
    InterruptedRunError
        If the run was stopped meanwhile.
    UnfinishedRunError
        If the case could not be run here at all.
    problems.errors.InputError
        If the sources changed meanwhile.
    """
    with solutions.apart():  # this may be a process that works for several runs
        return _executed(msgspec.json.decode(task, type=Request))


def _executed(asked: Request) -> tuple[bytes, bytes]:
    own.add_known(asked.beside)
    ((key, case),) = asked.cases.items()
    if (computation := asked.computation) is not None:
        versions = {"python": platform.python_version(), "hbvm-bench": version_of("hbvm-bench")}
        said = {"case": case, "role": "ours", "library": "hbvm-bench", "order": None, "versions": versions}
        said["kernel"] = kernel_digest()
        loads = None if computation.timed else ("a study", computation.folder)
    else:
        try:
            resolved = resolve(case)
        except InputError as error:
            raise UnfinishedRunError(f"{platform.node()} cannot run it: {error}") from None
        if resolved.id != key:
            raise UnfinishedRunError(_difference(asked.versions, resolved))
        case, method = resolved.case, resolved.method
        said = {"case": case, **of_method(method), "versions": versions_of(method)}
        said["kernel"] = kernel_digest() if is_ours(method) else ""
        loads = method.library, parse_spec(case.problem).name
    with tempfile.TemporaryDirectory(prefix="hbvm-bench-") as scratch:
        request = msgspec.structs.replace(asked, cases={key: case}, core=getattr(_thread, "core", None))
        ended = start(Path(scratch), request, loads)
        result, series = _result(Path(scratch), ended, asked.limits)
    if result.reason == STALE:
        raise InputError(STALE)
    if ended.code == NO_ROOM:
        raise UnfinishedRunError(
            f"there is no room for the results of a case on {platform.node()}; make some in "
            f"{tempfile.gettempdir()} and in the cache, and run the same command again"
        )
    record = Record(
        id=key,
        **said,
        result=result,
        limits=asked.limits,
        seconds=round(ended.seconds, 3),
        peak_memory_gib=round(ended.peak_gib, 3),
        log=ended.output[-LOG_LENGTH:] if result.outcome == "crashed" else "",
        machine=machine.describe(),
        finished=datetime.now(UTC).isoformat(timespec="seconds"),
    )
    return msgspec.json.encode(record), series


def stay_on(core: int) -> None:
    """Let the cases that this thread starts stay on one core."""
    _thread.core = core


def empty_caches(directory: Path) -> dict[str, str]:
    """Return the environment in which every library compiles anew: its caches are in this directory.

    All libraries keep their compiled code below the user's own directories, so these are moved.
    """
    return {
        "HOME": str(directory),
        "XDG_CACHE_HOME": str(directory / "cache"),
        "HBVM_BENCH_CACHE": str(directory / "kernel"),
        "NUMBA_CACHE_DIR": str(directory / "numba"),
    }


def start(
    scratch: Path,
    request: Request,
    loads: tuple[str, str] | None = None,
    environment: Mapping[str, str] | None = None,
) -> Ended:
    """Start the worker process of a request and wait for its end.

    Parameters
    ----------
    scratch : Path
        An empty directory, where it writes.
    request : Request
        What it is asked to do, and under which limits.
    loads : (str, str), optional
        Library and problem of a case that may find loaded what others of both have loaded. By
        default the process begins with nothing, as whatever is timed does.
    environment : mapping, optional
        What is added to the environment of a process that begins with nothing.

    Raises
    ------
    InterruptedRunError
        If the run was stopped.
    """
    path, compiled = scratch / "request.json", scratch / COMPILED
    path.write_bytes(msgspec.json.encode(request))
    ended = None
    if loads is not None and warm.possible():
        with contextlib.suppress(OSError), warm.fork_server(ENVIRONMENT) as server:
            child = server.start(path, *loads)
            ended = supervise.watch(child, request.limits, compiled)
            if child.lost:
                if ended.cause == "exit":
                    ended = None
                    compiled.unlink(missing_ok=True)
                raise ConnectionError  # the fork server has ended
    if ended is None:
        command = [sys.executable, "-m", "hbvm_bench.run.worker", str(path), str(os.getpid())]
        fresh = supervise.Subprocess(command, {**ENVIRONMENT, **(environment or {})})
        ended = supervise.watch(fresh, request.limits, compiled)
    if ended.cause == "stopped":
        raise InterruptedRunError
    return ended


def decoded(path: Path, type_: type[T]) -> T | None:
    """Return what a worker wrote, or ``None`` if it is missing or something else."""
    try:
        return records.decoded(path.read_bytes(), type_)
    except (FileNotFoundError, ValueError):  # msgspec's errors and bad UTF-8 are among the latter
        return None


def _difference(versions: dict[str, str], resolved: Resolved) -> str:
    here = versions_of(resolved.method)
    differing = [
        f"{name} {here.get(name, 'not known')} instead of {version}"
        for name, version in versions.items()
        if here.get(name) != version
    ]
    difference = ", ".join(differing) or "other sources of hbvm-bench"
    return f"{platform.node()} would run another case than was asked for: it has {difference}"


def _result(scratch: Path, ended: Ended, limits: Limits) -> tuple[Result, bytes]:
    def failed(outcome: Outcome, reason: str, status: str = "") -> tuple[Result, bytes]:
        return Result(outcome=outcome, reason=reason, status=status), b""

    if ended.cause == "timeout":
        return failed("timeout", f"did not end within {limits.wall_seconds:g} s")
    if ended.cause == "compiling":
        reason = f"was still compiling after {limits.compile_seconds:g} s; it is tried again in the next run"
        return failed("timeout", reason, COMPILING)
    if ended.cause == "memory":
        return failed("killed", f"used more than {limits.memory_gib:g} GiB of memory")
    if ended.code == ending.KILLED:
        return failed("killed", "ended by signal SIGKILL from outside, perhaps for want of memory", DIED)
    if ended.code != 0:
        return failed("crashed", f"the process {ended.words}", DIED)
    result = decoded(scratch / REPLY, Result)
    if result is None:
        return failed("crashed", NO_RESULT, DIED)
    if result.outcome not in ("ok", "stalled"):
        return result, b""
    try:
        series = (scratch / "arrays").read_bytes()
        arrays.decode(series)
    except (FileNotFoundError, ValueError):
        return failed("crashed", NO_RESULT, DIED)
    return result, series
