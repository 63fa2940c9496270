"""Events that change the state and the parameters agree with a new start by hand after each of them."""

from typing import Any, cast

import numpy as np
import pytest

import integrators
import problems
from integrators import HBVM, Event, Gauss, Status, start
from problems import Hamiltonian, Problem, VectorField
from problems.errors import InputError

integrate: Any = integrators.integrate
END = 40.0
GRID = np.linspace(0.0, END, 97)
PENDULUM = Hamiltonian(
    lambda q, p, par, m: p[0] ** 2 / (2 * par.mass) - par.g * m.cos(q[0]) + par.spring[1] * q[0] ** 2,
    dof=1, parameters={"g": 1.0, "mass": 1.0, "spring": [0.0, 0.1]}, name="pendulum of changing mass",
)  # fmt: skip
METHODS = [
    HBVM(), HBVM(k=8, s=4, h=0.1), Gauss(s=6, tol=1e-11), HBVM(k=6, s=4, tol=1e-11, projection="energy"),
    Gauss(s=4, h=0.1, solver="newton"), HBVM(k=8, s=4, tol=1e-11, solver="blended"),
]  # fmt: skip


def heavier(q, p, par):
    changes = {"mass": 1.05 * par.mass, "g": 2.5 - par.g, "spring": [0.0, 0.3 - par.spring[1]]}
    return [q[0], 0.99 * p[0]], changes


def heavier_in_python(q, p, par):
    state, changes = heavier(q, p, par)
    return np.asarray(state, dtype=float), {name: np.asarray(value) for name, value in changes.items()}


def pendulum():
    return Problem(PENDULUM, y0=[1.0, 0.0], t_end=END)


def passing(then=heavier):
    return Event(lambda q: q[0], then=then, name="passing")


def by_hand(problem, method, event):
    """Return the times of an event's actions, the states and parameters after them, and the last state."""
    system, t, y, par = problem.system, problem.t0, problem.y0, problem.par
    times, after, pars = [], [], []
    while True:
        piece = Problem(system, y0=y, parameters=system.unpack(par), t0=t, t_end=problem.t_end)
        plain = Event(event.g, direction=event.direction, name="plain")
        found = integrate(piece, method, [problem.t_end], events=plain)
        hits = found.events["plain"]
        later = np.flatnonzero(hits.t > t + 1e-9 * bool(times))  # it may find the same zero again
        if not later.size:
            return np.array(times), np.array(after), np.array(pars), found.y[-1]
        t, y = float(hits.t[later[0]]), hits.y[later[0]]
        y, par = changed(system, event, y, par)
        times.append(t)
        after.append(y)
        pars.append(par)


def changed(system, event, y, par):
    if system.dof is None:
        return np.array(event.then(y)), par
    named = type("Parameters", (), system.unpack(par))
    state, changes = event.then(y[: system.dof], y[system.dof :], named)
    return np.array(state), system.pack({**system.unpack(par), **changes})


@pytest.mark.parametrize("python", [False, True])
@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_parameters_that_an_event_changes(method, python):
    problem, event = pendulum(), passing(heavier_in_python if python else heavier)
    found = integrate(problem, method, GRID, events=event)
    times, after, pars, end = by_hand(problem, method, event)
    hits = found.events["passing"]
    assert found.status is Status.FINISHED
    assert len(hits) == len(times) > 8
    assert np.abs(hits.t - times).max() < 1e-10  # measured 3e-12, with the projection
    assert np.abs(hits.after - after).max() < 1e-13  # measured 6e-15
    assert np.array_equal(hits.par, pars)
    assert np.abs(found.y[-1] - end).max() < 1e-10  # measured 8e-13, with the projection
    assert np.array_equal(integrate(problem, method, GRID, events=event).y, found.y)  # nothing is left over
    steps = integrate(problem, method, GRID, "steps", events=event)
    assert np.isin(hits.t, steps.t).all()
    for solution in (found, steps):
        assert solution.errors()["energy"].max() < 1e-13  # measured 1.4e-14


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_a_solution_knows_the_parameters_of_each_time(method, tmp_path):
    problem, event = pendulum(), passing()
    found, few = (integrate(problem, method, grid, events=event) for grid in (GRID, [END]))
    assert np.abs(few(GRID) - found.y).max() < 1e-10  # measured 3e-12, with the projection
    segment = np.searchsorted(found.events["passing"].t, GRID, side="right")
    mass = np.concatenate([[1.0], found.events["passing"].par[:, 1]])[segment]
    assert np.abs(found.v[:, 0] - found.p[:, 0] / mass).max() < 1e-15
    found.save(tmp_path / "pendulum.npz")
    loaded: Any = integrators.load(tmp_path / "pendulum.npz")
    assert np.array_equal(loaded.events["passing"].par, found.events["passing"].par)
    assert np.array_equal(loaded(GRID + 0.0), found(GRID))
    for name in ("errors", "invariants"):
        assert np.array_equal(getattr(loaded, name)()["energy"], getattr(found, name)()["energy"])


