"""A trajectory taken step by step: the bits of `integrate`, also after changes, and what refuses."""

import doctest
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import problems
from integrators import HBVM, Event, Gauss, Status, integrate, registry, start
from problems import Problem, VectorField
from problems.errors import InputError

METHODS = {
    "own steps": HBVM(),
    "fixed steps": Gauss(s=4, h=0.1),
    "implicit": HBVM(k=4, s=4, h=0.1, solver="newton"),
    "steps that end at given times": HBVM(breakpoints=(0.55, 1.0)),
    "Taylor": None,
    "IAS15": None,
}


@pytest.fixture(params=METHODS)
def method(request):
    if METHODS[request.param] is None:
        pytest.importorskip({"Taylor": "heyoka", "IAS15": "rebound"}[request.param])
        return registry.create(request.param)
    return METHODS[request.param]


def test_steps_and_times_have_the_bits_of_integrate(method):
    problem = problems.load("kepler", e=0.3, t_end=3.0)
    steps = integrate(problem, method, [0.0, 3.0], sample="steps")
    run = start(problem, method)
    taken = [(run.t, run.y)]
    while len(taken) < steps.t.size:
        assert run.step() is Status.RUNNING
        taken.append((run.t, run.y))
    assert np.array_equal([t for t, _ in taken], steps.t)
    assert np.array_equal([y for _, y in taken], steps.y)


def test_a_first_step_from_rest_is_that_of_integrate():
    problem = problems.load("pendulum", t_end=12.0)  # at the bottom: the field there is 0
    run, steps = start(problem), integrate(problem, times=[0.0, 12.0], sample="steps")
    run.step()
    assert run.t == steps.t[1]


def test_a_time_between_steps_leaves_the_steps_alone():
    problem = problems.load("kepler", e=0.3)
    plain, run = start(problem), start(problem)
    for _ in range(3):
        plain.step()
    goal = plain.t
    plain.step()
    run.step()
    assert np.array_equal(run.until(goal + 1e-3), integrate(problem, times=[goal + 1e-3]).y[0])
    assert run.t == goal + 1e-3
    assert run.until(run.t).shape == (4,)
    run.step()
    assert (run.t, *run.y) == (plain.t, *plain.y)


@pytest.mark.parametrize("method", [HBVM(), Gauss(s=4, h=0.1)], ids=["own steps", "fixed steps"])
def test_what_is_set_is_a_new_start_there(method):
    field = VectorField(lambda t, y, par, m: [y[1], -par.k * y[0]], dim=2, parameters={"k": 1.0})
    problem = Problem(field, y0=[1.0, 0.0], t_end=10.0)
    run = start(problem, method)
    run.until(1.25)
    run.y = [0.5, -0.5]
    run.par = {"k": 4.0}
    assert (run.t, *run.y, *run.par) == (1.25, 0.5, -0.5, 4.0)
    run.step()
    there = Problem(field, y0=[0.5, -0.5], parameters={"k": 4.0}, t0=1.25, t_end=10.0)
    beside = start(there, method)
    beside.step()
    assert (run.t, *run.y) == (beside.t, *beside.y)
    run.par = [2.0]
    assert run.until(3.0).shape == (2,)
    assert run.par.tolist() == [2.0]
    assert problem.par.tolist() == [1.0]


def test_the_energy_is_that_of_the_present_state_and_parameters():
    problem = problems.load("kepler", e=0.3)
    run = start(problem)
    before = run.energy()
    assert abs(run.energy() - problem.invariants(problem.y0[None])["energy"][0]) == 0.0
    run.until(2.0)
    assert abs(run.energy() - before) < 1e-15  # 1.1e-16 measured
    run.y = run.y * [1.0, 1.0, 2.0, 2.0]
    assert run.energy() > before
    with pytest.raises(InputError, match="no conserved energy"):
        start(Problem(VectorField(lambda t, y, m: [-y[0]], dim=1), y0=[1.0], t_end=1.0)).energy()


