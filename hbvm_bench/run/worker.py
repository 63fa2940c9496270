"""The process that runs cases, ``python -m hbvm_bench.run.worker``: it reads requests and writes answers.

See `hbvm_bench.run.task` for both. It leaves the store alone; whatever happens to it, the runner that started
it says what. It serves cases of one library, so that what a case finds loaded is what it would load.
"""

import contextlib
import errno
import gc
import os
import sys
import tempfile
import threading
import traceback
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from queue import SimpleQueue
from typing import IO

import msgspec
import numpy as np
import psutil

from hbvm_bench.campaign import own
from hbvm_bench.campaign.identity import Resolved, resolve, versions_of
from hbvm_bench.measure import batch, ensemble, machine, memory, raw, timing
from hbvm_bench.measure.computation import VALUE, packed
from hbvm_bench.measure.raw import Series
from hbvm_bench.measure.timing import SingleRun, Timeable
from hbvm_bench.run import child
from hbvm_bench.run.task import Answer, Computation, Request
from hbvm_bench.store import arrays
from hbvm_bench.store.records import Record, Result
from integrators.protocol import PreparedBatches, Program, Status, offers
from integrators.solution import Solution
from problems.errors import InputError

DISK = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)
GROWTH = 2**16  # KiB that a process may have grown by since its first case and still serve another one
ROOM = 2**20  # and since its first computation, of which no memory is reported

Measured = tuple[Result, Series]


def main() -> None:
    """Answer the requests at the input until it ends, as it does with the parent."""
    child.limit()
    answers, requests = os.fdopen(os.dup(1), "wb"), os.fdopen(os.dup(0), "rb")
    os.dup2(2, 1)  # what is printed is no answer, and what is read no request
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    waiting: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_listen, args=(requests, waiting), daemon=True).start()
    # complex states are no states, and their real parts are not either
    warnings.simplefilter("error", np.exceptions.ComplexWarning)
    done: set[tuple[str, str]] = set()
    size, cores = 0, machine.cores()
    while True:
        request = msgspec.json.decode(waiting.get(), type=Request)
        try:
            answer = _answered(request, lambda: child.send(answers, child.COMPILED), done, cores)
        except (OSError, InputError) as error:
            if getattr(error.__cause__ or error, "errno", None) not in DISK:
                raise
            room = f"make some in {tempfile.gettempdir()} and in the cache, and run the same command again"
            answer = Answer(refusal=f"has no room for the results of a case; {room}")
        gc.collect()
        memory.forget_peak()
        held = memory.own_peak()
        size = size or held
        most = GROWTH if request.computation is None else ROOM
        leaves = answer.leaves or held - size > most or psutil.Process().children()
        sys.stdout.flush()
        sys.stderr.flush()
        child.send(answers, (child.LEAVES if leaves else child.STAYS) + msgspec.msgpack.encode(answer))


def _listen(requests: IO[bytes], waiting: "SimpleQueue[bytes]") -> None:
    child.take(requests, waiting)
    os._exit(0)


def _answered(
    request: Request, compiled: Callable[[], None], done: set[tuple[str, str]], cores: Sequence[int]
) -> Answer:
    """Do what a request asks; ``done`` are the libraries and problems whose code is loaded."""
    machine.bind(cores if request.core is None else [request.core])
    if request.computation is not None:
        return _stored(*_computed(request.computation))
    known = own.known_from(request.beside)
    cases = [resolve(row.case, known) for row in request.rows]
    for row, here in zip(request.rows, cases, strict=True):
        if row.id != here.id:
            return Answer(refusal=_difference(row, here))
    if request.plan is not None:
        runs = [_run(case) for case in cases]
        compiled()
        timings = timing.time_together(runs, request.plan, request.rounds, request.compilation)
        return Answer(timings=msgspec.json.encode(timings))
    (case,) = cases
    result, series = _measure(case, compiled)
    loads = case.method.library, case.problem.name or ""
    if loads in done:  # the seconds to compile say nothing
        result = msgspec.structs.replace(result, compile=None)
    done.add(loads)
    if result.outcome in ("ok", "stalled"):
        result = msgspec.structs.replace(result, peak_gib=memory.own_peak() / 2**20)
    return _stored(result, series)


def _stored(result: Result, series: Series) -> Answer:
    blobs = {name: arrays.packed(values) for name, values in series.items()}
    return Answer(result=msgspec.json.encode(result), series=blobs, leaves=result.outcome == "crashed")