@pytest.mark.parametrize("method", METHODS[:2], ids=repr)
def test_a_run_and_an_ensemble_and_checkpoints_have_the_present_parameters(method, tmp_path):
    problem, event = pendulum(), passing()
    found = integrate(problem, method, GRID, events=event)
    hits = found.events["passing"]
    run: Any = integrators.start(problem, method, events=event)
    for t, y in zip(GRID, found.y, strict=True):
        assert np.array_equal(run.until(float(t)), y)
    assert np.array_equal(run.par, hits.par[-1])
    assert run.energy() == found.invariants()["energy"][-1]
    run.par = cast("Any", {"g": 1.0})  # the others stay what the events have made
    assert np.array_equal(run.par, [1.0, *hits.par[-1, 1:]])
    run.y = [1.0, 0.0]
    assert np.array_equal(run.par, [1.0, *hits.par[-1, 1:]])
    assert np.array_equal(run.events["passing"].par, hits.par)

    many: Any = integrators.integrate_many(
        problem, method, parameters={"g": [1.0, 1.2]}, times=GRID[1:], events=event, threads=2
    )
    close = 0.0 if method.h else 5e-15  # one by one with a fixed step; measured in lanes 4e-16
    assert np.abs(many.y[0] - found.y[1:]).max() <= close
    assert np.abs(many.events[0]["passing"].par - hits.par).max() <= close
    assert np.abs(many.errors()["energy"][0] - found.errors()["energy"][1:]).max() <= close
    many.save(tmp_path / "many.npz")
    loaded: Any = integrators.load(tmp_path / "many.npz")
    assert np.array_equal(loaded[1].events["passing"].par, many[1].events["passing"].par)

    program: Any = method.compile(problem.system)
    begin = program.with_events(problem, {"passing": event})
    first, second = (begin(problem.y0, problem.par, 0.0, END) for _ in range(2))
    for stepper in (first, second):
        stepper.destination = END
    for t, y in zip(GRID[1:], found.y[1:], strict=True):
        assert np.array_equal(first.advance(np.array([t])).y[0], y)
        second.restore(first.checkpoint())
        second.search.load(first.search.save())
        first, second = second, first
    fresh = begin(problem.y0, problem.par, 0.0, END)
    start = fresh.checkpoint()
    fresh.advance(GRID[1:])
    fresh.restore(start)
    assert np.array_equal(fresh.par, problem.par)
    with pytest.raises(InputError, match="other parameters"):
        begin(problem.y0, hits.par[0], 0.0, END).restore(first.checkpoint())


def test_actions_at_one_time_see_what_those_before_have_changed():
    double = Event(lambda q: q[0], then=lambda par: (None, {"mass": 2.0 * par.mass}), name="double")
    add = Event(lambda q: 2.0 * q[0], then=lambda y, par: ([*y], {"mass": par.mass + 1.0}), name="add")
    stay = Event(lambda q: 3.0 * q[0], then=lambda q, p: [q[0], p[0]], name="stay")
    found = integrate(pendulum(), HBVM(), [10.0], events=[double, add, stay])
    assert found.events["double"].par[:, 1].tolist() == [2.0, 6.0]
    assert found.events["add"].par[:, 1].tolist() == [3.0, 7.0]
    assert np.array_equal(found.events["stay"].par, found.events["add"].par)
    assert np.array_equal(found.events["double"].after, found.events["double"].y)  # None: the state stays


