"""One random problem by every integrator, in a process that is ended where a library does not come back."""

import multiprocessing
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from time import process_time

import numpy as np

from hbvm_bench.campaign.identity import make_method
from hbvm_bench.reference import trusted
from hbvm_bench.reference.condition import conditions
from hbvm_bench.studies.random_hamiltonians import systems
from integrators import integrate
from integrators.protocol import Array, MethodBase, Status
from integrators.solution import Solution
from problems import Problem, targets
from problems.errors import InputError

TOLERANCE = 1e-10
"""What every integrator is asked for that takes a tolerance, and what all are judged by."""
AGREED = 1e-16  # of the two computations of a reference
LIMIT = 30.0  # seconds of one integration or one reference, with its compilation
COMPILING = 1e-6  # of the interval, integrated before
AGAIN = 0.1  # processor seconds: a shorter integration is repeated, when what it reads lies in caches

METHODS = (
    "HBVM()",
    "HBVM(tol=1e-10)",
    "Gauss(s=8, tol=1e-10)",
    "Taylor()",
    "Taylor(tol=1e-10)",
    "IAS15()",
    'IAS15(mode="global")',
    "BS(eps_rel=1e-10, eps_abs=1e-12)",
    "DOP853(rtol=1e-10, atol=1e-12)",
    "DOP853(rtol=1e-10, atol=1e-06)",
    "LSODA(rtol=1e-10, atol=1e-12)",
    "Radau(rtol=1e-10, atol=1e-12)",
    "Dopri8(rtol=1e-10, atol=1e-12)",
    "Tsit5(rtol=1e-10, atol=1e-12)",
    "CVODE(rtol=1e-10, atol=1e-12)",
    'CVODE(rtol=1e-10, atol=1e-12, method="Adams")',
)
"""The settings. Those without 1e-10 choose their accuracy themselves; SciPy's default of ``atol`` is 1e-6."""
SLOW = "Radau(rtol=1e-10, atol=1e-12)"
SLOW_DRAWS = 2
"""The setting that takes seconds a problem, and of how many problems of each formula it is asked."""

REFERENCE = "reference"
REFUSED, NO_ANSWER, CRASHED = "refused", "no answer", "crashed"


@dataclass(frozen=True)
class Trial:
    """What one integrator did on one problem.

    Attributes
    ----------
    method : str
        As it prints.
    status : str
        That of the integration, or `REFUSED`, `NO_ANSWER` or `CRASHED`.
    reason : str
        Of a failure, as the library gives it.
    position : float
        Distance of the end from the reference over that of the reference from the origin; NaN without an end.
    energy : float
        Change of the energy over `energy_scale`; NaN where none is conserved.
    steps : int
        As the library counts them.
    seconds : float
        Processor seconds without compiling, of one run.
    """

    method: str
    status: str
    reason: str = ""
    position: float = np.nan
    energy: float = np.nan
    steps: int = 0
    seconds: float = np.nan

    @property
    def success(self) -> bool:
        """Whether it says that it arrived."""
        return self.status == Status.FINISHED


@dataclass(frozen=True)
class Outcome:
    """What all integrators did on one problem.

    Attributes
    ----------
    number : int
        Of the problem, see `hbvm_bench.studies.random_hamiltonians.systems.problem`.
    condition : float
        Condition number of the positions at the end; NaN without a reference.
    why : str
        Why there is no reference.
    end : list of float
        The state there, rounded to doubles; empty without a reference.
    trials : list of Trial
        One for each setting that was asked.
    """

    number: int
    condition: float = np.nan
    why: str = ""
    end: list[float] = field(default_factory=list)
    trials: list[Trial] = field(default_factory=list)

    @property
    def judged(self) -> bool:
        """Whether errors at the tolerance leave three digits of the end."""
        return bool(self.condition * TOLERANCE <= 1e-3)


def outcomes(
    numbers: Sequence[int], methods: Sequence[str] = tuple(METHODS), limit: float = LIMIT
) -> list[Outcome]:
    """Return what integrators do on some problems.

    Parameters
    ----------
    numbers : sequence of int
        The problems; those of one formula in a row are compiled once.
    methods : sequence of str
        The settings, each as it prints.
    limit : float
        Seconds for each integration. A process that takes longer is ended: the integration has given no
        answer, and another process goes on with the next.
    """
    results = {number: Outcome(number, why="not computed") for number in numbers}
    left = [
        (number, method)
        for number in numbers
        for method in (REFERENCE, *methods)
        if method != SLOW or number % systems.DRAWS < SLOW_DRAWS
    ]
    while left:
        for answer in _answers(left, results, limit):
            number, method = left.pop(0)
            result = results[number]
            if isinstance(answer, Outcome):
                results[number] = answer
            elif isinstance(answer, Trial):
                results[number] = replace(result, trials=[*result.trials, answer])
            elif method == REFERENCE:
                results[number] = replace(result, why=f"the reference: {answer}")
            else:
                results[number] = replace(result, trials=[*result.trials, Trial(method, answer)])
    return list(results.values())


