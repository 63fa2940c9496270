"""Fields that are not traced: numba functions and any Python functions."""

import gc
import math
import re
import weakref
from collections import deque
from functools import partial

import numba
import numpy as np
import pytest

import integrators
import integrators.kernel.inside.search
from integrators import HBVM, Event, Gauss, LineIntegral, integrate
from integrators.kernel.native import foreign
from integrators.protocol import Status
from problems import InputError, Opaque, Problem, VectorField, targets

MU = 5.0
RAISED = "a function of yours raised ValueError (math domain error)"
NOISE = 3 * 34  # evaluations by adaptive steps that look three times for the noise of a field that is called
METHODS = [
    HBVM(k=6, s=4, h=0.05),
    HBVM(k=6, s=4, tol=1e-9, solver="fixed_point"),
    Gauss(s=4, h=0.05, solver="newton"),
    Gauss(s=3, h=0.05, solver="blended"),
]


def van_der_pol(t, y):
    return [y[1], 5.0 * (1 - y[0] * y[0]) * y[1] - y[0]]


def in_place(t, y, dy):
    dy[0] = y[1]
    dy[1] = 5.0 * (1 - y[0] * y[0]) * y[1] - y[0]


def parametric(t, y, par, dy):
    dy[0] = y[1]
    dy[1] = par[0] * (1 - y[0] * y[0]) * y[1] - y[0]


TRACED = VectorField(lambda y: van_der_pol(0, y), dim=2, name="van_der_pol")
WRITTEN = {
    "python": Opaque(van_der_pol, dim=2),
    "python in place": Opaque(in_place, dim=2),
    "python with parameters": Opaque(parametric, dim=2, parameters={"mu": MU}),
    "numba": Opaque(numba.njit(in_place), dim=2),
    "numba with parameters": Opaque(numba.njit(parametric), dim=2, parameters={"mu": MU}),
}


def started(system, **options):
    return Problem(system, **({"y0": [2.0, 0.0], "t_end": 4.0} | options))


@pytest.mark.parametrize("written", WRITTEN)
@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_every_way_of_writing_gives_the_traced_solution(written, method):
    times = np.linspace(0.0, 4.0, 14)
    traced = integrate(started(TRACED), method, times)
    foreign = integrate(started(WRITTEN[written]), method, times)
    assert foreign.status is Status.FINISHED
    # Bit for bit with the fixed-point iteration; Jacobians by differences change the last bit.
    assert np.abs(foreign.y - traced.y).max() <= (
        0.0 if isinstance(method, HBVM) else 2e-14
    )  # measured 4.4e-16
    assert foreign.stats.extra["field"] == (
        "numba function" if "numba" in written else "Python function, slow"
    )
    if isinstance(method, HBVM):
        noise = 0 if method.h else NOISE
        assert foreign.stats.evaluations == traced.stats.evaluations + noise


def test_jacobians_are_taken_by_differences():
    made = integrate(started(WRITTEN["python"]), METHODS[2], [4.0])
    assert made.stats.solver == "Newton"
    assert made.stats.extra["implicit"]["jacobian"] == "differences"


@pytest.mark.parametrize("peer", ["DOP853", "Radau"])
def test_scipys_methods_take_them_too(peer):
    method = integrators.registry.create(peer, rtol=1e-9, atol=1e-9)
    traced = integrate(started(TRACED), method, [4.0])
    for system in WRITTEN.values():
        assert np.abs(integrate(started(system), method, [4.0]).y - traced.y).max() < 1e-12  # measured 0


def test_an_ordinary_function_may_do_anything():
    calls = []

    def pendulum(t, y):
        calls.append(t)
        table = {"length": 1.0}
        if abs(y[0]) > 100:
            return np.zeros(2)
        return np.array([y[1], -math.sin(y[0]) / table["length"]])

    system = Opaque(
        pendulum, dim=2, invariants={"energy": lambda y, m: y[1] ** 2 / 2 - m.cos(y[0])}, name="pendulum"
    )
    made = integrate(
        Problem(system, y0=[1.0, 0.0], t_end=20.0), HBVM(k=12, s=4, h=0.25), np.linspace(0, 20, 81)
    )
    assert made.errors()["energy"].max() < 1e-14  # measured 1.8e-16
    assert len(calls) >= 80 * 12


