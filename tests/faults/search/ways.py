"""How each case is integrated, and what comes of it."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from integrators import HBVM, Gauss, LineIntegral, Status, integrate, integrate_many
from problems.errors import InputError

from .shape import MEMBERS, Case

WRONG = 1e-6  # of the size of a component over the span

MOST_STEPS = 20_000  # a run that needs more has failed: the spans are short

SAMPLINGS = (None, "stop", "steps")
METHODS: dict[str, Any] = {
    "HBVM()": HBVM(max_steps=MOST_STEPS),
    "HBVM(8, 7)": HBVM(k=8, s=7, tol=1e-12, max_steps=MOST_STEPS),
    "Gauss(6)": Gauss(s=6, tol=1e-12, max_steps=MOST_STEPS),
    "LineIntegral": LineIntegral(k=16, s=8, tol=1e-12, invariants=["energy"]),
}
LANES = {"HBVM()": HBVM(), "HBVM(8, 7)": HBVM(k=8, s=7, tol=1e-12)}

RIGHT, SILENT, WARNED, FAILED = "right", "silently wrong", "wrong, warned", "failed"


@dataclass(frozen=True)
class Outcome:
    """What came of one trajectory in one way.

    Attributes
    ----------
    group, case, way : str
        Class of the system, which one it is, and how it was integrated.
    verdict : str
        `RIGHT`, `SILENT`, `WARNED` or `FAILED`.
    error : float
        Relative to the sizes of the components; infinite where it failed.
    warned : bool
        Whether there was a warning, right or wrong.
    said : str
        The warnings, or the reason of the failure.
    """

    group: str
    case: str
    way: str
    verdict: str
    error: float
    warned: bool
    said: str


def outcomes(case: Case) -> Iterator[Outcome]:
    """Integrate a case in every way."""
    for name, method in METHODS.items():
        if name != "LineIntegral" or _has_energy(case):
            yield from _alone(case, name, method)
    for name, method in LANES.items():
        yield from _together(case, name, method)


def _has_energy(case: Case) -> bool:
    problem = case.members[0].problem
    return problem.system.energy is not None and METHODS["LineIntegral"].accepts(problem) is None


def _alone(case: Case, name: str, method: Any) -> Iterator[Outcome]:
    sampling = SAMPLINGS[case.index % 3]
    problem = case.members[0].problem
    solution = integrate(problem, method, case.times, sample=sampling)
    said = " ".join(solution.warnings)
    yield _judged(
        case, 0, f"integrate {name}", solution.status, solution.t, solution.y, said, solution.reason
    )
    if name != "HBVM()" or solution.status is not Status.FINISHED:
        return
    if sampling != "stop":
        solution = integrate(problem, method, case.times)
    try:
        states = solution(case.asked)
    except InputError as error:
        yield Outcome(case.shape.group, str(case), "sol(t)", FAILED, np.inf, False, str(error))
        return
    yield _judged(case, 0, "sol(t)", Status.FINISHED, case.asked, states, " ".join(solution.warnings), "")


def _together(case: Case, name: str, method: Any) -> Iterator[Outcome]:
    rows = np.array([member.y0 for member in case.members])
    values = {key: [member.parameters[key] for member in case.members] for key in case.members[0].parameters}
    problem = case.members[0].problem
    made = integrate_many(problem, method, starts=rows, parameters=values, times=case.times)
    for i in range(MEMBERS):
        said = _warnings(made, i)
        yield _judged(
            case, i, f"integrate_many {name}", made.status[i], made.t, made.y[i], said, made.reason[i]
        )
    last = MEMBERS - 1
    alone = integrate_many(
        problem, method, starts=rows[last:], times=case.times,
        parameters={key: value[last:] for key, value in values.items()},
    )  # fmt: skip
    same = np.array_equal(alone.y[0], made.y[last], equal_nan=True)
    verdict, said = (RIGHT, "") if same else (SILENT, "other bits beside other trajectories")
    yield Outcome(case.shape.group, str(case), "neighbours", verdict, 0.0 if same else np.inf, False, said)


def _warnings(made: Any, i: int) -> str:
    return " ".join(made.warnings[i]) if hasattr(made, "warnings") else ""


def _judged(
    case: Case, member: int, way: str, status: Status, times: Any, states: Any, said: str, reason: str
) -> Outcome:
    group, name = case.shape.group, f"{case}.{member}"
    if status is not Status.FINISHED:
        return Outcome(group, name, way, FAILED, np.inf, bool(said), f"{status}: {reason}")
    error = case.error(member, times, states)
    verdict = RIGHT if error <= WRONG else WARNED if said else SILENT
    return Outcome(group, name, way, verdict, error, bool(said), said)
