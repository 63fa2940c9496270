"""Events that change the state: steps end there, and everything goes on from the new state."""

import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import integrators
from integrators import HBVM, Event, Gauss, LineIntegral, Status, Taylor
from problems import Hamiltonian, Problem, VectorField
from problems.errors import InputError

integrate: Any = integrators.integrate
integrate_many: Any = integrators.integrate_many
BALL = Hamiltonian(lambda q, p: p[0] ** 2 / 2 + q[0], dof=1, name="ball")
PLAIN = VectorField(lambda y: [y[1], -1.0], dim=2, name="ball as a field")
END = 30.0
BOTH = pytest.mark.parametrize("method", [HBVM(), HBVM(k=4, s=2, h=0.1)], ids=repr)


def bouncing(restitution, *, python=False, **options):

    def traced(y):
        return [y[0], -restitution * y[1]]

    def code(y):
        return np.asarray([y[0], -restitution * float(y[1])])

    return Event(lambda y: y[0], direction=-1, then=code if python else traced, name="bounce", **options)


def impacts(restitution, height=1.0, end=END):
    """Return the times of impacts from rest, and the speeds after them."""
    v = math.sqrt(2.0 * height)
    times, speeds = [v], [restitution * v]
    while times[-1] + 2.0 * speeds[-1] < end and len(times) < 200:
        times.append(times[-1] + 2.0 * speeds[-1])
        speeds.append(restitution * speeds[-1])
    return np.array(times), np.array(speeds)


def heights(t, restitution):
    """Return height and speed at times; a step may end at an impact but for rounding: those after it."""
    times, speeds = impacts(restitution)
    i = np.searchsorted(times - 1e-11, t, side="right") - 1
    since = t - times[i]
    fallen = i < 0
    h = np.where(fallen, 1.0 - t * t / 2.0, speeds[i] * since - since * since / 2.0)
    return np.stack([h, np.where(fallen, -t, speeds[i] - since)], axis=1)


@pytest.mark.parametrize("python", [False, True])
@pytest.mark.parametrize("restitution", [1.0, 0.95])
@pytest.mark.parametrize(
    "method",
    [
        HBVM(), HBVM(k=8, s=7, tol=1e-10), Gauss(s=4, tol=1e-10), HBVM(k=4, s=2, h=0.1), Gauss(s=4, h=0.25),
        HBVM(k=4, s=2, h=3.0),  # longer than the time between two impacts
        HBVM(k=8, s=4, h=0.7, solver="newton"),
    ],
    ids=repr,
)  # fmt: skip
def test_a_ball_bounces(method, restitution, python):
    grid = np.linspace(0.0, END, 101)
    for system in (BALL, PLAIN):
        problem = Problem(system, y0=[1.0, 0.0], t_end=END)
        event = bouncing(restitution, python=python)
        for sample in (None, "steps", "dense"):
            found = integrate(problem, method, grid, sample, events=event)
            assert found.status is Status.FINISHED
            assert np.abs(found.y - heights(found.t, restitution)).max() < 1e-12  # measured 6e-14
        times, speeds = impacts(restitution)
        hits = found.events["bounce"]
        assert np.abs(hits.t - times).max() < 1e-12  # measured 7e-14
        assert np.abs(hits.after[:, 1] - speeds).max() < 1e-12
        assert np.array_equal(hits.after[:, 1], -restitution * hits.y[:, 1])
        assert np.abs(hits.y[:, 0]).max() < 1e-13


@BOTH
def test_a_solution_is_known_at_any_time_and_from_its_file(method, tmp_path):
    found = integrate(Problem(BALL, y0=[1.0, 0.0], t_end=END), method, [END / 3, END], events=bouncing(0.95))
    times = np.linspace(0.0, END, 500)
    assert np.abs(found(times) - heights(times, 0.95)).max() < 1e-12  # measured 8e-14
    hits = found.events["bounce"]
    assert np.array_equal(found(hits.t), hits.after)
    found.save(tmp_path / "ball.npz")
    loaded: Any = integrators.load(tmp_path / "ball.npz")
    assert np.array_equal(loaded.events["bounce"].after, hits.after)
    assert np.array_equal(loaded(times), found(times))
    assert pickle.loads(pickle.dumps(found)).events["bounce"].after.tolist() == hits.after.tolist()
    assert found.warnings == ()  # the ball has lost energy at the floor, the method none