def test_parameters_are_run_time_values_and_arrays_may_be_given_back():
    @numba.njit
    def decay(t, y, par):
        return -par[1] * y + par[0]

    system = Opaque(decay, dim=1, parameters={"source": 0.0, "rate": 1.0})
    method = Gauss(s=8, h=0.5)
    for rate in (0.5, 2.0):
        made = integrate(Problem(system, y0=[1.0], parameters={"rate": rate}, t_end=2.0), method, [2.0])
        assert made.y[0, 0] == pytest.approx(math.exp(-2 * rate), rel=1e-12)  # measured 4.4e-16


def test_the_time_is_the_stages_own():
    system = Opaque(lambda t, y: [math.cos(t)], dim=1, name="cosine")
    made = integrate(Problem(system, y0=[math.sin(2.0)], t0=2.0, t_end=-3.0), Gauss(s=8, h=0.5), [-3.0])
    assert abs(made.y[0, 0] - math.sin(-3.0)) < 1e-14  # measured 2.8e-17


@pytest.mark.parametrize(
    ("field", "what"),
    [
        (lambda t, y: [math.sqrt(1 - t)], f". There {RAISED}."),
        (lambda t, y: [1 / (y[0] < 0.5)], ": dy[0]/dt is inf at t = 0.5."),
    ],
    ids=["a root", "a division of NumPy's"],
)
def test_where_a_function_is_not_defined_is_a_status_with_the_time(field, what):
    problem = Problem(Opaque(field, dim=1, name="ends"), y0=[0.0], t_end=9.0)
    made = integrate(problem, HBVM(k=4, s=2, h=0.01), sample="steps")
    assert made.status is Status.NOT_FINITE
    assert made.reason == f"the vector field is not finite in the step from t = {made.t_stop!r}{what}"
    assert 0.4 < made.t_stop < 2.1
    assert np.isfinite(made.y).all()
    assert made.t[-1] == made.t_stop


def test_any_other_error_is_the_users_to_see():
    times = []

    def broken(t, y):
        times.append(t)
        if t > last:
            raise LookupError("no such table")
        return [1.0]

    problem = Problem(Opaque(broken, dim=1), y0=[0.0], t_end=9.0)
    for method in (
        HBVM(k=4, s=2, h=0.1),
        HBVM(k=4, s=2, tol=1e-6),
        Gauss(s=2, h=0.1, solver="newton"),
        integrators.DOP853(rtol=1e-8, atol=1e-8),
        integrators.Radau(rtol=1e-6, atol=1e-8),
    ):
        last = -1.0
        with pytest.raises(LookupError, match="no such table"):  # nothing is reached that could be kept
            integrate(problem, method)
        last = 8.0
        for sample in ("partial", "steps", "stop"):
            times.clear()
            made = integrate(problem, method, np.linspace(0.0, 9.0, 91), sample=sample)
            assert made.status is Status.USER_ERROR
            assert made.status.failed
            assert isinstance(made.error, LookupError)
            assert made.reason.startswith(
                "a function of yours raised LookupError (no such table) in the step"
            )
            peer = not hasattr(method, "k")
            assert peer or 4.0 < made.t_stop < 9.0  # nodes lie before the end of a step
            assert made.t[-1] <= made.t_stop
            assert peer or made.t[-1] > made.t_stop - 0.11
            assert times.count(0.0) <= 4, "integrated twice"
            assert np.abs(made.y[:, 0] - made.t).max() < 1e-13  # measured 2e-15


@pytest.mark.parametrize("method", [HBVM(k=4, s=2, h=0.1), HBVM(k=4, s=2, tol=1e-6)], ids=str)
def test_an_error_ends_its_own_member_of_a_batch_only(method):
    def broken(t, y):
        if np.hypot(*y) > (4.0 if t > 1.0 else 10.0):
            raise LookupError("no such table")
        return [y[1], -y[0]]

    starts = [[1.0, 0.0], [5.0, 0.0], [2.0, 0.0], [20.0, 0.0]]
    made = method.compile(Opaque(broken, dim=2)).batch(starts, times=[0.5, 2.0])
    assert made.status == [Status.FINISHED, Status.USER_ERROR, Status.FINISHED, Status.USER_ERROR]
    assert "LookupError (no such table) in the step from t = " in made.reason[1]
    exact = np.cos([0.5, 2.0])
    assert np.abs(made.y[[0, 2], :, 0] - [exact, 2.0 * exact]).max() < 1e-5  # measured 5.5e-7
    assert made.y[1, 0, 0] == pytest.approx(5.0 * exact[0], abs=1e-5)
    assert np.isnan(made.y[1, 1]).all()
    assert np.isnan(made.y[3]).all()
    assert made.t_stop[3] == 0.0