def _difference(row: Record, here: Resolved) -> str:
    mine = versions_of(here.method)
    differing = [
        f"{name} {mine.get(name, 'not known')} instead of {version}"
        for name, version in row.versions.items()
        if mine.get(name) != version
    ]
    differences = ", ".join(differing) or "other sources of hbvm-bench"
    return f"would run another case than was asked for: it has {differences}"


def _computed(asked: Computation) -> Measured:
    try:
        value = packed(asked.tasks()[asked.key].run())
    except Exception as error:
        traceback.print_exc()
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = f"({Path(last.filename).name}, line {last.lineno})"
        reason = f"failed with {type(error).__name__}: {error} {where}"
        return Result(outcome="crashed", reason=" ".join(reason.split())), {}
    return Result(outcome="ok", status="finished"), {VALUE: value}


def _measure(resolved: Resolved, compiled: Callable[[], None]) -> Measured:
    def failed(reason: str) -> Measured:
        traceback.print_exc()
        return Result(outcome="crashed", reason=reason), {}

    try:
        if reason := resolved.method.accepts(resolved.problem):
            return Result(outcome="refused", reason=reason), {}
        names = list(resolved.problem.system.invariants)
        if bad := [name for name in names if not arrays.NAME.fullmatch(name)]:
            reason = f"the invariant's name {bad[0]!r} can be no file name"
            return Result(outcome="refused", reason=reason), {}
        grid = resolved.times
        program = _compiled(resolved)
        compiled()
        if (asked := resolved.case.ensemble) is not None:
            return raw.ensemble(resolved.problem, program, asked)
        integrate = raw.solve_with_bare_end if resolved.case.grid.at_steps else raw.solve
        solution = integrate(resolved.problem, resolved.method, program, grid)
    except InputError as error:  # a missing library among them
        return Result(outcome="refused", reason=str(error)), {}
    except Exception as error:
        if getattr(error, "errno", None) in DISK:
            raise
        return failed(f"{type(error).__name__}: {error}")
    if wrong := _garbage(solution, grid):
        return Result(outcome="crashed", reason=wrong, status=solution.status.value), {}
    result, series = raw.of_solution(solution)
    try:
        reversal, more = raw.beside(solution, program, resolved.case.checks)
        reasons, indicators = _chaos(resolved)
    except Exception as error:
        return failed(f"in a check, {type(error).__name__}: {error}")
    return msgspec.structs.replace(result, reversal=reversal, chaos=reasons), series | more | indicators


def _chaos(resolved: Resolved) -> tuple[dict[str, str], Series]:
    """Return the indicators of chaos that a case asks for, and why one is missing."""
    if not resolved.case.checks.chaos:
        return {}, {}
    from hbvm_bench.measure import chaos  # few cases ask for it

    return chaos.beside(resolved.problem, resolved.method)


def _run(resolved: Resolved) -> Timeable:
    problem, method, program = resolved.problem, resolved.method, _compiled(resolved)
    if (asked := resolved.case.ensemble) is None:
        return SingleRun.compiled(problem, method, program)
    return ensemble.EnsembleRun.compiled(problem, method, program, asked)


def _compiled(resolved: Resolved) -> Program:
    """Compile; where an ensemble is asked for, also what a program leaves to its first batch."""
    problem = resolved.problem
    program = resolved.method.compile(problem.system)
    if resolved.case.ensemble is not None and offers(program, PreparedBatches):
        batch.prepared(program, problem.y0[None], problem)
    return program


def _garbage(solution: Solution, grid: np.ndarray) -> str:
    """Return what is wrong with a solution that breaks the protocol, else ``""``."""
    t, y = solution.t, solution.y
    if y.dtype.kind not in "fiu":
        return f"the method returned states of the type {y.dtype}, not real numbers"
    if t.ndim != 1 or y.shape != (t.size, solution.problem.system.dim):
        return f"the method returned times of shape {t.shape} and states of shape {y.shape}"
    if t.size > grid.size or not np.array_equal(t, grid[: t.size]):
        return "the method returned times that were not asked for"
    if solution.status is Status.FINISHED and t.size != grid.size:
        return f"the method says it finished but returned {t.size} of {grid.size} samples"
    if solution.status is Status.FINISHED and not np.isfinite(y).all():
        first = t[np.flatnonzero(~np.isfinite(y).all(axis=1))[0]]
        return f"the method says it finished but its state is not finite from t = {first:.4g}"
    return ""


if __name__ == "__main__":
    with contextlib.suppress(BrokenPipeError):  # the runner has gone
        main()
