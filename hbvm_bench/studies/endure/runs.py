"""The runs of `endure`: perturbed starts of the outer Solar System, declared methods, sampled in log time.

``python -m hbvm_bench.studies.endure.runs REQUEST.json`` runs them; the results are stored in
one file, written anew after every start, so that an interrupted run keeps what it has.
"""

import gc
import sys
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from hbvm_bench.campaign.grid import GOLDEN
from hbvm_bench.campaign.identity import make_method, make_problem
from hbvm_bench.measure import machine
from hbvm_bench.measure.timing import no_collection
from hbvm_bench.report import terminal
from hbvm_bench.run import processes
from hbvm_bench.store.files import write_json
from hbvm_bench.store.records import decoded
from integrators.protocol import Program, Status
from problems.analysis import invariants
from problems.errors import InputError
from problems.problem import Problem

Array = NDArray[np.float64]

SCHEMA = 1
FILE = "endure.json"

YEARS = 1e6
STARTS = 8
QUICK_YEARS = 1e4
QUICK_STARTS = 3

PROBLEM = "outer_solar_system(t_end={years!r})"
OURS = "Gauss(s=8, h=1.0)"
METHODS = (
    OURS,
    "Taylor(tol=1e-16)",
    "Taylor(tol=1e-18, high_accuracy=True)",
    "IAS15()",
)

LIBRARIES = ("hbvm-bench", "numpy", "numba", "heyoka", "rebound")

PERTURBATION = 1e-6
"""Relative size of the changes of the starting positions and momenta."""

FIRST = 10.0  # years
PER_DECADE = 48
DECADES = (1e4, 1e5, 1e6)


class Request(msgspec.Struct, frozen=True, kw_only=True):
    """What to run.

    Attributes
    ----------
    years : float
        The span.
    starts : int
        Trajectories of each method.
    methods : list of str
        As they print.
    out : str
        The directory for the results.
    command : str
        How to run it again.
    """

    years: float
    starts: int
    methods: list[str]
    out: str
    command: str


class Trajectory(msgspec.Struct, frozen=True, kw_only=True):
    """One method from one start.

    Attributes
    ----------
    method : str
        As it prints.
    start : int
        0 is the unperturbed one.
    status, reason : str
        How it ended.
    seconds : float or None
        Of the integration, with its few samples.
    errors : list of float
        Signed relative errors of the energy at the times of the result.
    steps : int or None
        That it took.
    """

    method: str
    start: int
    status: str
    reason: str = ""
    seconds: float | None = None
    errors: list[float] = []
    steps: int | None = None


class Endurance(msgspec.Struct, frozen=True, kw_only=True):
    """The result of a run.

    Attributes
    ----------
    problem : str
        As it prints.
    years : float
        The span.
    starts : int
        Declared starts of each method.
    methods : list of str
        Declared.
    perturbation : float
        See `perturbed`.
    t : list of float
        Sampling times, in years, log-spaced.
    trajectories : list of Trajectory
        Those that have ended, in the order in which they ran.
    machine, versions, command, started
        Where, with what, how and when.
    """

    problem: str
    years: float
    starts: int
    methods: list[str]
    perturbation: float
    t: list[float]
    trajectories: list[Trajectory]
    machine: dict[str, str | int]
    versions: dict[str, str]
    command: str
    started: str
    schema: int = SCHEMA


def sample_times(years: float) -> Array:
    """Return the sampling times: whole years, log-spaced, with the powers of ten among them.

    Whole years are own steps of a method whose step divides a year.
    """
    count = round(PER_DECADE * np.log10(years / FIRST)) + 1
    spaced = np.rint(np.geomspace(FIRST, years, count))
    wanted = [decade for decade in DECADES if decade <= years]
    return np.unique(np.concatenate([spaced, wanted, [years]]))


