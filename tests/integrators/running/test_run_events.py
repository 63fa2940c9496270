"""A trajectory taken step by step stands at the terminal event that ended it."""

import numpy as np
import pytest

import problems
from integrators import HBVM, Event, Gauss, LineIntegral, Status, Taylor, integrate, integrate_many, start
from integrators.protocol import MethodBase

BALL = problems.Problem(
    problems.Hamiltonian(
        lambda q, p, par, m: p[0] ** 2 / 2 + q[0] + par.k * m.sin(q[0]), dof=1, parameters={"k": 0.01}
    ),
    q0=[1.0], p0=[0.0], t_end=10.0,
)  # fmt: skip
FLOOR = Event(lambda q: q[0], direction=-1, terminal=True, name="floor")
METHODS: list[MethodBase] = [
    HBVM(),
    HBVM(k=4, s=2, h=0.3),
    Gauss(s=2, h=0.3),
    Gauss(s=3, tol=1e-10),
    LineIntegral(k=4, s=2, h=0.3, invariants=["energy"]),
    Taylor(),
]


@pytest.mark.parametrize("method", METHODS, ids=str)
@pytest.mark.parametrize("goals", [[5.0], [1.3, 5.0], [1.45], [1.3, 1.45], None], ids=str)
def test_it_stands_at_the_event(method: MethodBase, goals: list[float] | None) -> None:
    run = start(BALL, method, FLOOR)
    if goals is None:
        for _ in range(10_000):
            if run.step() is not Status.RUNNING:
                break
    else:
        for goal in goals[:-1]:
            run.until(goal)
            assert (run.t, run.status, len(run.events["floor"])) == (goal, Status.RUNNING, 0)
        assert run.until(goals[-1]).tolist() == run.y.tolist()
    floor = integrate(BALL, method, [5.0], events=FLOOR).events["floor"]
    assert run.status is Status.EVENT
    assert "floor" in run.reason
    assert run.t == pytest.approx(floor.t[0], abs=1e-14)  # measured 2e-16
    assert run.y == pytest.approx(floor.y[0], abs=1e-14)  # measured 4e-16
    assert (len(run.events["floor"]), run.events["floor"].t[0]) == (1, run.t)
    assert run.energy() == pytest.approx(1.0 + 0.01 * np.sin(1.0), abs=1e-6)  # measured 2e-7
    t, y = run.t, run.y
    assert run.step() is Status.EVENT
    assert run.until(9.0).tolist() == y.tolist()
    assert run.t == t


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_it_goes_on_from_the_event(method: MethodBase) -> None:
    run = start(BALL, method, FLOOR)
    run.until(5.0)
    first = run.t
    run.y = run.y * [1.0, -0.5]
    assert (run.t, run.status) == (first, Status.RUNNING)
    run.until(first + 0.1)
    assert 0.0 < run.y[0] < 0.1
    run.until(9.0)
    assert run.t == pytest.approx(first + 2 * 0.5 * first, abs=0.02)  # 3e-3, as k is not 0
    assert run.events["floor"].t.tolist() == [first, run.t]
    run.par = {"k": 0.005}
    assert run.status is Status.RUNNING
    run.y = run.y * [1.0, -1.0]
    up, t = run.y[1], run.t
    run.until(t + 0.2)
    assert run.y[0] == pytest.approx(0.2 * up - 0.02 * 1.005, abs=1e-6)  # measured 1e-7


def test_a_later_event_of_several_and_the_action_of_the_last() -> None:
    bounce = Event(lambda q: q[0], direction=-1, then=lambda q, p: [q[0], -p[0]], terminal=2, name="floor")
    run = start(BALL, HBVM(), bounce)
    run.until(20.0)
    floor = run.events["floor"]
    assert (run.status, len(floor)) == (Status.EVENT, 2)
    assert run.t == floor.t[-1]
    assert floor.after is not None
    assert run.y.tolist() == floor.after[-1].tolist()


def test_heyoka_keeps_the_samples_of_the_step_in_which_the_event_lies() -> None:
    solution = integrate(BALL, Taylor(), [0.5, 1.2, 1.3, 1.4, 1.405, 2.0], events=FLOOR)
    assert solution.t.tolist() == [0.5, 1.2, 1.3, 1.4, 1.405]
    assert solution.status is Status.EVENT


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_a_terminal_event_before_all_samples_leaves_its_state(method: MethodBase) -> None:
    solution = integrate(BALL, method, [10.0], events=FLOOR)
    floor = solution.events["floor"]
    assert (solution.t.tolist(), solution.y.tolist()) == (floor.t.tolist(), floor.y.tolist())
    assert solution.t_stop == solution.t[0]
    assert integrate(BALL, method, [0.5, 10.0], events=FLOOR).t.tolist() == [0.5]
    many = integrate_many(BALL, method, starts=[[1.0, 0.0], [2.0, 0.0]], times=[10.0], events=FLOOR)
    assert np.isnan(many.y).all()
    assert many[0].t == pytest.approx(floor.t, abs=1e-14)  # measured 0
    assert many[1].t.tolist() == many.events[1]["floor"].t.tolist()
    assert many[1].y.tolist() == many.events[1]["floor"].y.tolist()


