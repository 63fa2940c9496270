"""A run that fails returns the last state it reached, with its time: every method of the registry."""

import numpy as np
import pytest

import problems
from integrators import Status, integrate, registry, start
from integrators.protocol import MethodBase

ESCAPE = problems.Problem(problems.VectorField(lambda y: [y[0] ** 2], dim=1), y0=[1.0], t_end=2.0)
# its solution is 1/(1 - t)^2
FALL = problems.Problem(
    problems.Hamiltonian(lambda q, p: p[0] ** 2 / 2 - 2 * q[0] ** 3, dof=1), q0=[1.0], p0=[2.0], t_end=2.0
)
BODIES = {"EOS", "MERCURIUS", "SABA", "TRACE", "WHFast", "WHFast512"}
OPTIONS = ({}, {"h": 0.01}, {"rtol": 1e-10, "atol": 1e-10})
OWN = {
    "Gauss": ({"s": 4, "h": 0.01}, {"s": 4, "tol": 1e-10}, {"s": 4, "h": 0.01, "precision": "double-double"}),
    "HBVM": ({}, {"k": 6, "s": 3, "h": 0.01}),
    "LineIntegral": ({"k": 6, "s": 3, "invariants": ["energy"], "h": 0.01},),
}


def _methods() -> list[tuple[str, MethodBase]]:
    methods = []
    for name in registry.names():
        for options in OWN.get(name, OPTIONS):
            try:
                method = registry.create(name, **options)
            except problems.InputError:
                if name in OWN:
                    raise
                continue
            methods.append((f"{name}{options or ''}", method))
    return methods


METHODS = _methods()


def _problem(method: MethodBase) -> problems.Problem | None:
    return next((problem for problem in (ESCAPE, FALL) if method.accepts(problem) is None), None)


def test_all_methods_but_those_for_bodies_take_one_of_the_problems() -> None:
    taken = {name.split("{")[0] for name, method in METHODS if _problem(method) is not None}
    assert {*registry.names()} - taken <= BODIES


@pytest.mark.parametrize(("name", "method"), METHODS, ids=[name for name, _ in METHODS])
@pytest.mark.parametrize("times", [[2.0], [0.1, 0.2, 2.0]], ids=["end", "samples"])
def test_time_and_state_belong_together_after_a_failure(
    name: str, method: MethodBase, times: list[float]
) -> None:
    problem = _problem(method)
    if problem is None:
        pytest.skip("it takes gravitating bodies only")
    run = start(problem, method)
    for t in times:
        run.until(t)
    solution = integrate(problem, method, times)
    if not solution.status.failed:  # a fixed step may pass the pole
        assert "'h'" in name
        return
    assert run.status is solution.status
    assert run.t == solution.t_stop > 0.95
    assert solution.t.tolist() == (times[:-1] or [run.t])
    for t, y in ((run.t, run.y), (solution.t[-1], solution.y[-1])):
        if abs(_left(problem, y) - (1.0 - t)) < 5e-8:  # measured 1.4e-8 (CVODE), 6e-9 (BDF), less for others
            continue
        # a fixed step leaves the solution near the pole: then it is the last of its steps
        assert "'h'" in name
        assert y == pytest.approx(_stepped(problem, method, t), rel=1e-9)  # measured 0


def _left(problem: problems.Problem, y: np.ndarray) -> float:
    """Return how long it still is to the pole, as a state says."""
    return 1.0 / y[0] if problem is ESCAPE else max(y[0], 1e-300) ** -0.5


def _stepped(problem: problems.Problem, method: MethodBase, t: float) -> np.ndarray:
    run = start(problem, method)
    while run.t < t - 1e-9 and run.step() is Status.RUNNING:
        pass
    assert run.t == pytest.approx(t, abs=1e-12)
    return run.y


def test_a_field_that_raises_leaves_the_state_before_that_step() -> None:
    def field(t: float, y: np.ndarray) -> list[float]:
        if t > 0.5:
            raise LookupError("too late")
        return [-y[0]]

    problem = problems.Problem(problems.Opaque(field, dim=1), y0=[1.0], t_end=1.0)
    for name in ("DOP853", "Radau"):
        solution = integrate(problem, registry.create(name, rtol=1e-10, atol=1e-10), [1.0])
        assert solution.status is Status.USER_ERROR
        assert 0.0 < solution.t[0] <= 0.5
        assert solution.y[0, 0] == pytest.approx(np.exp(-solution.t[0]), rel=1e-9)  # measured 1e-10


def test_the_last_finite_step_is_found_in_a_chunk_of_many() -> None:
    slow = problems.Problem(problems.VectorField(lambda y: [1e-3 * y[0] ** 2], dim=1), y0=[1.0], t_end=2e3)
    method = registry.create("Tsit5", h=0.01)  # 10^5 steps to the pole
    solution = integrate(slow, method, [2000.0])
    assert solution.status is Status.NOT_FINITE
    assert solution.t[0] == solution.t_stop == pytest.approx(1000.0, abs=1.0)
    again = integrate(slow, method, [solution.t_stop, solution.t_stop + 0.01])
    assert again.t.tolist() == [solution.t_stop]
    assert again.y[0] == solution.y[0]
