"""What a program has integrated before leaves no trace in what it integrates next."""

import threading
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import problems
from integrators import HBVM, Event, Gauss, LineIntegral, integrate, integrate_many
from integrators.events.event import named
from integrators.running.integrate import prepared

KEPLER = problems.load("kepler")
STIFF = problems.Problem(
    problems.VectorField(lambda y: [y[1], 500.0 * (1 - y[0] ** 2) * y[1] - y[0]], dim=2),
    y0=[2.0, 0.0],
    t_end=1.0,
)
SPRING = problems.Hamiltonian(
    lambda q, p, par: p[0] ** 2 / (2 * par.mass) + par.k * q[0] ** 4,
    dof=1,
    parameters={"k": 1.0, "mass": 1.0},
)


METHODS = [
    HBVM(),
    HBVM(tol=1e-6),
    HBVM(tol=1e-6, projection="energy"),
    HBVM(k=8, s=4, h=0.05),
    Gauss(s=4, h=0.05, solver="newton"),
    Gauss(s=4, tol=1e-8, steps="reversible"),
    LineIntegral(k=8, s=4, h=0.05, invariants=["energy"]),
]


def spring(k, mass, start, end):
    return problems.Problem(SPRING, q0=[start], p0=[0.3], parameters={"k": k, "mass": mass}, t_end=end)


def bits(solution):
    return solution.y.tobytes(), solution.t.tobytes(), solution.stats, solution.status, solution.reason


SPRINGS = st.builds(
    spring,
    st.sampled_from([0.5, 2.0]),
    st.sampled_from([1.0, 3.0]),
    st.floats(0.5, 2.0),
    st.sampled_from([-2.0, 0.01, 3.0]),
)


@pytest.mark.parametrize("method", METHODS, ids=repr)
@settings(max_examples=8)
@given(
    others=st.lists(SPRINGS, min_size=1, max_size=3),
    last=SPRINGS,
    sample=st.sampled_from(["steps", "stop", None]),
)
def test_what_was_integrated_before_leaves_no_trace(method, others, last, sample):
    alone = bits(integrate(last, method, sample=sample))
    for other in others:
        integrate(other, method, sample=sample)
    assert bits(integrate(last, method, sample=sample)) == alone


def test_a_trajectory_takes_the_memory_of_one_that_is_over():
    made: Any = HBVM().compile(KEPLER.system)
    first, second = (made.start(KEPLER.y0) for _ in range(2))
    place = first._context.address
    del first
    third, fourth = (made.start(KEPLER.y0) for _ in range(2))
    assert third._context.address == place
    assert len({place, second._context.address, fourth._context.address}) == 3


def test_a_search_for_events_takes_the_memory_of_one_that_is_over():
    made: Any = HBVM().compile(KEPLER.system)
    search = made.with_events(KEPLER, named(Event(lambda q: q[1])))

    def first_event(end):
        stepper = search(KEPLER.y0, KEPLER.par, 0.0, end)
        stepper.advance([end])
        return stepper.search._memory.address, stepper.search.hits.occurrences()["event"].t[0]

    assert first_event(10.0) == first_event(11.0)


@pytest.mark.parametrize("method", [HBVM(), HBVM(k=8, s=4, h=0.05)], ids=repr)
@pytest.mark.parametrize("then", [None, lambda q, p: [q[0], q[1], -p[0], -p[1]]], ids=["looks", "acts"])
def test_what_was_searched_before_leaves_no_trace(method, then):
    if then is not None and method.options().get("h"):
        pytest.skip("no actions with fixed steps")
    events = [Event(lambda q: q[1], terminal=3, name="a", then=then), Event(lambda q: q[0] - 0.1, name="b")]
    starts = KEPLER.y0 * np.linspace(0.8, 1.2, 7)[:, None]
    starts[3] *= -1.0
    for end in (9.0, -9.0):
        own = np.full((7, 1), end)  # times of their own: trajectories go one by one
        together = integrate_many(KEPLER, method, starts=starts, times=own, events=events)
        for i, y0 in enumerate(starts):
            made = method.compile(KEPLER.system)  # whose memory is fresh
            kept = made.with_events(KEPLER, named(events))(y0, KEPLER.par, 0.0, end)
            kept.advance([end])
            kept.look_to(end)
            found = kept.search.hits.occurrences()
            for name, one in together.events[i].items():
                for key in ("t", "y", "direction"):
                    assert np.array_equal(getattr(one, key), getattr(found[name], key)), (i, name, key)


