"""What goes wrong in the middle of an integration is a status with time and reason, never an exception."""

import numpy as np
import pytest

from integrators import HBVM, Event, Gauss, integrate, integrate_many, start
from problems import Opaque, Problem, VectorField

LATE = 1.0
METHODS = [
    HBVM(), HBVM(tol=1e-9), Gauss(s=4, h=0.1), HBVM(k=6, s=3, h=0.1, solver="newton"),
    HBVM(breakpoints=(0.7, 2.5)),
]  # fmt: skip
FIELD = VectorField(lambda y, par: [y[1], -par.a * y[0]], dim=2, parameters={"a": 1.0}, name="spring")
SPRING = Problem(FIELD, y0=[1.0, 0.0], t_end=8.0)
SWITCHED = Problem(
    VectorField(
        lambda t, y, par, m: [y[1], m.where(t < par.a, -y[0], -2.0 * y[0])], dim=2, parameters={"a": 2.0}
    ),
    y0=[1.0, 0.0], t_end=8.0,
)  # fmt: skip
GROWS = Problem(
    VectorField(lambda y, par: [par.a * y[0] ** 2, 1.0], dim=2, parameters={"a": 1.0}),
    y0=[0.5, 0.0],
    t_end=8.0,
)


def raises(*_):
    raise LookupError("too late")


ACTIONS = {
    "raises": raises,
    "too short": lambda y: y[:1],
    "too long": lambda y: [*y, 1.0],
    "nothing": lambda y: None,
    "text": lambda y: ["a", "b"],
    "complex": lambda y: [1j, 1j],
    "not a number": lambda y: [np.nan, np.nan],
    "unknown parameter": lambda y: (y, {"nope": 1.0}),
    "parameter of another shape": lambda y: (y, {"a": [1.0, 2.0]}),
    "parameter that is no number": lambda y: (y, {"a": np.nan}),
}
FUNCTIONS = {
    "raises": raises, "nothing": lambda y: None, "text": lambda y: "a", "list": lambda y: [1.0, 2.0],
    "complex": lambda y: 1j, "huge": lambda y: 10**400,
}  # fmt: skip
FIELDS = {
    "raises": raises, "nothing": lambda y: None, "text": lambda y: ["a", "b"], "too short": lambda y: [1.0],
    "too long": lambda y: [1.0, 2.0, 3.0], "complex": lambda y: [1j, 1j],
    "not a number": lambda y: [np.nan] * 2,
}  # fmt: skip


def ends(problem, method, events):
    """Return status and reason of one solution, of a run to and fro, and of the first of an ensemble."""
    times = np.linspace(0.0, 8.0, 9)
    made = integrate(problem, method, times, events=events)
    yield made.status, made.reason
    yield (lambda steps: (steps.status, steps.reason))(
        integrate(problem, method, times, sample="steps", events=events)
    )
    run = start(problem, method, events)
    for goal in (3.0, 0.5, 8.0):
        run.until(goal)
        run.step()
    run.events  # noqa: B018 -- looks into the step ahead
    yield run.status, run.reason
    many = integrate_many(problem, method, starts=[problem.y0, 0.9 * problem.y0], times=times, events=events)
    yield many[0].status, many[0].reason


def check(problem, method, events=()):
    for status, reason in ends(problem, method, events):
        assert status.failed, (method, status)
        assert "t = " in reason, (method, reason)


@pytest.mark.parametrize("method", METHODS, ids=str)
@pytest.mark.parametrize("kind", ACTIONS)
def test_an_action_that_fails_late(kind, method):
    def then(t, y):
        return list(map(float, y)) if t < LATE else ACTIONS[kind](list(map(float, y)))

    check(SPRING, method, Event(lambda y: y[0], then=then, name="late"))


@pytest.mark.parametrize("method", METHODS, ids=str)
@pytest.mark.parametrize("kind", FUNCTIONS)
@pytest.mark.parametrize("acts", [False, True])
def test_an_event_function_that_fails_late(kind, method, acts):
    def g(t, y):
        return float(y[0]) + 2.0 if t < LATE else FUNCTIONS[kind](y)

    check(SPRING, method, Event(g, then=(lambda y: [y[0], y[1]]) if acts else None, name="late"))


@pytest.mark.parametrize("method", METHODS, ids=str)
@pytest.mark.parametrize("kind", FIELDS)
def test_a_field_that_fails_late(kind, method):
    def field(t, y):
        return [y[1], -y[0]] if t < LATE else FIELDS[kind](y)

    check(Problem(Opaque(field, dim=2), y0=[1.0, 0.0], t_end=8.0), method)
    check(Problem(Opaque(field, dim=2), y0=[1.0, 0.0], t_end=8.0), method, Event(lambda y: y[1]))


@pytest.mark.parametrize("method", METHODS, ids=str)
@pytest.mark.parametrize("problem", [SPRING, SWITCHED], ids=["spring", "switched"])
def test_a_traced_action_that_divides_by_zero(problem, method):
    event = Event(
        lambda t: t - LATE, then=lambda y, par: (None, {"a": par.a / (y[0] - y[0])}), name="divides"
    )
    check(problem, method, event)


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_an_action_that_lets_the_solution_end(method):
    check(
        GROWS, method, Event(lambda t: t - LATE, then=lambda par: (None, {"a": 10.0 * par.a}), name="faster")
    )
