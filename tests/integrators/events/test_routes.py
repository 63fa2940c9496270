"""One search: functions that are compiled or called, one trajectory or many, our methods or heyoka's."""

import signal
import subprocess
import sys

import numpy as np
import pytest

import integrators
import problems
from integrators import HBVM, Event, Gauss, LineIntegral, integrate, integrate_many, section
from integrators.protocol import Status
from problems import InputError, Opaque, Problem

METHODS = [
    HBVM(k=6, s=4, h=0.5),
    HBVM(k=20, s=12, h=1.0),
    HBVM(k=8, s=4, h=0.2, solver="newton"),
    HBVM(k=10, s=5, tol=1e-10),
    LineIntegral(k=6, s=4, h=0.25, invariants=["energy"]),
]


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_compiled_and_called_functions_give_the_same(henon_heiles, method):
    pairs = [
        (lambda q: q[0], lambda t, y: float(y[0])),
        (lambda q, t, m: m.sin(3 * t) / 2 - q[0] / 10, lambda t, y: np.sin(3 * t) / 2 - float(y[0]) / 10),
        (lambda q, m: m.abs(q[0]) - 0.1, lambda t, y: abs(float(y[0])) - 0.1),
    ]
    events = [Event(g, name=f"{i}{j}") for i, pair in enumerate(pairs) for j, g in enumerate(pair)]
    made = integrate(henon_heiles, method, [50.0], events=events)
    assert made.status is Status.FINISHED
    for i in range(len(pairs)):
        compiled, called = made.events[f"{i}0"], made.events[f"{i}1"]
        assert len(compiled) >= 10
        assert np.abs(compiled.t - called.t).max() < 2e-14  # measured 7.1e-15, in a few
        assert np.array_equal(compiled.direction, called.direction)
        assert np.abs(compiled.y - called.y).max() < 2e-14  # measured 3.6e-15


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_a_state_is_that_of_the_method_at_the_time(henon_heiles, method):
    made = integrate(henon_heiles, method, [50.0], events=Event(lambda q: q[1], name="axis"))
    found = made.events["axis"]
    again = integrate(henon_heiles, method, found.t)
    assert np.abs(again.y - found.y).max() < 5e-15  # measured 8.9e-16


def test_adaptive_steps_and_work_stay_what_they_are(henon_heiles):
    alone = integrate(henon_heiles, HBVM(), [50.0])
    made = integrate(henon_heiles, HBVM(), [50.0], events=lambda q: q[0])
    assert alone.y.tobytes() == made.y.tobytes()
    assert alone.stats.iterations == made.stats.iterations
    work = made.stats.extra["event_search"]
    # Measured 3.0 for each.
    assert work["partial_steps"] <= 5 * len(made.events["event"])


def test_more_than_the_buffer_holds_and_more_than_it_holds_in_one_step():
    turn = Problem(problems.VectorField(lambda y: [y[1], -y[0]], dim=2), y0=[0.0, 1.0], t_end=400.0)
    fast = Event(lambda t, m: m.sin(40 * t + 0.5), name="fast")
    made = integrate(turn, HBVM(k=10, s=8, h=4.0), [400.0], events=[fast, Event(lambda y: y[0], name="y")])
    zeros = (np.pi * np.arange(1, 5100) - 0.5) / 40
    assert np.allclose(made.events["fast"].t, zeros[zeros < 400.0], rtol=0, atol=1e-11)
    assert (np.diff(made.events["fast"].t) > 0.0).all()
    springs = problems.Hamiltonian(
        lambda q, p, m: m.sum(lambda i: (q[i] ** 2 + p[i] ** 2) / 2, range(512)), dof=512
    )
    large = Problem(springs, y0=np.ones(1024), t_end=2.0)  # room for 128 of its states
    made = integrate(large, Gauss(s=3, h=1.0), [2.0], events=Event(lambda t, m: m.sin(500 * t), name="t"))
    assert len(made.events["t"]) == 318
    assert np.allclose(made.events["t"].t, np.pi / 500 * np.arange(1, 319), rtol=0, atol=1e-14)


