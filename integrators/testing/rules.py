"""What the checks have in common: how they fail, and what they put to a method."""

from collections.abc import Callable
from typing import Any

import numpy as np

from integrators.protocol import Array, MethodBase, Samples, Status
from problems import Problem


def require(condition: bool, rule: str) -> None:
    """Fail unless a rule holds; not by ``assert``, for the kit must also check under ``python -O``."""
    if not condition:
        raise AssertionError(f"broken: {rule}")


def raises(error: type[Exception], call: Callable[[], object], rule: str) -> None:
    """Fail unless a call raises an error."""
    try:
        call()
    except error:
        return
    raise AssertionError(f"broken: {rule} (no {error.__name__} was raised)")


def start(method: MethodBase, problem: Problem) -> Any:
    """Return a stepper at the problem's start; what it offers beyond `Stepper` is asked for by `offers`."""
    return method.compile(problem.system).start(problem.y0, problem.par, problem.t0)


def regular(problem: Problem, n: int) -> Array:
    """Return ``n`` times at equal distances, the start included."""
    return np.linspace(problem.t0, problem.t_end, n)


def irregular(problem: Problem) -> Array:
    """Return 23 times that fall between the steps of any fixed-step method."""
    fraction = np.linspace(0.01, 1.0, 23) ** 1.3
    return problem.t0 + (problem.t_end - problem.t0) * fraction


def finished(samples: Samples, method: MethodBase) -> None:
    """Fail unless all times were reached."""
    require(
        samples.status is Status.FINISHED,
        f"{method!r} finishes, but: {samples.status} ({samples.reason or 'no reason'})",
    )