@pytest.mark.parametrize(
    "method", [HBVM(), HBVM(k=4, s=2, h=0.1), Gauss(s=4, h=0.25), HBVM(k=4, s=2, h=3.0)], ids=repr
)
def test_a_ball_that_comes_to_rest_has_a_status(method):
    for restitution, end in ((0.9, 19.0), (0.5, 3.0)):
        problem = Problem(BALL, y0=[1.0, 0.0], t_end=100.0)
        found = integrate(problem, method, events=bouncing(restitution))
        assert found.status is Status.STALLED
        assert "accumulate at t = " in found.reason
        assert abs(found.t_stop - end * math.sqrt(2.0)) < 1e-9  # measured 1.3e-10, with fixed steps 1e-12
        assert found.y[:, 0].min() > -1e-12
    stops = Event(lambda q: q[0], direction=-1, then=lambda q: [q[0], 0.0], name="clay")
    found = integrate(Problem(BALL, y0=[1.0, 0.0], t_end=100.0), method, events=stops)
    assert found.status is Status.STALLED
    assert abs(found.t_stop - math.sqrt(2.0)) < 1e-14


@BOTH
def test_a_kick_that_goes_on_through_the_surface_happens_once(method):
    kick = Event(lambda q: q[0] - 0.5, then=lambda q, p: [q[0], 2.0 * p[0]], name="kick")
    free = Hamiltonian(lambda q, p: p[0] ** 2 / 2, dof=1)
    found = integrate(Problem(free, q0=[0.0], p0=[1.0], t_end=2.0), method, [2.0], events=kick)
    assert found.events["kick"].t.tolist() == [0.5]
    assert np.abs(found.y[-1] - [3.5, 2.0]).max() < 1e-14


def billiard(**options):
    """Return a disc in the unit square, with four walls that have nothing to do with each other."""
    free = VectorField(lambda y: [y[2], y[3], 0.0, 0.0], dim=4, name="billiard")
    walls = [
        Event(lambda y: y[0], direction=-1, then=lambda y: [y[0], y[1], -y[2], y[3]], name="left"),
        Event(lambda y: y[0] - 1, direction=1, then=lambda y: [y[0], y[1], -y[2], y[3]], name="right"),
        Event(lambda y: y[1], direction=-1, then=lambda y: [y[0], y[1], y[2], -y[3]], name="bottom"),
        Event(
            lambda y: y[1] - 1, direction=1, then=lambda y: [y[0], y[1], y[2], -y[3]], name="top", **options
        ),
    ]
    return free, walls


@BOTH
@pytest.mark.parametrize("start", [[0.3, 0.4, 0.7, 0.31], [0.5, 0.5, 1.0, 1.0]])
def test_a_billiard_has_its_walls_in_order_and_corners_at_once(start, method):
    free, walls = billiard()
    watch = Event(lambda y: y[0] - y[1] / 3 - 0.2, name="watch")
    grid = np.linspace(0.0, 40.0, 81)
    found = integrate(Problem(free, y0=start, t_end=40.0), method, grid, events=[*walls, watch])
    unfolded = np.array(start[:2]) + np.multiply.outer(grid, start[2:])
    expected = 1.0 - np.abs(unfolded % 2.0 - 1.0)
    assert found.status is Status.FINISHED
    assert np.abs(found.y[:, :2] - expected).max() < 1e-12  # measured 2e-14
    times = np.linspace(0.0, 40.0, 200001)
    path = 1.0 - np.abs((np.array(start[:2]) + np.multiply.outer(times, start[2:])) % 2.0 - 1.0)
    g = path[:, 0] - path[:, 1] / 3 - 0.2
    g = g[np.abs(g) > 1e-9]
    assert len(found.events["watch"]) == np.count_nonzero(g[1:] * g[:-1] < 0.0)