def test_what_is_no_function_of_the_user_is_not_said_to_be_one(monkeypatch):
    """An error of our own is to be seen as what it is."""

    def wrong(*arguments):
        raise ZeroDivisionError("ours")

    monkeypatch.setattr(integrators.kernel.inside.search, "EventLog", wrong)
    problem = Problem(VectorField(lambda y: [y[1], -y[0]], dim=2), y0=[0.0, 1.0], t_end=9.0)
    with pytest.raises(ZeroDivisionError, match="ours"):
        integrate(problem, HBVM(k=4, s=2, h=0.1), events=lambda y: y[0])


@pytest.mark.parametrize("method", [HBVM(k=4, s=2, h=0.1), HBVM()], ids=str)
def test_an_error_of_an_events_function_keeps_the_trajectory_and_the_events_before(method):
    def g(t, y):
        if t > 50.0:
            raise LookupError("no such table")
        return float(y[0])

    turn = Problem(Opaque(lambda t, y: [y[1], -y[0]], dim=2), y0=[0.0, 1.0], t_end=60.0)
    made = integrate(turn, method, events=Event(g, name="g"))
    assert made.status is Status.USER_ERROR
    assert isinstance(made.error, LookupError)
    assert re.search(r"LookupError \(no such table\): events are known up to t = \d+", made.reason)
    assert made.t[-1] == 60.0
    assert len(made.events["g"]) >= 1


def test_a_result_of_a_wrong_length_is_refused():
    problem = Problem(Opaque(lambda t, y: [1.0, 2.0, 3.0], dim=2, name="three"), y0=[0.0, 0.0], t_end=1.0)
    with pytest.raises(InputError, match=r"three returns an array of shape \(3,\), not \(2,\)"):
        integrate(problem, HBVM(k=4, s=2, h=0.1))
    problem = Problem(Opaque(lambda t, y: "text", dim=2, name="text"), y0=[0.0, 0.0], t_end=1.0)
    with pytest.raises(InputError, match="what text returns must be numbers, not 'text'"):
        integrate(problem, HBVM(k=4, s=2, h=0.1))


def test_other_arguments_are_refused():
    with pytest.raises(InputError, match="a field has the arguments"):
        Opaque(lambda t: [t], dim=1)
    with pytest.raises(InputError, match="must be a function, not 3"):
        Opaque(3, dim=1)


@pytest.mark.parametrize(
    "method",
    [
        LineIntegral(k=4, s=2, h=0.1, invariants=["energy"]),
        integrators.Taylor(tol=1e-9),
        integrators.Dopri8(h=0.1),
        integrators.Leapfrog(h=0.1),
    ],
    ids=repr,
)
def test_methods_that_need_formulas_refuse_with_the_reason(method):
    with pytest.raises(InputError, match=r"cannot integrate .*needs (the field as a formula|a separable)"):
        integrate(started(WRITTEN["python"]), method)
    with pytest.raises(InputError, match="van_der_pol is not traced: its field is a Python function"):
        targets.source(WRITTEN["python"], "field", "numba")


@pytest.mark.parametrize("kind", ["python", "numba"])
def test_what_the_kernel_makes_of_a_field_goes_with_its_system(kind):
    written = WRITTEN[kind]
    system = Opaque(written.f, dim=written.dim)
    integrate(Problem(system, y0=[2.0, 0.0], t_end=0.5), METHODS[0], times=[0.5])
    assert system in foreign._functions
    gone = weakref.ref(system)
    del system
    gc.collect()
    assert gone() is None


def test_events_and_checkpoints_work_as_ever():
    problem = started(WRITTEN["numba"], t_end=20.0)
    made = integrate(problem, METHODS[0], events=lambda y: y[0])
    assert len(made.events["event"]) == 3
    stepper = METHODS[0].compile(problem.system).start(problem.y0)
    stepper.advance([3.0])
    kept = stepper.checkpoint()
    first = stepper.advance([5.0, 7.0]).y
    stepper.restore(kept)
    assert np.array_equal(stepper.advance([5.0, 7.0]).y, first)


