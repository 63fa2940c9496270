"""One random problem by one integrator, and the reference of a problem."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from time import process_time

import numpy as np

from hbvm_bench.campaign.identity import make_method
from hbvm_bench.reference import trusted
from hbvm_bench.reference.condition import conditions
from integrators import integrate
from integrators.protocol import Array, MethodBase, Status
from integrators.solution import Solution
from problems import Problem, targets
from problems.errors import InputError

from . import systems

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
        Of results that do not have ``end``: the error of the positions there, as `position_error` has it.
    energy : float
        Change of the energy over `energy_scale`; NaN where none is conserved.
    steps : int
        As the library counts them.
    seconds : float
        Processor seconds without compiling, of one run.
    end : list of float
        The state at the end; empty where it was not reached.
    """

    method: str
    status: str
    reason: str = ""
    position: float = np.nan
    energy: float = np.nan
    steps: int = 0
    seconds: float = np.nan
    end: list[float] = field(default_factory=list)

    @property
    def success(self) -> bool:
        """Whether it says that it arrived."""
        return self.status == Status.FINISHED


@dataclass(frozen=True)
class Reference:
    """Where a problem ends.

    Attributes
    ----------
    condition : float
        Condition number of the positions at the end; NaN without a reference.
    why : str
        Why there is no reference.
    end : list of float
        The state there, rounded to doubles; empty without a reference.
    """

    condition: float = np.nan
    why: str = ""
    end: list[float] = field(default_factory=list)


@dataclass(frozen=True)
class Outcome:
    """What all integrators did on one problem.

    Attributes
    ----------
    number : int
        Of the problem, see `systems.problem`.
    reference : Reference
        Where it ends.
    trials : list of Trial
        One for each setting that was asked.
    """

    number: int
    reference: Reference
    trials: list[Trial] = field(default_factory=list)

    @property
    def judged(self) -> bool:
        """Whether errors at the tolerance leave three digits of the end."""
        return bool(self.reference.condition * TOLERANCE <= 1e-3)

    def position_error(self, trial: Trial) -> float:
        """Return the distance of an end from the reference over that of the reference from the origin."""
        truth = np.array(self.reference.end)
        if not trial.end or not truth.size:
            return trial.position
        half = truth.size // 2
        away = np.array(trial.end)[:half] - truth[:half]
        return float(np.linalg.norm(away) / np.linalg.norm(truth[:half]))


def asked(number: int, methods: Sequence[str] = METHODS) -> list[str]:
    """Return the settings that are asked of a problem."""
    return [method for method in methods if method != SLOW or number % systems.DRAWS < SLOW_DRAWS]


def reference(number: int) -> Reference:
    """Return the end of a problem on which two computations of twice the digits agree, and its condition."""
    problem = systems.problem(number)
    try:
        opinions = trusted.ask(problem, np.array([problem.t0, problem.t_end]))
    except InputError as error:
        return Reference(why=str(error))
    if not opinions.apart[-1] <= AGREED:
        return Reference(why=f"two computations differ by {opinions.apart[-1]:.1e}")
    end = np.array(opinions.states[-1], dtype=float)
    condition = conditions(problem, np.array([problem.t_end]), end[None])
    assert condition is not None  # all are Hamiltonian
    return Reference(float(condition[0]), end=end.tolist())


def trial(number: int, text: str) -> Trial:
    """Return what one integrator does on one problem."""
    problem, method = systems.problem(number), make_method(text)
    refused = method.accepts(problem)
    if refused is not None:
        return Trial(text, REFUSED, refused)
    integrate(problem, method, [problem.t0, problem.t0 + COMPILING * (problem.t_end - problem.t0)])
    solution, seconds = _timed(problem, method)
    if seconds < AGAIN:
        solution, seconds = _timed(problem, method)
    status, last, steps = solution.status.value, solution.y[-1], solution.stats.steps
    if solution.status is not Status.FINISHED or not np.isfinite(last).all():
        return Trial(text, status, solution.reason, steps=steps, seconds=seconds)
    energy = energy_change(problem, last)
    return Trial(text, status, energy=energy, steps=steps, seconds=seconds, end=last.tolist())


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