def test_an_event_is_compiled_once_and_its_search_has_room_for_all():
    level = 0.0
    end = 4000.0  # more events than there is room for
    event = Event(lambda q: q[1] - level, name="level")
    made: Any = prepared(HBVM(), KEPLER.system)[0]
    first = integrate(KEPLER, HBVM(), end, events=event)
    kept = made.with_events(KEPLER, named(event))
    assert made.with_events(KEPLER, named(event)) is kept
    again = integrate(KEPLER, HBVM(), end, events=event)
    assert first.events["level"].t.size > 1024
    assert np.array_equal(first.events["level"].t, again.events["level"].t)
    level = 0.25
    other = Event(event.g, name="level")
    assert made.with_events(KEPLER, named(other)) is not kept
    found = integrate(KEPLER, HBVM(), 10.0, events=other).events["level"]
    assert np.abs(found.y[:, 1] - level).max() < 1e-14  # measured: 2e-16


def test_a_function_that_raises_at_the_start_leaves_no_trace():
    def g(q):
        if q[0] < 0.0:
            raise RuntimeError("behind")
        return float(q[1])

    starts = np.array([KEPLER.y0, -KEPLER.y0, KEPLER.y0])
    made = integrate_many(KEPLER, HBVM(), starts=starts, times=[0.1], events=Event(g, name="g"))
    assert [str(status) for status in made.status] == ["finished", "user_error", "finished"]
    assert np.array_equal(made.y[0], made.y[2])


def test_an_implicit_solver_that_came_later_is_not_handed_on():
    first = integrate(STIFF, HBVM())
    assert first.stats.extra["implicit"]["switches"] > 0
    again = integrate(STIFF, HBVM())
    assert bits(again) == bits(first)


@pytest.mark.parametrize("method", [HBVM(), HBVM(k=8, s=4, h=0.05)], ids=repr)
def test_what_is_no_number_is_not_handed_on(method):
    field = problems.VectorField(lambda t, y, m: [m.sqrt(y[0]) - 2.0 - y[1], y[0] * y[1]], dim=2)
    fails = problems.Problem(field, y0=[1.0, 1.0], t_end=5.0)
    goes = problems.Problem(field, y0=[9.0, -1.0], t_end=0.5)
    alone = bits(integrate(goes, method))
    assert integrate(fails, method).status.failed
    assert bits(integrate(goes, method)) == alone


def test_two_threads_have_memory_of_their_own():
    expected = [integrate(KEPLER, HBVM(), end).y.tobytes() for end in (20.0, 30.0)]
    wrong = []

    def run(end, alone):
        for _ in range(30):
            if integrate(KEPLER, HBVM(), end).y.tobytes() != alone:
                wrong.append(end)

    threads = [threading.Thread(target=run, args=each) for each in zip((20.0, 30.0), expected, strict=True)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_samples_and_events_of_one_are_not_those_of_the_next():
    def crosses(t, y):
        return y[1]

    first = integrate(KEPLER, HBVM(), [1.0, 20.0], events=crosses)
    kept = first.y.copy(), first.events["crosses"].y.copy()
    integrate(KEPLER, HBVM(), [2.0, 30.0], events=crosses)
    integrate(KEPLER, HBVM(), [2.0, 30.0])
    assert np.array_equal(first.y, kept[0])
    assert np.array_equal(first.events["crosses"].y, kept[1])