def test_a_terminal_event_between_two_others_in_a_step():
    turn = Problem(problems.VectorField(lambda y: [y[1], -y[0]], dim=2), y0=[0.0, 1.0], t_end=40.0)
    events = [
        Event(lambda t, m: m.sin(10 * t), name="fast"),
        Event(lambda t: t - 1.0, name="one", terminal=True),
    ]
    made = integrate(turn, Gauss(s=8, h=2.0), np.linspace(0.0, 40.0, 401), events=events)
    assert made.status is Status.EVENT
    assert (made.t_stop, made.t[-1]) == (1.0, 1.0)
    assert np.allclose(made.events["fast"].t, np.pi / 10 * np.arange(1, 4), rtol=0, atol=1e-14)


class TestMany:
    def given(self, henon_heiles, n=5):
        return henon_heiles.y0 + 0.01 * np.arange(n)[:, None] * [1, -1, 1, 1]

    @pytest.mark.parametrize("threads", [1, 3])
    @pytest.mark.parametrize("method", [HBVM(k=6, s=4, h=0.25), HBVM()], ids=repr)
    def test_each_trajectory_has_its_own(self, henon_heiles, method, threads):
        starts, times = self.given(henon_heiles), [20.0, 50.0]
        events = [Event(lambda q: q[0], name="section", direction=1, terminal=6), lambda t, y: float(y[1])]
        many = integrate_many(
            henon_heiles, method, starts=starts, times=times, threads=threads, events=events
        )
        assert len(many.events) == len(starts)
        for i, start in enumerate(starts):
            one = Problem(henon_heiles.system, y0=start, t_end=50.0)
            alone = integrate(one, method, times, events=events)
            assert many.status[i] is alone.status
            close = 0.0 if method.h else 2e-13  # one by one with a fixed step; measured in lanes 8e-14
            assert many.reason[i].split(" at t =")[0] == alone.reason.split(" at t =")[0]
            assert many.reason[i].endswith(f"t = {float(many.t_stop[i])!r}.") or not alone.reason
            assert abs(many.t_stop[i] - alone.t_stop) <= close
            assert np.abs(many.y[i][: alone.t.size] - alone.y).max() <= close
            assert np.isnan(many.y[i][alone.t.size :]).all()
            for name, found in alone.events.items():
                assert np.abs(many.events[i][name].t - found.t).max() <= close
                assert np.abs(many.events[i][name].y - found.y).max() <= close
        assert Status.EVENT in many.status

    def test_what_a_function_raises_is_the_trajectorys_own(self, henon_heiles):
        def g(t, y):
            if y[0] > 0.44:
                raise LookupError("out of the table")
            return float(y[0])

        starts = self.given(henon_heiles)
        many = integrate_many(
            henon_heiles, HBVM(k=6, s=4, h=0.25), starts=starts, times=[50.0], threads=2, events=Event(g)
        )
        assert set(many.status) == {Status.FINISHED, Status.USER_ERROR}
        assert all("out of the table" in many.reason[i] for i in np.flatnonzero(~many.arrived))

    def test_each_event_has_what_its_own_function_raised(self):
        turn = Problem(problems.VectorField(lambda y: [y[1], -y[0]], dim=2), y0=[0.0, 1.0], t_end=10.0)

        def bounded(way, t, y):
            if way * y[0] > 1.5:
                raise LookupError(f"beyond {way}")
            return float(y[0]) + 5.0

        events = [Event(lambda t, y, way=way: bounded(way, t, y), name=f"{way}") for way in (1, -1)]
        many = integrate_many(
            turn, HBVM(k=6, s=4, h=0.5), starts=[[0.0, 2.0], [0.0, -2.0]], times=[10.0], events=events
        )
        assert ["beyond 1" in many.reason[0], "beyond -1" in many.reason[1]] == [True, True]

    @pytest.mark.parametrize("threads", [1, 2])
    def test_ctrl_c_leaves_an_entry_for_each(self, henon_heiles, threads):
        calls = iter(range(10**9))

        def g(t, y):
            if next(calls) == 3000:
                raise KeyboardInterrupt
            return float(y[0])

        many = integrate_many(
            henon_heiles, HBVM(k=6, s=4, h=0.25), starts=self.given(henon_heiles, n=40), times=[20.0],
            threads=threads, events=Event(g),
        )  # fmt: skip
        assert Status.INTERRUPTED in many.status
        assert [bool(found) for found in many.events] == many.arrived.tolist()

    def test_parameters_are_each_trajectorys(self):
        spring = problems.Hamiltonian(
            lambda q, p, par: p[0] ** 2 / 2 + par.k * q[0] ** 2 / 2, dof=1, parameters={"k": 1.0}
        )
        problem = Problem(spring, q0=[1.0], p0=[0.0], t_end=4.0)
        level = [lambda q, par: q[0] + par.k - 1.0, lambda t, y, par: float(y[0]) + par.k - 1.0]
        k = np.array([0.25, 1.0, 1.5])
        many = integrate_many(problem, Gauss(s=8, h=0.5), parameters={"k": k}, events=level)
        for i, exact in enumerate(np.arccos(1.0 - k) / np.sqrt(k)):
            for found in many.events[i].values():
                assert found.t[0] == pytest.approx(exact, abs=1e-14)