@BOTH
def test_a_terminal_event_ends_before_or_at_an_action(method):
    free, walls = billiard(terminal=3)
    grid = np.linspace(0.0, 40.0, 401)
    found = integrate(Problem(free, y0=[0.3, 0.4, 0.7, 0.31], t_end=40.0), method, grid, events=walls)
    assert found.status is Status.EVENT
    assert abs(found.t_stop - 4.6 / 0.31) < 1e-13
    assert found.t[-1] <= found.t_stop < found.t[-1] + 0.1
    top = found.events["top"]
    assert len(top) == 3
    assert np.array_equal(top.y[2], top.after[2])
    assert len(found.events["bottom"]) == 2
    passing = Event(lambda y: y[0] - 0.9, direction=1, terminal=2, name="passing")
    found = integrate(
        Problem(free, y0=[0.3, 0.4, 0.7, 0.31], t_end=40.0), method, grid, events=[*walls[:2], passing]
    )
    assert abs(found.t_stop - 2.6 / 0.7) < 1e-13
    assert len(found.events["right"]) == 1


@pytest.mark.parametrize("sample", ["partial", "steps"])
@BOTH
def test_checkpoints_go_on_bit_for_bit(method, sample, tmp_path):
    problem = Problem(BALL, y0=[1.0, 0.0], t_end=END)
    grid = np.linspace(0.0, END, 61)
    whole = integrate(problem, method, grid, sample, events=bouncing(0.95))
    path = Path(tmp_path / "ball.ckpt")

    def after(count):
        """Return what presses Ctrl-C at a report of the progress."""
        reports = iter(range(count))

        def report(progress):
            if next(reports, None) is None:
                raise KeyboardInterrupt

        return report

    found: Any = None
    for count in (2, 3, 4):
        found = integrate(
            problem, method, grid, sample, events=bouncing(0.95), checkpoint=path, every_seconds=0.0,
            resume=path, progress=after(count),
        )  # fmt: skip
        assert found.status is Status.INTERRUPTED
    assert 0.0 < found.t_stop < END
    found = integrate(problem, method, grid, sample, events=bouncing(0.95), resume=path)
    assert found.status is Status.FINISHED
    assert np.array_equal(found.y, whole.y)
    assert np.array_equal(found.events["bounce"].after, whole.events["bounce"].after)
    with pytest.raises(InputError, match="is a checkpoint of"):
        integrate(problem, method, grid, sample, events=bouncing(0.9), resume=path)


@BOTH
def test_pieces_of_a_trajectory_have_the_bits_of_the_whole(method):
    program: Any = method.compile(BALL)
    problem = Problem(BALL, y0=[1.0, 0.0], t_end=END)
    events = {"bounce": bouncing(0.95)}
    start = program.with_events(problem, events)
    grid = np.linspace(0.25, END, 120)
    steppers = [start(problem.y0, problem.par, 0.0, END) for _ in range(3)]
    for stepper in steppers:
        stepper.destination = END
    first, second, unbroken = steppers
    whole = unbroken.advance(grid).y
    for t, state in zip(grid, whole, strict=True):
        assert np.array_equal(first.advance(np.array([t])).y[0], state), t
        second.restore(first.checkpoint())
        second.search.load(first.search.save())
        first, second = second, first