def test_a_fingerprint_follows_from_the_code_and_what_it_takes_from_around_it():
    def made(a):
        return targets.fingerprint(Opaque(lambda t, y: [a * y[0]], dim=1, name="same"))

    assert made(1.0) == made(1.0)
    assert made(1.0) != made(2.0)
    assert targets.fingerprint(Opaque(numba.njit(in_place), dim=2)) == targets.fingerprint(
        Opaque(in_place, dim=2)
    )
    assert targets.fingerprint(Opaque(in_place, dim=2)) != targets.fingerprint(Opaque(parametric, dim=2))


DECAY = {"rate": np.array([1.0])}


def rate():
    return DECAY["rate"][0]


def test_a_fingerprint_follows_from_globals_defaults_and_the_functions_it_calls(monkeypatch):
    def of(f):
        return targets.fingerprint(Opaque(f, dim=1, name="same"))

    def calling(t, y):
        return [-rate() * y[0]]

    before = of(calling)
    assert of(calling) == before
    monkeypatch.setitem(DECAY, "rate", np.array([1.0 + 1e-12]))
    assert of(calling) != before
    assert of(lambda t, y, a=1.0: [a * y[0]]) != of(lambda t, y, a=2.0: [a * y[0]])
    assert of(lambda t, y, *, a=1.0: [a * y[0]]) != of(lambda t, y, *, a=2.0: [a * y[0]])


A, B = 1.0, 1.0
RATES = {"first": 1.0, "second": 1.0}


class Rate:
    def __init__(self, k):
        self.k = k

    def field(self, t, y):
        return [self.k * y[0]]

    def __call__(self, t, y):
        return [self.k * y[0]]


class OtherRate(Rate):
    def __call__(self, t, y):
        return [-self.k * y[0]]


OtherRate.__qualname__ = Rate.__qualname__


class Slotted:
    __slots__ = ("k",)

    def __init__(self, k):
        self.k = k

    def __call__(self, t, y):
        return [self.k * y[0]]


def with_rate(t, y, a):
    return [a * y[0]]


@pytest.mark.parametrize(
    ("one", "other"),
    [
        pytest.param(Rate(1.0).field, Rate(2.0).field, id="a method's object"),
        pytest.param(Rate(1.0), Rate(2.0), id="an object that is called"),
        pytest.param(Rate(1.0), OtherRate(1.0), id="what runs when it is called"),
        pytest.param(Slotted(1.0), Slotted(2.0), id="an object with slots"),
        pytest.param(partial(with_rate, a=1.0), partial(with_rate, a=2.0), id="partial"),
        pytest.param(lambda t, y: [int(t) in {1, 2}], lambda t, y: [int(t) in {1, 3}], id="set"),
        pytest.param(lambda t, y, a=deque([1]): y, lambda t, y, a=deque([2]): y, id="deque"),
    ],
)
def test_a_fingerprint_follows_from_the_object_behind_a_field(one, other):
    before, after = (targets.fingerprint(Opaque(f, dim=1, name="same")) for f in (one, other))
    assert before == targets.fingerprint(Opaque(one, dim=1, name="same"))
    assert before != after


def test_a_fingerprint_follows_from_every_global_and_every_item(monkeypatch):
    def of(f):
        return targets.fingerprint(Opaque(f, dim=1, name="same"))

    def two(t, y):
        return [-A * B * y[0]]

    def items(t, y):
        return [-RATES["first"] * RATES["second"] * y[0]]

    before = of(two), of(items)
    for name in ("A", "B"):
        with monkeypatch.context() as changed:
            changed.setitem(globals(), name, 2.0)
            assert of(two) != before[0], name
    for name in RATES:
        with monkeypatch.context() as changed:
            changed.setitem(RATES, name, 2.0)
            assert of(items) != before[1], name
    assert (of(two), of(items)) == before


def test_a_fingerprint_tells_which_of_two_lists_comes_again():
    one, two = [1.0], [2.0]

    def of(*lists):
        return targets.fingerprint(Opaque(partial(with_rate, a=lists), dim=1, name="same"))

    assert of(one, two, one) != of(one, two, two)


def test_the_field_on_arrays_is_the_function_state_by_state():
    states = np.arange(6.0).reshape(2, 3)
    field = targets.numpy(WRITTEN["python with parameters"], "field")
    expected = targets.numpy(TRACED, "field")(0.0, states, np.empty(0))
    assert np.array_equal(field(0.0, states, np.array([MU])), expected)
    assert np.array_equal(field(0.0, states[:, 0], np.array([MU])), expected[:, 0])