def test_what_then_may_not_return_is_said_in_a_sentence():
    wrong = [
        (lambda: (None, {"mas": 2.0}), "unknown parameter of pendulum of changing mass 'mas'"),
        (lambda: (None, {"mass": [1.0, 2.0]}), "must return one number for the parameter 'mass'"),
        (lambda: (None, {"spring": 1.0}), "must return a list of 2 numbers for the parameter 'spring'"),
        (lambda q: ([q[0]], {"mass": 2.0}), "must return a list of 2 numbers, the new state, or a tuple"),
        (lambda: None, "must return a list of 2 numbers, the new state, or a tuple of that and a dict"),
        (lambda: {"mass": 2.0}, "must return a list of 2 numbers, the new state, or a tuple of that"),
    ]  # fmt: skip
    for then, sentence in wrong:
        with pytest.raises(InputError, match=sentence):
            integrate(pendulum(), HBVM(), events=passing(then))
    infinite = passing(lambda q, p, par: ([q[0], p[0]], {"mass": par.mass / (0.0 * q[0])}))
    found = integrate(pendulum(), HBVM(), events=infinite)
    assert found.status is Status.NOT_FINITE
    assert "then of the event 'passing' returns a number that is not finite" in found.reason


@pytest.mark.parametrize("method", [HBVM(), Gauss(s=5, tol=1e-10), HBVM(tol=1e-8)], ids=repr)
@pytest.mark.parametrize("stepwise", [False, True], ids=["times", "steps"])
def test_an_event_may_move_the_times_at_which_the_field_switches(method, stepwise):
    # The fall is braked for a second from the time when a height is passed, and for another from there on.
    field = VectorField(
        lambda t, y, par, m: [y[1], m.where(t < par.since, -1.0, m.where(t < par.since + 1.0, 0.5, -1.0))],
        dim=2, parameters={"since": 50.0}, name="braked",
    )  # fmt: skip
    problem = Problem(field, y0=[1.0, 0.0], t_end=6.0)
    events = [
        Event(lambda y: y[0] - 0.5, direction=-1, then=lambda t: (None, {"since": t}), name="brake"),
        Event(lambda t: t - 3.0, then=lambda t: (None, {"since": t + 0.25}), name="again"),
    ]
    if stepwise:
        run = start(problem, method, events=events)
        while run.t < 6.0 and run.step() is Status.RUNNING:
            pass
        y = run.until(6.0)
        assert run.status is Status.RUNNING
    else:
        found = integrate(problem, method, np.linspace(0.0, 6.0, 13), events=events)
        assert found.status is Status.FINISHED
        y = found.y[-1]
    place, speed = 0.5, -1.0  # at t = 1
    for seconds, push in ((1.0, 0.5), (1.25, -1.0), (1.0, 0.5), (1.75, -1.0)):
        place, speed = place + speed * seconds + push * seconds**2 / 2.0, speed + push * seconds
    assert y == pytest.approx([place, speed], abs=1e-12)


@pytest.mark.parametrize(
    "method",
    [HBVM(), HBVM(k=6, s=3, h=0.1), HBVM(k=20, s=5, h=0.25), HBVM(k=6, s=4, tol=1e-11)],
    ids=repr,
)
def test_poisson_systems_go_on_with_the_energy_that_an_event_leaves(method):
    problem = problems.load("lotka_volterra", t_end=30.0)
    level = 1.2 * float(problem.y0[0])
    event = Event(
        lambda y: y[0] - level, direction=1, then=lambda y: [y[0], 0.9 * y[1], y[2]], name="harvest"
    )
    found = integrate(problem, method, GRID[GRID <= 30.0], events=event)
    hits = found.events["harvest"]
    times, after, *_ = by_hand(Problem(problem.system, y0=problem.y0, t_end=30.0), method, event)
    assert len(hits) == len(times) > 8
    assert np.abs(hits.t - times).max() < 1e-9  # measured 2e-11
    assert np.abs(hits.after - after).max() < 1e-9  # measured 1e-11
    assert found.errors()["energy"].max() < 1e-12  # measured 7e-14, with k=6, s=3, h=0.1
    jumps = np.abs(np.diff(found.invariants()["energy"]))
    assert jumps.max() > 0.1  # the event itself changes it