@BOTH
def test_trajectories_of_an_ensemble_bounce_as_each_does_alone(method, tmp_path):
    starts = np.stack([np.linspace(0.5, 2.0, 7), np.zeros(7)], axis=1)
    problem = Problem(BALL, y0=[1.0, 0.0], t_end=END)
    many = integrate_many(problem, method, starts=starts, times=[7.0, END], events=bouncing(0.95), threads=2)
    for i, y0 in enumerate(starts):
        alone = integrate(Problem(BALL, y0=y0, t_end=END), method, [7.0, END], events=bouncing(0.95))
        together, bounces = many.events[i]["bounce"], alone.events["bounce"]
        close = 0.0 if method.h else 2e-13  # one by one with a fixed step; measured in lanes 6e-14
        assert np.abs(many.y[i] - alone.y).max() <= close
        assert np.abs(together.t - bounces.t).max() <= close
        assert np.abs(together.after - bounces.after).max() <= close
        assert np.abs(many.errors()["energy"][i] - alone.errors()["energy"]).max() <= close
    assert many.warnings == [()] * 7
    many.save(tmp_path / "balls.npz")
    loaded: Any = integrators.load(tmp_path / "balls.npz")
    assert np.array_equal(loaded.events[3]["bounce"].after, many.events[3]["bounce"].after)


@BOTH
def test_it_bounces_backwards_and_step_by_step(method):
    forth = integrate(Problem(BALL, y0=[1.0, 0.0], t_end=10.0), method, [10.0], events=bouncing(1.0))
    back = Problem(BALL, y0=forth.y[-1], t0=10.0, t_end=0.0)
    assert np.abs(integrate(back, method, [0.0], events=bouncing(1.0)).y[-1] - [1.0, 0.0]).max() < 1e-13
    run: Any = integrators.start(Problem(BALL, y0=[1.0, 0.0], t_end=END), method, events=bouncing(0.95))
    while run.t < 10.0:
        assert run.step() is Status.RUNNING
        assert run.y[0] > -1e-13
    assert np.abs(run.y - heights(np.array([run.t]), 0.95)[0]).max() < 1e-12
    assert len(run.events["bounce"]) == np.count_nonzero(impacts(0.95)[0] < run.t + 1e-9)
    assert run.events["bounce"].after.shape == run.events["bounce"].y.shape
    for t in (11.0, 11.001, 20.0):  # within a step, and after impacts
        assert np.abs(run.until(t) - heights(np.array([t]), 0.95)[0]).max() < 1e-12


def test_fixed_steps_are_counted_from_the_event():
    method, h = Gauss(s=3, h=0.3), 0.3
    program: Any = method.compile(BALL)
    problem = Problem(BALL, y0=[1.0, 0.0], t_end=4.0)
    found = integrate(problem, method, [4.0], "steps", events=bouncing(1.0))
    impact, second = (np.sqrt(2.0), 3.0 * np.sqrt(2.0))
    after = impact + h * np.arange(9)
    expected = np.concatenate([h * np.arange(1, 5), after])
    assert second > 4.0 > after[-1]
    assert np.abs(found.t - expected).max() < 1e-14
    bounce = found.events["bounce"]
    assert np.array_equal(found.y[4], bounce.after[0])
    again = program.start(bounce.after[0], problem.par, bounce.t[0]).take(8)
    assert np.array_equal(again.y, found.y[5:])
    stepper = program.with_events(problem, {"bounce": bouncing(1.0)})(problem.y0, problem.par, 0.0, 4.0)
    one_by_one = [stepper.take(n) for n in (1, 2, 5)]  # the event is one of the steps
    assert np.array_equal(np.concatenate([taken.y for taken in one_by_one]), found.y[:8])
    assert found.stats.steps == 13
    marched = program.with_events(problem, {"bounce": bouncing(1.0)})(problem.y0, problem.par, 0.0, 4.0)
    assert np.array_equal(marched.march(4.0, 6).y, found.y[:6])
    assert np.array_equal(marched.march(4.0, 100).y, found.y[6:])


def test_an_event_in_what_is_left_after_the_last_step_happens():
    method = HBVM(k=4, s=2, h=1.0)
    found = integrate(Problem(BALL, y0=[1.0, 0.0], t_end=1.5), method, [1.5], "steps", events=bouncing(1.0))
    assert np.abs(found.t - [1.0, math.sqrt(2.0)]).max() < 1e-15
    assert len(found.events["bounce"]) == 1