def test_events_of_all_steps_are_kept_also_over_a_new_start():
    problem, end = problems.load("pendulum", t_end=12.0), 12.0
    run = start(problem, events=Event(lambda q: q[0], name="below"))
    while run.t < end:
        run.step()
    known = integrate(problem, times=[end], events=Event(lambda q: q[0], name="below")).events["below"]
    assert len(known) > 1
    assert np.array_equal(run.events["below"].t, known.t)
    run.y = run.y
    while run.t < 2.0 * end:
        run.step()
    assert len(run.events["below"]) > len(known)
    assert np.all(np.diff(run.events["below"].t) > 0.0)
    over = start(problem, events=Event(lambda q: q[0], name="below", terminal=True))
    while over.step() is Status.RUNNING:
        pass
    assert over.status is Status.EVENT
    t = over.t
    over.step()
    assert over.t == t


def test_a_failure_is_told_and_ends_it():
    problem = Problem(VectorField(lambda t, y, m: [y[0] * y[0]], dim=1), y0=[1.0], t_end=2.0)
    run = start(problem)
    for _ in range(100000):
        if run.step() is not Status.RUNNING:
            break
    assert run.status.failed
    assert "t = " in run.reason
    t = run.t
    run.step()
    run.until(5.0)
    assert run.t == t
    assert t < 1.0
    stopped = start(problem)
    assert stopped.until(2.0).shape == (1,)
    assert stopped.status.failed
    assert stopped.t < 1.0


def test_what_cannot_be_set_is_refused():
    run = start(problems.load("kepler"))
    with pytest.raises(ValueError, match="read-only"):
        run.y[0] = 1.0
    with pytest.raises(InputError, match="shape"):
        run.y = [1.0]
    with pytest.raises(InputError, match="finite"):
        run.y = [1.0, np.nan, 0.0, 0.0]
    with pytest.raises(InputError, match="par must have shape"):
        run.par = [1.0, 2.0]
    with pytest.raises(InputError, match="unknown parameter"):
        run.par = {"mass": 1.0}
    with pytest.raises(InputError, match="finite"):
        run.until(np.inf)
    with pytest.raises(InputError, match="problem must be a Problem"):
        start("kepler")


def test_the_page_s_examples_are_true():
    page = Path(__file__).parents[3] / "docs" / "howto" / "stepping.md"
    assert doctest.testfile(str(page), module_relative=False).failed == 0


STEP = """
import sys
import problems
from integrators import start

run = start(problems.load("kepler"))
run.step()
count = 0

def see(frame, event, argument):
    global count
    count += event == "call"

sys.setprofile(see)
run.step()
sys.setprofile(None)
print(count)
count = 0
sys.setprofile(see)
run.t
sys.setprofile(None)
print(count)
"""


def test_a_step_calls_few_functions():
    # In a process of its own: one that has run a field in Python takes over Ctrl-C around every step.
    done = subprocess.run([sys.executable, "-c", STEP], capture_output=True, text=True, check=True)
    step, time = map(int, done.stdout.split())
    assert step <= 12
    assert time <= 3  # the state is not copied for it


@pytest.mark.parametrize(
    "method", [HBVM(), Gauss(s=5, tol=1e-10), Gauss(s=4, h=0.11), HBVM(k=8, s=4, h=0.11)], ids=repr
)
@pytest.mark.parametrize("events", [[], [Event(lambda y: y[0] - 0.3, name="e")]], ids=["plain", "events"])
@pytest.mark.parametrize("goals", [[13.0], [9.0, 13.0], [3.0, -2.0], [10.0, 11.0], [None, 13.0]], ids=str)
def test_a_run_goes_on_beyond_the_problem_s_interval(method, events, goals):
    oscillator = VectorField(lambda y: [y[1], -y[0]], dim=2)
    run = start(Problem(oscillator, y0=[1.0, 0.0], t_end=10.0), method, events)
    for goal in goals:
        if goal is None:
            while run.t < 10.5:
                run.step()
            continue
        run.until(goal)
        assert (run.status, run.t) == (Status.RUNNING, goal)
        # Measured 1e-14; 1.7 with fixed steps where one call of the stepper went past the end.
        assert np.abs(run.y - [np.cos(goal), -np.sin(goal)]).max() < 1e-11
