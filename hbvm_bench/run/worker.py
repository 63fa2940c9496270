"""The process that runs one case: ``python -m hbvm_bench.run.worker REQUEST.json PARENT``, or a warm one.

It writes ``reply.json``, a `Result` (with ``arrays``) or a list of `Timing`, beside the
request and leaves the store alone; whatever happens to it, the runner that
started it says what.
"""

import errno
import os
import sys
import traceback
import warnings
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np

from hbvm_bench.campaign import folder, own
from hbvm_bench.campaign.file import Case, Limits, TimingPlan
from hbvm_bench.campaign.identity import Resolved, fixed_step, resolve
from hbvm_bench.measure import batch, ensemble, machine, memory, raw, timing
from hbvm_bench.measure.computation import VALUE, Task, packed
from hbvm_bench.measure.raw import Series
from hbvm_bench.measure.timing import SingleRun, Timeable
from hbvm_bench.run import ending
from hbvm_bench.store.arrays import NAME, encode
from hbvm_bench.store.files import atomic
from hbvm_bench.store.records import Result, Timing
from integrators.protocol import PreparedBatches, Program, Status, offers
from integrators.solution import Solution
from problems.errors import InputError

REPLY = "reply.json"
COMPILED = "compiled"  # the file that says that compiling has ended
NO_ROOM = 73  # the exit code for a full disk, which is no fault of the case
DISK = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)
STALE = "the sources or versions changed while the run was under way; start it again."
Found = Literal["nothing", "libraries", "code"]
ENVIRONMENT = {
    # one thread each, whatever does the linear algebra
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false",
    "JAX_PLATFORMS": "cpu",
}


class Computation(msgspec.Struct, frozen=True, kw_only=True):
    """One computation of a study.

    Attributes
    ----------
    folder, place : str
        Of the function that lists them, as in ``./blocks.py:tasks``.
    key : str
        Which of them.
    quick : bool
        Whether the run is quick.
    timed : bool
        Whether it takes times: it finds nothing loaded then, and nothing runs beside it.
    limit : float
        Seconds after which it is ended.
    """

    folder: str
    place: str
    key: str
    quick: bool
    timed: bool = False
    limit: float = 3600.0

    def tasks(self) -> dict[str, Task]:
        """Return the tasks of the study, by their keys."""
        return {task.key: task for task in folder.named(self.place, Path(self.folder))(self.quick)}


class Request(msgspec.Struct, frozen=True, kw_only=True):
    """What travels to a worker, and before that to whichever machine shall start it.

    Attributes
    ----------
    cases : dict of Case
        By the ids that the runner gave them, which must come out the same elsewhere; several are
        timed together.
    limits : Limits
        Wall time and memory of the process.
    plan : TimingPlan or None
        What to time; ``None`` for the accuracy run.
    versions : dict
        Behind the ids, to name what differs elsewhere.
    beside : own.Beside
        What must be known of their problem.
    rounds : list of int
        Of interleaved times, those that are this process's.
    compilation : int
        Which of the plan's compilations they are of.
    core : int or None
        The core to stay on.
    computation : Computation or None
        What to do instead of an integration.
    """

    cases: dict[str, Case]
    limits: Limits
    plan: TimingPlan | None = None
    versions: dict[str, str] = {}
    beside: own.Beside = own.Beside()
    rounds: list[int] = []
    compilation: int = 0
    core: int | None = None
    computation: Computation | None = None


def work(path: Path, parent: int, warmth: Found = "nothing") -> None:
    """Do what the request at a path asks, as the only thing that this process does.

    It ends with ``parent``, which has made it. What it has ``found`` loaded, as a fork of it, is not counted.
    """
    request = msgspec.json.decode(path.read_bytes(), type=Request)
    own.add_known(request.beside)
    ending.limit_and_die_with(parent)
    if request.core is not None:
        machine.bind([request.core])
    # complex states are no states, and their real parts are not either
    warnings.simplefilter("error", np.exceptions.ComplexWarning)
    try:
        if request.computation is not None:
            (path.parent / COMPILED).touch()
            reply: object = _computed(request.computation, path.parent)
        elif request.plan is None:
            reply = _measured(request, path.parent, parent, warmth)
        else:
            reply = _time(request, request.plan, path.parent)
        with atomic(path.parent / REPLY) as temporary:
            temporary.write_bytes(msgspec.json.encode(reply))
    except (OSError, InputError) as error:
        if getattr(error.__cause__ or error, "errno", None) in DISK:
            sys.exit(NO_ROOM)
        raise