def test_errors_are_those_of_the_integration_and_not_what_events_take():
    problem = Problem(BALL, y0=[1.0, 0.0], t_end=END)
    for method in (HBVM(), HBVM(k=4, s=2, h=0.1)):
        at_impacts = np.append(impacts(0.95)[0], END)  # but for rounding
        for grid in (np.linspace(0.0, END, 301), at_impacts):
            found = integrate(problem, method, grid, events=bouncing(0.95))
            assert found.errors()["energy"].max() < 1e-13  # measured 4e-14
            assert "energy 5.7e-01" not in str(found)
            assert "since the last event that changes the state" in str(found)
        energy = found.invariants()["energy"]
        assert np.abs(energy[-1] / energy[0] - 0.95**28) < 1e-12  # 15 impacts, from the first


def test_a_state_that_is_no_number_names_the_event():
    problem = Problem(BALL, y0=[1.0, 0.0], t_end=END)

    def python(y):
        return np.asarray([y[0], float("nan")])

    for then in (lambda y, m: [y[0], m.sqrt(y[1])], python):
        event = Event(lambda y: y[0], direction=-1, then=then, name="bounce")
        for method in (HBVM(), HBVM(k=4, s=2, h=0.1)):
            found = integrate(problem, method, events=event)
            assert found.status is Status.NOT_FINITE
            assert (
                "then of the event 'bounce' returns a number that is not finite at t = 1.41" in found.reason
            )
            assert np.isfinite(found.y).all()
            assert len(found.events["bounce"]) == 0


def test_reversible_steps_begin_anew():
    ball = Hamiltonian(lambda q, p: p[0] ** 2 / 2 + q[0] + q[0] ** 4 / 8, dof=1, name="anharmonic ball")
    problem = Problem(ball, y0=[1.0, 0.0], t_end=END)
    found = integrate(problem, Gauss(s=4, tol=1e-9, steps="reversible"), events=bouncing(0.95))
    exact = integrate(problem, HBVM(), events=bouncing(0.95))
    assert found.status is Status.FINISHED
    assert len(found.events["bounce"]) == len(exact.events["bounce"]) == 15
    assert np.abs(found.y - exact.y).max() < 1e-6  # measured 1e-9
    uniform = integrate(Problem(BALL, y0=[1.0, 0.0], t_end=END), Gauss(s=4, tol=1e-9, steps="reversible"))
    assert uniform.status is Status.STEP_UNDERFLOW  # with and without events
    assert "the time scale of the field, and this one has none at t = 0.0" in uniform.reason


def test_what_cannot_be_is_refused_and_what_raises_is_a_status():
    problem = Problem(BALL, y0=[1.0, 0.0], t_end=END)
    for method in (LineIntegral(k=4, s=2, tol=1e-8, invariants=["energy"]), Taylor()):
        with pytest.raises(InputError, match="use HBVM or Gauss, or leave out then="):
            integrate(problem, method, events=bouncing(1.0))
    with pytest.raises(InputError, match="then="):
        integrate(problem, HBVM(), events=bouncing(1.0), variations="y0")
    with pytest.raises(InputError, match="sample='stop' changes"):
        integrate(problem, HBVM(k=4, s=2, h=0.1), sample="stop", events=bouncing(1.0))
    with pytest.raises(InputError, match="2 numbers, the new state"):
        integrate(problem, HBVM(), events=Event(lambda q: q[0], then=lambda q: [q[0]]))
    with pytest.raises(InputError, match="then=3 of an event"):
        Event(lambda q: q[0], then=3)  # pyright: ignore[reportArgumentType]
    calls = []

    def fails(y):
        calls.append(float(y[1]))
        if len(calls) > 3:
            raise ZeroDivisionError("a ball that breaks")
        return [y[0], -y[1]]

    found = integrate(problem, HBVM(), events=Event(lambda y: y[0], direction=-1, then=fails, name="bounce"))
    assert found.status is Status.USER_ERROR
    assert "a ball that breaks" in found.reason
    assert isinstance(found.error, ZeroDivisionError)
    assert len(found.events["bounce"]) == 2  # one call was to see what it returns
    assert found.t[-1] < 5.0 * math.sqrt(2.0)