class TestHeyoka:
    @pytest.mark.parametrize("end", [50.0, -50.0])
    @pytest.mark.parametrize("sample", [None, "steps"])
    def test_the_same_events_as_ours(self, henon_heiles, end, sample):
        events = [Event(lambda q: q[0], name="both"), Event(lambda q: q[1], name="up", direction=1)]
        times = np.linspace(0.0, end, 30)
        theirs = integrate(henon_heiles, integrators.Taylor(), times, sample, events=events)
        ours = integrate(henon_heiles, HBVM(k=20, s=12, h=0.1), [end], events=events)
        for name, found in ours.events.items():
            assert len(found) >= 5
            assert np.abs(theirs.events[name].t - found.t).max() < 2e-13  # measured 2.1e-14
            assert np.abs(theirs.events[name].y - found.y).max() < 2e-13  # measured 2e-14
            assert np.array_equal(theirs.events[name].direction, found.direction)
        alone = integrate(henon_heiles, integrators.Taylor(), times, sample)
        assert alone.y.tobytes() == theirs.y.tobytes()

    def test_a_terminal_one_ends_it(self, henon_heiles):
        far = Problem(henon_heiles.system, y0=henon_heiles.y0, t_end=1e7)
        made = section(far, integrators.Taylor(), lambda q: q[0], count=20)
        assert made.status is Status.EVENT
        assert made.y.shape == (20, 4)
        assert made.t_stop == made.t[-1]
        assert made.stats.steps < 2000

    def test_what_cannot_be_traced_is_refused(self, henon_heiles):
        with pytest.raises(InputError, match="needs the value of a symbol"):
            integrate(henon_heiles, integrators.Taylor(), events=lambda t, y: float(y[0]))

    @pytest.mark.parametrize("method", [integrators.IAS15(), integrators.DOP853(rtol=1e-9, atol=1e-9)])
    def test_the_others_refuse(self, method):
        with pytest.raises(InputError, match=r"cannot find events: .* LineIntegral or Taylor"):
            integrate(problems.load("figure_eight"), method, events=lambda q: q[0])


SLOW = """
import signal
import problems
from integrators import HBVM, Event, integrate

signal.signal(signal.SIGINT, signal.default_int_handler)
{g}
henon_heiles, method = problems.load("henon_heiles"), HBVM(k=8, s=4, h=0.1)
integrate(henon_heiles, method, [1.0], events={events})  # compiles
print("begun", flush=True)
made = integrate(henon_heiles, method, [1e9], events={events})
print(made.status, made.reason, len(made.events["g"]))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize(
    "g",
    [
        "g = lambda q: q[0]",
        "def g(t, y):\n    return float(y[0])",
        "g = lambda t, m: m.sin(1000 * t)",  # thirty in each step
    ],
    ids=["compiled", "called", "crowded"],
)
def test_ctrl_c_is_heard(g):
    code = SLOW.format(g=g, events="Event(g, name='g')")
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        child.stdout.readline()
        with pytest.raises(subprocess.TimeoutExpired):
            child.wait(0.5)
        child.send_signal(signal.SIGINT)
        try:
            out, _ = child.communicate(timeout=60)  # measured a tenth of a second on a quiet machine
        finally:
            child.kill()
    words = out.split()
    assert words[0] == "interrupted"
    assert int(words[-1]) > 10


def test_fields_that_are_not_formulas():
    turn = Problem(Opaque(lambda t, y: [y[1], -y[0]], dim=2), y0=[0.0, 1.0], t_end=10.0)
    made = integrate(turn, Gauss(s=8, h=0.5), [10.0], events=Event(lambda y: y[0], name="y"))
    assert np.allclose(made.events["y"].t, np.pi * np.arange(1, 4), rtol=0, atol=1e-12)