def _computed(asked: Computation, directory: Path) -> Result:
    try:
        value = packed(asked.tasks()[asked.key].run())
    except Exception as error:
        traceback.print_exc()
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = f"({Path(last.filename).name}, line {last.lineno})"
        reason = f"failed with {type(error).__name__}: {error} {where}"
        return Result(outcome="crashed", reason=" ".join(reason.split()))
    return _stored(directory, Result(outcome="ok", status="finished"), {VALUE: value})


def _measured(request: Request, directory: Path, parent: int, warmth: Found) -> Result:
    result = _measure(request, directory)
    if result.outcome not in ("ok", "stalled"):
        return result
    compiled = None if warmth == "code" else result.compile  # else the seconds say nothing
    return msgspec.structs.replace(result, compile=compiled, peak_gib=_peak_gib(parent, warmth))


def _measure(request: Request, directory: Path) -> Result:
    try:
        (resolved,) = _resolved(request)
        if reason := resolved.method.accepts(resolved.problem):
            return Result(outcome="refused", reason=reason)
        names = list(resolved.problem.system.invariants)
        if bad := [name for name in names if not NAME.fullmatch(name)]:
            return Result(outcome="refused", reason=f"the invariant's name {bad[0]!r} can be no file name")
        grid = resolved.case.grid.times(resolved.problem, fixed_step(resolved.method))
        program = _compiled(resolved)
        (directory / COMPILED).touch()
        if (asked := resolved.case.ensemble) is not None:
            return _stored(directory, *raw.ensemble(resolved.problem, program, asked))
        integrate = raw.solve_with_bare_end if resolved.case.grid.at_steps else raw.solve
        solution = integrate(resolved.problem, resolved.method, program, grid)
    except OSError as error:
        if error.errno in DISK:
            raise
        traceback.print_exc()
        return Result(outcome="crashed", reason=f"{type(error).__name__}: {error}")
    except InputError as error:  # a missing library among them
        return Result(outcome="refused", reason=str(error))
    except Exception as error:
        traceback.print_exc()
        return Result(outcome="crashed", reason=f"{type(error).__name__}: {error}")
    if wrong := _garbage(solution, grid):
        return Result(outcome="crashed", reason=wrong, status=solution.status.value)
    result, series = raw.of_solution(solution)
    try:
        reversal, more = raw.beside(solution, program, resolved.case.checks)
        reasons, indicators = _chaos(resolved)
    except Exception as error:
        traceback.print_exc()
        return Result(outcome="crashed", reason=f"in a check, {type(error).__name__}: {error}")
    result = msgspec.structs.replace(result, reversal=reversal, chaos=reasons)
    return _stored(directory, result, series | more | indicators)


def _chaos(resolved: Resolved) -> tuple[dict[str, str], Series]:
    """Return the indicators of chaos that a case asks for, and why one is missing."""
    if not resolved.case.checks.chaos:
        return {}, {}
    from hbvm_bench.measure import chaos  # as the numbers of no other case depend on it

    return chaos.beside(resolved.problem, resolved.method)


def _stored(directory: Path, result: Result, series: Series) -> Result:
    with atomic(directory / "arrays") as temporary:
        temporary.write_bytes(encode(series))
    return result


def _peak_gib(parent: int, warmth: Found) -> float:
    """Return the largest resident memory, with the pages of libraries that a fork has not touched."""
    untouched = 0
    if warmth != "nothing":
        theirs, ours = (memory.of_process(pid).files for pid in (parent, os.getpid()))
        untouched = theirs - ours
    return (memory.own_peak() + max(untouched, 0)) / 2**20


def _time(request: Request, plan: TimingPlan, directory: Path) -> list[Timing]:
    runs = [_run(case) for case in _resolved(request)]
    (directory / COMPILED).touch()
    if plan.interleaved:
        return timing.time_together(runs, plan, request.rounds, request.compilation)
    return [timing.time_alone(run, plan) for run in runs]


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


def _resolved(request: Request) -> list[Resolved]:
    cases = [resolve(case) for case in request.cases.values()]
    if [resolved.id for resolved in cases] != list(request.cases):
        raise InputError(STALE)
    return cases


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
    work(Path(sys.argv[1]), int(sys.argv[2]))