PENDULUM = Hamiltonian(
    lambda q, p, par, m: (
        p[0] ** 2 / 2 - par.g * m.cos(q[0]) + (q[1] ** 2 + p[1] ** 2) / 2 + 0.1 * q[0] ** 2 * q[1]
    ),
    dof=2, parameters={"g": 1.0}, name="pendulum and oscillator",
)  # fmt: skip


def by_hand(problem, event):
    """Return the times of an event's actions and the last state, by a new start after each."""
    t, y, end, times = problem.t0, problem.y0, problem.t_end, []
    while True:
        piece = Problem(PENDULUM, y0=y, parameters={"g": float(problem.par[0])}, t0=t, t_end=end)
        plain = Event(event.g, direction=event.direction, name="plain")
        found = integrate(piece, HBVM(), [end], events=plain)
        hits = found.events["plain"]
        later = np.flatnonzero(hits.t > t + 1e-9 * bool(times))  # it may find the same zero again
        if not later.size:
            return np.array(times), found.y[-1]
        t, y = float(hits.t[later[0]]), hits.y[later[0]]
        y = np.array(event.then(y[:2], y[2:]))
        times.append(t)


@pytest.mark.slow
def test_random_kicks_agree_with_a_loop_by_hand():
    rng = np.random.default_rng(5)
    for case in range(30):
        level, gain = rng.uniform(-0.5, 0.5), rng.choice([-1.0, -0.9, 0.9, 1.05, 1.0])
        direction = int(rng.choice([-1, 1] if gain < 0.0 else [-1, 0, 1]))
        y0 = rng.uniform(-1.0, 1.0, 4)
        if gain < 0.0:
            y0[0] = level - 0.3 * direction

        def then(q, p, gain=gain):
            return [q[0], q[1], gain * p[0], p[1]]

        event = Event(lambda q, level=level: q[0] - level, direction=direction, then=then, name="kick")
        problem = Problem(PENDULUM, y0=y0, parameters={"g": rng.uniform(0.5, 2.0)}, t_end=15.0)
        method = (HBVM(), HBVM(k=8, s=7, tol=1e-10), Gauss(s=5, tol=1e-11), Gauss(s=8, h=0.1))[case % 4]
        found = integrate(problem, method, np.linspace(0.0, 15.0, 31), events=event)
        times, end = by_hand(problem, event)
        assert found.events["kick"].t.shape == times.shape, case
        assert np.abs(found.events["kick"].t - times).max(initial=0.0) < 1e-8  # measured 1e-9
        assert np.abs(found.y[-1] - end).max() < 1e-7  # measured 4e-9


@pytest.mark.parametrize("method", [HBVM(), HBVM(tol=1e-8), HBVM(k=8, s=4, h=0.05)], ids=str)
@pytest.mark.parametrize("end", [20.0, -20.0])
def test_events_of_one_function_happen_together_once(method, end):
    phase = 3.7563671
    problem = Problem(
        VectorField(lambda y: [y[1], -y[0]], dim=2), y0=[np.cos(phase), -np.sin(phase)], t_end=end
    )
    events = [
        Event(lambda y: y[0], name="plain"),
        Event(lambda y: y[0], then=lambda y: [3 * y[0], 3 * y[1]], name="first"),
        Event(lambda y: y[0], then=lambda y: [3 * y[0], 3 * y[1]], name="second"),
    ]
    solution = integrate(problem, method, events=events)  # without `insist` the step to an event may fail
    assert solution.status is Status.FINISHED  # it multiplies the rounding of a zero by nine
    counts = {name: len(hits) for name, hits in solution.events.items()}
    assert set(counts.values()) == {6 if end < 0 else 7}
    plain = solution.events["plain"]
    assert np.abs(plain.t - solution.events["second"].t).max() < 1e-13  # measured 0
    radii = np.hypot(*plain.y.T)
    assert radii == pytest.approx(9.0 ** np.arange(radii.size), rel=1e-13)  # measured 5e-16