def perturbed(problem: Problem, start: int) -> Array:
    """Return a perturbed start, shape (dim,): every number times 1 + `PERTURBATION` x, |x| <= 1.

    For the number i (from 0) of the start n the x is 2 frac(g (n dim + i)) - 1 with g the
    golden ratio 0.618...; start 0 is the problem's own.
    """
    if start == 0:
        return problem.y0.copy()
    number = start * problem.system.dim + np.arange(problem.system.dim)
    return problem.y0 * (1.0 + PERTURBATION * (2.0 * ((number * GOLDEN) % 1.0) - 1.0))


def signed_errors(problem: Problem, y0: Array, y: Array) -> Array:
    """Return the relative energy errors of states (n, dim) against a start, with their signs.

    The difference is formed in double-double, before rounding.
    """
    states = np.vstack([y0[None], y]).T
    (energy,) = invariants.evaluate(problem.system.function("hamiltonian"), problem.t0, states, problem.par)
    difference = (energy.hi[1:] - energy.hi[0]) + (energy.lo[1:] - energy.lo[0])
    return difference / abs(float(energy.hi[0]))


def main(path: Path) -> None:
    """Run a request."""
    described = machine.describe(measure=True)
    processes.settle()
    request = msgspec.json.decode(path.read_bytes(), type=Request)
    problem = make_problem(PROBLEM.format(years=request.years))
    times = sample_times(request.years)
    console = terminal.console(stderr=True)
    programs = {text: make_method(text).compile(problem.system) for text in request.methods}
    done: list[Trajectory] = []
    started = datetime.now(UTC).isoformat(timespec="seconds")
    for start in range(request.starts):
        for text, program in programs.items():
            made = run(problem, program, text, start, times)
            done.append(made)
            took = f"{made.seconds:.2f} s" if made.seconds is not None else made.reason
            worst = f", |dE/E| {abs(made.errors[-1]):.1e} at the end" if made.errors else ""
            console.print(f"start {start + 1} of {request.starts}  {text}: {took}{worst}", highlight=False)
        save(
            Endurance(
                problem=repr(problem),
                years=request.years,
                starts=request.starts,
                methods=request.methods,
                perturbation=PERTURBATION,
                t=times.tolist(),
                trajectories=done,
                machine=described,
                versions={name: version(name) for name in LIBRARIES},
                command=request.command,
                started=started,
            ),
            Path(request.out),
        )


def run(problem: Problem, program: Program, text: str, start: int, times: Array) -> Trajectory:
    """Integrate one trajectory over the samples and time it."""
    y0 = perturbed(problem, start)
    stepper = program.start(y0, problem.par, problem.t0)
    gc.collect()
    with no_collection():
        begin = time.perf_counter()
        samples = stepper.advance(times)
        seconds = time.perf_counter() - begin
    if samples.status is not Status.FINISHED:
        return Trajectory(method=text, start=start, status=samples.status.value, reason=samples.reason)
    return Trajectory(
        method=text,
        start=start,
        status=samples.status.value,
        seconds=seconds,
        errors=signed_errors(problem, y0, samples.y).tolist(),
        steps=stepper.stats.steps,
    )


def save(result: Endurance, directory: Path) -> None:
    """Write the result, all of it or nothing."""
    write_json(directory / FILE, result)


def load(directory: Path) -> Endurance:
    """Read a result.

    Raises
    ------
    problems.errors.InputError
        If there is none, or the file is something else.
    """
    path = directory / FILE
    try:
        result = decoded(path.read_bytes(), Endurance)
    except OSError:
        raise InputError(
            f"there is no result of endure in {str(directory)!r}; run: hbvm-bench endure --out DIR."
        ) from None
    except (msgspec.MsgspecError, ValueError) as error:
        raise InputError(f"{str(path)!r} is not the result of endure: {error}.") from None
    if result.schema != SCHEMA:
        raise InputError(f"{str(path)!r} was written by another version; run endure again.")
    return result


def of_method(result: Endurance, method: str) -> Sequence[Trajectory]:
    """Return the finished trajectories of a method."""
    return [one for one in result.trajectories if one.method == method and one.status == "finished"]


if __name__ == "__main__":
    main(Path(sys.argv[1]))