def test_the_same_event_may_happen_on_the_way_back():
    oscillator = problems.VectorField(lambda y: [y[1], -y[0]], dim=2)
    problem = problems.Problem(oscillator, y0=[1.0, 0.0], t_end=10.0)
    double = Event(lambda t: t - 2.3, then=lambda y: [2 * y[0], 2 * y[1]], name="double")
    run = start(problem, HBVM(k=8, s=4, h=0.05), events=double)
    run.until(5.0)
    run.until(1.0)
    assert (run.status, run.t) == (Status.RUNNING, 1.0)
    assert abs(np.hypot(*run.y) - 4.0) < 1e-12  # twice doubled; measured 2e-15


def test_the_state_is_set_as_a_whole_by_an_operation_in_place():
    run = start(problems.load("kepler"), HBVM())
    before = run.y.copy()
    run.y *= 2.0
    assert np.array_equal(run.y, 2.0 * before)
    assert type(run.y * 2.0) is np.ndarray
    assert repr(run.y) == repr(np.asarray(run.y))
    with pytest.raises(problems.InputError, match="set the whole"):
        run.y[2:] *= 0.5


OSCILLATOR = problems.Problem(problems.VectorField(lambda y: [y[1], -y[0]], dim=2), y0=[1.0, 0.0], t_end=10.0)
DOUBLE = Event(lambda t: t - 2.3, then=lambda y: [2 * y[0], 2 * y[1]], name="double")
WAYS = [HBVM(), Gauss(s=5, tol=1e-10), HBVM(k=8, s=4, h=0.05)]


@pytest.mark.parametrize("method", WAYS, ids=str)
@pytest.mark.parametrize("place", [2.3, np.nextafter(2.3, 3.0), None], ids=["there", "beside", "step"])
def test_an_event_where_the_run_turns_happens_on_both_ways(method, place):
    run = start(OSCILLATOR, method, events=DOUBLE)
    if place is None:
        while run.t < 2.3:
            run.step()
    else:
        run.until(place)
    assert len(run.events["double"]) == 1
    run.until(1.0)
    assert run.status is Status.RUNNING
    assert run.events["double"].direction.tolist() == [1, -1]
    assert abs(np.hypot(*run.y) - 4.0) < 1e-12  # measured 0


@pytest.mark.parametrize("method", [*WAYS, Taylor()], ids=str)
def test_events_are_those_up_to_the_present_and_in_its_order(method):
    run = start(OSCILLATOR, method, events=[Event(lambda t: (t - 2.3) * (t - 2.35), name="two")])
    for goal, count in ((2.2, 0), (2.32, 1), (2.4, 2), (2.33, 3), (2.2, 4), (2.32, 5)):
        run.until(goal)
        assert len(run.events["two"]) == count
    assert run.events["two"].t == pytest.approx([2.3, 2.35, 2.35, 2.3, 2.3], abs=1e-14)  # measured 0
    assert run.events["two"].direction.tolist() == [-1, 1, -1, 1, -1]


@pytest.mark.parametrize("method", [*WAYS, Taylor()], ids=str)
def test_a_terminal_event_counts_the_way_back(method):
    run = start(OSCILLATOR, method, events=[Event(lambda t: t - 2.3, terminal=3, name="third")])
    run.until(3.0)
    run.until(1.0)
    assert (run.status, len(run.events["third"])) == (Status.RUNNING, 2)
    run.until(5.0)
    assert (run.status, len(run.events["third"])) == (Status.EVENT, 3)
    assert run.t == pytest.approx(2.3, abs=1e-14)  # measured 0


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_steps_go_the_way_of_the_problem_and_of_the_last_goal(method):
    back = problems.Problem(BALL.system, q0=[1.0], p0=[0.0], t_end=-10.0)
    run = start(back, method)
    run.step()
    assert run.t < 0.0
    run = start(BALL, method)
    run.until(-1.0)
    run.y = run.y
    run.step()
    assert run.t < -1.0


@pytest.mark.parametrize("method", WAYS, ids=str)
def test_an_event_function_that_raises_is_a_status_of_the_run(method):
    def above(t, y):
        if t > 1.0:
            raise LookupError("too late")
        return y[0] + 2.0

    run = start(OSCILLATOR, method, events=Event(above, name="above"))
    run.until(3.0)
    assert run.status is Status.USER_ERROR
    assert "too late" in run.reason


@pytest.mark.parametrize("method", METHODS, ids=str)
@pytest.mark.parametrize("direction", [0, 1, -1])
def test_the_zero_of_a_terminal_event_is_not_found_again(method, direction):
    oscillator = problems.Hamiltonian(lambda q, p: (q[0] ** 2 + p[0] ** 2) / 2, dof=1)
    event = Event(lambda q, p: q[0] - 0.2 * p[0], terminal=True, direction=direction, name="section")
    for phase in np.linspace(0.1, 6.1, 13):
        problem = problems.Problem(oscillator, q0=[np.sin(phase)], p0=[np.cos(phase)], t_end=30.0)
        run = start(problem, method, event)
        for _ in range(3):
            run.until(30.0)
            assert run.status is Status.EVENT
            run.y = run.y
            run.y = run.y  # once more, at the same time
        found = np.diff(run.events["section"].t)
        apart = 2.0 * np.pi if direction else np.pi
        assert found == pytest.approx([apart] * 2, abs=1e-3)  # measured 7e-5, of the method; or 0 or 1e-12