def _answers(
    asked: Sequence[tuple[int, str]], known: dict[int, Outcome], limit: float
) -> Iterator[Trial | Outcome | str]:
    """Yield what a process answers, one by one; `NO_ANSWER` or `CRASHED` is the last."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe(duplex=False)
    child = context.Process(target=_serve, args=(there, list(asked), dict(known)), daemon=True)
    child.start()
    there.close()
    try:
        here.recv()  # it has started
        for _ in asked:
            try:
                answer = here.recv() if here.poll(limit) else NO_ANSWER
            except EOFError:
                answer = CRASHED
            yield answer
            if isinstance(answer, str):
                return
    finally:
        child.kill()
        child.join()
        here.close()


def _serve(there: Connection, asked: Sequence[tuple[int, str]], known: dict[int, Outcome]) -> None:
    """Answer what is asked, in order; what libraries print is in no one's way."""
    quiet = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(quiet, stream)
    there.send("started")
    for number, method in asked:
        if method == REFERENCE:
            known[number] = reference(number)
            there.send(known[number])
        else:
            there.send(trial(method, systems.problem(number), np.array(known[number].end)))


def reference(number: int) -> Outcome:
    """Return the end of a problem on which two computations of twice the digits agree, and its condition."""
    problem = systems.problem(number)
    try:
        opinions = trusted.ask(problem, np.array([problem.t0, problem.t_end]))
    except InputError as error:
        return Outcome(number, why=str(error))
    if not opinions.apart[-1] <= AGREED:
        return Outcome(number, why=f"two computations differ by {opinions.apart[-1]:.1e}")
    end = np.array(opinions.states[-1], dtype=float)
    condition = conditions(problem, np.array([problem.t_end]), end[None])
    assert condition is not None  # all are Hamiltonian
    return Outcome(number, float(condition[0]), end=end.tolist())


def trial(text: str, problem: Problem, end: Array) -> Trial:
    """Return what one integrator does on one problem; ``end`` is empty where it is not known."""
    method = make_method(text)
    refused = method.accepts(problem)
    if refused is not None:
        return Trial(text, REFUSED, refused)
    integrate(problem, method, [problem.t0, problem.t0 + COMPILING * (problem.t_end - problem.t0)])
    solution, seconds = _timed(problem, method)
    if seconds < AGAIN:
        solution, seconds = _timed(problem, method)
    status, last = solution.status.value, solution.y[-1]
    if solution.status is not Status.FINISHED or not np.isfinite(last).all():
        return Trial(text, status, solution.reason, steps=solution.stats.steps, seconds=seconds)
    position = np.nan
    if end.size:
        half = end.size // 2
        position = float(np.linalg.norm(last[:half] - end[:half]) / np.linalg.norm(end[:half]))
    return Trial(text, status, "", position, energy_change(problem, last), solution.stats.steps, seconds)


def _timed(problem: Problem, method: MethodBase) -> tuple[Solution, float]:
    before = process_time()
    solution = integrate(problem, method, [problem.t0, problem.t_end])
    return solution, process_time() - before


def energy_change(problem: Problem, end: Array) -> float:
    """Return the change of the energy at an end over `energy_scale`; NaN where it is not conserved."""
    states = np.stack([problem.y0, end])
    energies = problem.invariants(states).get("energy")
    if energies is None:
        return np.nan
    return float(abs(energies[1] - energies[0]) / energy_scale(problem, states))


def energy_scale(problem: Problem, states: Array) -> float:
    """Return by how much the energy changes per relative change of all components of a state, at most.

    The sum of abs(dH/dy_i y_i), the largest of some states of shape (n, dim). The size of the energy itself
    has no meaning: a constant may be added to it.
    """
    field = targets.numpy(problem.system, "field")
    half = states.shape[1] // 2
    slopes = [np.array(field(problem.t0, y, problem.par)) for y in states]
    return max(
        float(np.abs(f[half:] * y[:half]).sum() + np.abs(f[:half] * y[half:]).sum())
        for f, y in zip(slopes, states, strict=True)
    )
