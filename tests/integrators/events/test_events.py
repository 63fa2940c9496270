"""Events are all found, on the trajectory itself, and change nothing of it."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import integrators
from integrators import HBVM, Event, Gauss, LineIntegral, integrate, integrate_many
from integrators.protocol import Status
from problems import Hamiltonian, InputError, Opaque, Problem, VectorField

OSCILLATOR = Hamiltonian(
    lambda q, p: (q[0] * q[0] + p[0] * p[0]) / 2, dof=1, parameters={"level": 0.5}, name="oscillator"
)
WHOLE = Gauss(s=8, h=2.0)  # a third of a revolution per step


def oscillator(*, t_end=20.0, phase=0.0, **options):
    return Problem(OSCILLATOR, q0=[math.sin(phase)], p0=[math.cos(phase)], t_end=t_end, **options)


def happened(problem, method, *events, **options):
    solution = integrate(problem, method, events=list(events), **options)
    return solution, list(solution.events.values())


@pytest.mark.parametrize(
    ("method", "error"),
    [
        (HBVM(k=6, s=4, h=0.5), 5e-9),  # measured 2.8e-9
        (WHOLE, 1e-12),  # measured 2.5e-13
        (Gauss(s=16, h=7.0), 1e-12),  # measured 5.3e-15: more than a revolution per step
        (LineIntegral(k=6, s=4, h=0.5, invariants=["energy"]), 5e-9),  # measured 2.8e-9
        (HBVM(k=10, s=5, tol=1e-12), 5e-11),  # measured 2.2e-12
        (LineIntegral(k=6, s=4, tol=1e-12, invariants=["energy"]), 1e-10),  # measured 1.7e-11
    ],
)
def test_times_are_those_of_the_method_and_energy_is_at_round_off(method, error):
    solution, (zeros,) = happened(oscillator(), method, Event(lambda q: q[0], name="q"))
    assert solution.status is Status.FINISHED
    assert list(zeros.direction) == [-1, 1, -1, 1, -1, 1]
    assert np.abs(zeros.t - np.pi * np.arange(1, 7)).max() < error
    assert np.abs(zeros.y[:, 0]).max() < 1e-14  # measured 1.8e-15: rounding of the time
    # Measured 7.1e-15 with s = 16, the same as at its own steps; 4.4e-16 for the others.
    assert solution.problem.errors(zeros.y)["energy"].max() < (2e-14 if method.s > 8 else 2e-15)


def test_states_at_events_keep_the_energy_and_the_polynomial_there_does_not(henon_heiles):
    method = HBVM(k=6, s=4, h=1.0)
    solution, (zeros,) = happened(henon_heiles, method, Event(lambda q: q[1]))
    polynomial = integrate(henon_heiles, method, zeros.t, sample="dense")
    assert len(zeros) == 13
    assert henon_heiles.errors(zeros.y)["energy"].max() < 5e-15  # measured 6.3e-16
    assert polynomial.errors()["energy"].max() > 1e-5  # measured 2.4e-4
    assert np.abs(zeros.y[:, 1]).max() < 1e-14  # measured 7.4e-16
    assert np.abs(polynomial.y[:, 1]).max() > 1e-6  # measured 2.2e-5
    # Measured 40, and no own step more than without events.
    assert 2 * len(zeros) <= solution.stats.extra["event_search"]["partial_steps"] <= 5 * len(zeros)
    assert solution.stats.steps == 50


def test_directions_are_in_the_order_of_integration():
    events = [Event(lambda q: q[0], direction=d, name=f"d{d}") for d in (1, -1, 0)]
    for t_end in (20.0, -20.0):
        _, (up, down, both) = happened(oscillator(t_end=t_end), WHOLE, *events)
        sign = np.sign(t_end)
        even, odd = np.pi * np.array([2, 4, 6]), np.pi * np.array([1, 3, 5])
        # Backwards q is negative first: in the order in which it is passed it rises at -pi.
        assert np.allclose(up.t, even if sign > 0 else -odd, rtol=0, atol=1e-11)
        assert np.allclose(down.t, odd if sign > 0 else -even, rtol=0, atol=1e-11)
        assert list(both.direction) == [-1 if sign > 0 else 1, 1 if sign > 0 else -1] * 3


def test_two_events_in_one_step_are_two():
    solution, (zeros,) = happened(oscillator(t_end=4.0), WHOLE, Event(lambda q, par: q[0] - 0.99))
    angle = math.asin(0.99)
    assert np.allclose(zeros.t, [angle, np.pi - angle], rtol=0, atol=1e-11)  # both in the step from 0 to 2
    assert list(zeros.direction) == [1, -1]
    assert solution.problem.errors(zeros.y)["energy"].max() < 1e-15  # measured 4.4e-16


@pytest.mark.parametrize(("gap", "expected"), [(1e-6, 2), (1e-10, 2), (-1e-6, 0), (-1e-10, 0)])
def test_near_grazing_is_two_events_or_none(gap, expected):
    _, (zeros,) = happened(oscillator(t_end=3.0), HBVM(k=10, s=8, h=1.0), Event(lambda q: q[0] - (1 - gap)))
    assert len(zeros) == expected
    if expected:
        # q = 1 - d^2/2: half the distance is sqrt(2 gap), and rounding of q moves it by eps / distance.
        assert abs(np.diff(zeros.t)[0] / 2 - math.sqrt(2 * gap)) < 1e-9  # measured 1.2e-10, of gap^1.5


def test_a_touch_is_one_event_without_direction():
    problem = oscillator(t_end=20.0)
    method = HBVM(k=10, s=8, h=0.7)
    events = [Event(lambda p: 1 - p[0] * p[0], name="touch")]
    events += [Event(lambda p: 1 - p[0] * p[0], direction=d, name=f"crossing{d}") for d in (1, -1)]
    _, (touch, up, down) = happened(problem, method, *events)
    assert len(touch) == 6
    assert not touch.direction.any()
    assert np.abs(touch.t - np.pi * np.arange(1, 7)).max() < 2e-7  # measured 1.3e-8: g is flat there
    assert len(up) == len(down) == 0


METHODS = [HBVM(k=6, s=4, h=0.5), HBVM(k=6, s=4, h=0.1), HBVM()]


@pytest.mark.parametrize("method", METHODS, ids=str)
@pytest.mark.parametrize(
    "g",
    [
        lambda q: q[0] ** 2,
        lambda q: q[0] ** 2 * (2 + q[0]),
        lambda q: -(q[0] ** 4),
        lambda t, m: (1 - m.cos(2 * (t - 0.25))) / 2,  # at the ends of some steps to within rounding
    ],
    ids=["square", "uneven", "fourth power", "time"],
)
def test_a_double_zero_is_a_touch_wherever_it_lies_in_a_step(method, g):
    _, (zeros,) = happened(oscillator(phase=-0.25), method, Event(g))
    assert np.allclose(zeros.t, 0.25 + np.pi * np.arange(7), rtol=0, atol=1e-6)  # measured 3e-8
    assert not zeros.direction.any()


@pytest.mark.parametrize("h", [0.25, 0.5, 0.1])
def test_a_touch_at_the_end_of_a_step_is_one(h):
    method = HBVM(k=6, s=4, h=h)
    for at in (7.25, 7.3, 7.5, np.nextafter(7.5, 0.0), np.nextafter(7.5, 8.0), 7.5 + 1e-8, 7.5 - 1e-8):
        _, (zeros,) = happened(oscillator(), method, Event(lambda t, at=at: (t - at) ** 2))
        assert np.allclose(zeros.t, [at], rtol=0, atol=1e-7), at


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_a_pole_is_no_event(method):
    _, (pole, even, tangent) = happened(
        oscillator(phase=-0.25, t_end=5.0),
        method,
        Event(lambda q: 1 / q[0], name="pole"),
        Event(lambda q: 1 / q[0] ** 2, name="even"),
        Event(lambda q, p: q[0] / p[0], name="tangent"),
    )
    assert len(pole) == len(even) == 0
    assert np.allclose(tangent.t, 0.25 + np.pi * np.arange(2), rtol=0, atol=1e-8)  # q = 0; p = 0 between
    assert (tangent.direction == 1).all()


@pytest.mark.parametrize("t0", [1e3, 1e4, 1e8])
@pytest.mark.parametrize("method", [HBVM(k=6, s=4, h=0.1), HBVM(k=6, s=4, h=0.02), HBVM()], ids=str)
def test_a_pole_is_no_event_at_late_times_either(method, t0):
    """Where a unit in the last place of time is much longer than at the start."""
    phase = math.sin(0.3), math.cos(0.3)
    problem = Problem(
        VectorField(lambda y: [y[1], -y[0]], dim=2, name="late"), y0=[*phase], t0=t0, t_end=t0 + 7.0
    )
    _, (pole, cotangent) = happened(problem, method, Event(lambda y: 1 / y[0]), Event(lambda y: y[1] / y[0]))
    assert len(pole) == 0
    assert cotangent.direction.tolist() == [-1, -1]
    assert np.allclose(cotangent.t, t0 - 0.3 + np.pi * np.array([0.5, 1.5]), rtol=0, atol=1e-7)


@pytest.mark.parametrize("power", [1, 2, 3])
@pytest.mark.parametrize("t_end", [2.0, 4.0], ids=["at the end", "before it"])
@pytest.mark.parametrize("h", [0.5, 0.1])
def test_the_direction_of_a_zero_at_the_end_of_a_step_is_that_of_what_follows(h, t_end, power):
    """A flat zero is a crossing too; only what turns back is a touch."""
    traced = Event(lambda t: (t - 2.0) ** power * (1.0 + t), name="traced")
    called = Event(lambda t: 0.0 if t == 2.0 else math.copysign(abs(t - 2.0) ** power, (t - 2.0) ** power))
    _, found = happened(oscillator(t_end=t_end), HBVM(k=6, s=4, h=h), traced, called)
    for zeros in found:
        assert zeros.t.tolist() == [2.0]
        assert zeros.direction.tolist() == [0 if power == 2 else 1]


def test_a_function_that_ends_with_the_integration_is_not_asked_beyond_it_in_vain():
    def table(t):
        if t > 2.0:
            raise LookupError("no such time")
        return float(t - 2.0)

    made, (zeros,) = happened(oscillator(t_end=2.0), HBVM(k=6, s=4, h=0.5), Event(table))
    assert made.status is Status.FINISHED
    assert made.error is None
    assert (zeros.t.tolist(), zeros.direction.tolist()) == ([2.0], [1])


def test_what_a_function_raises_inside_a_step_that_ends_at_a_zero_is_not_lost():
    def hole(t):
        if 1.69 < t < 1.71:
            raise LookupError("a hole")
        return (t - 1.7) * (t - 2.0)

    made, _ = happened(oscillator(t_end=3.0), HBVM(k=6, s=4, h=0.5), Event(hole))
    assert made.status is Status.USER_ERROR
    assert "a hole" in made.reason


@pytest.mark.parametrize("sample", ["dense", "steps"])
def test_a_last_part_of_a_step_that_cannot_be_solved_is_no_silence(sample):
    def field(t, y):  # not a number where only the last, shorter step asks for it
        return [y[1], math.nan if 9.73 < t < 9.74 else -y[0]]

    problem = Problem(Opaque(field, dim=2), y0=[0.0, 1.0], t_end=9.8)
    made = integrate(problem, Gauss(s=2, h=0.5), [9.8], sample, events=Event(lambda y: y[0], name="y"))
    assert made.status is Status.NOT_FINITE
    assert made.reason.startswith("the vector field is not finite in the step from t = 9.5: dy[1]/dt is nan")
    assert made.t_stop == 9.5  # events are known up to there
    assert len(made.events["y"]) == 3


@pytest.mark.parametrize("method", [HBVM(k=6, s=4, h=0.1), HBVM()], ids=str)
def test_what_is_zero_but_for_rounding_all_along_is_no_event(method):
    """An invariant's error: only rounding decides its sign."""
    made, (energy,) = happened(
        oscillator(phase=0.3, t_end=20.0),
        method,
        Event(lambda q, p: q[0] ** 2 + p[0] ** 2 - 1, name="energy"),
    )
    assert made.status is Status.FINISHED
    assert len(energy) == 0


@pytest.mark.parametrize("method", [HBVM(k=6, s=4, h=0.5), HBVM()], ids=str)
def test_a_corner_above_zero_is_no_touch(method):
    _, (above, touch) = happened(
        oscillator(phase=0.3, t_end=5.0),
        method,
        Event(lambda q, m: m.abs(q[0]) + 1e-8, name="above"),
        Event(lambda q, m: m.abs(q[0]), name="touch"),
    )
    assert len(above) == 0
    assert np.allclose(touch.t, [np.pi - 0.3], rtol=0, atol=1e-8)


@pytest.mark.parametrize("phase", [0.0, 0.65, 1.02])
@pytest.mark.parametrize(
    "method", [*METHODS, WHOLE, Gauss(s=4, h=0.3), Gauss(s=12, h=3.3), HBVM(k=10, s=5, tol=1e-12)], ids=str
)
def test_a_touch_at_a_corner_is_found_wherever_it_lies_in_a_step(method, phase):
    _, (corners, skew, crossings, above) = happened(
        oscillator(phase=phase, t_end=40.0),
        method,
        Event(lambda q, m: m.abs(q[0]), name="corner"),
        Event(lambda q, p, m: -m.abs(q[0]) * (2 + p[0]), name="skew"),
        Event(lambda q: q[0], name="crossing"),
        Event(lambda q, m: m.abs(q[0]) + 3e-9, name="above"),
    )
    assert len(crossings) >= 12
    for touches in (corners, skew):
        assert len(touches) == len(crossings)
        assert np.abs(touches.t - crossings.t).max() < 1e-9  # measured 1.1e-10
        assert not touches.direction.any()
    assert len(above) == 0


@pytest.mark.parametrize("h", [0.25, 1.0, 2.0])
def test_a_crossing_so_slow_that_rounding_decides_its_sign_for_steps_is_one_event(h):
    """The level is 67 units in the last place away, and 7 are passed in a unit of time."""
    slow = Problem(VectorField(lambda y: [1e-7], dim=1, name="slow"), y0=[1e8], t_end=40.0)
    level = 1e8 + 1e-6
    _, found = happened(
        slow,
        Gauss(s=2, h=h),
        Event(lambda y: y[0] - level, name="up"),
        Event(lambda y: level - y[0], name="down"),
        Event(lambda y: y[0] - 1e8, name="start"),
    )
    assert [zeros.direction.tolist() for zeros in found] == [[1], [-1], []]
    # Measured 13.48: where g is 24 units, which rounding of the state may account for.
    assert 9.5 < found[0].t[0] == found[1].t[0] < 14.0


def test_a_jump_across_zero_is_where_the_sign_changes():
    jump = Event(lambda q: 1.0 if float(q[0]) > 0.5 else -1.0)
    _, (zeros,) = happened(oscillator(t_end=3.0), HBVM(k=10, s=8, h=0.5), jump)
    assert np.allclose(zeros.t, [np.pi / 6, 5 * np.pi / 6], rtol=0, atol=1e-12)


def test_a_terminal_event_ends_the_integration_there():
    times = np.linspace(0.0, 20.0, 41)
    solution, (zeros,) = happened(oscillator(), WHOLE, Event(lambda q: q[0], terminal=True), times=times)
    assert solution.status is Status.EVENT
    assert not solution.status.failed
    assert solution.reason == f"the event 'event' ended the integration at t = {solution.t_stop!r}."
    assert solution.t_stop == zeros.t[-1] == pytest.approx(np.pi, abs=1e-11)
    assert np.array_equal(solution.t, times[:7])
    assert len(zeros) == 1


def test_the_nth_occurrence_may_be_terminal_and_others_stop_with_it():
    events = [Event(lambda q: q[0], terminal=3, direction=-1, name="q"), Event(lambda p: p[0], name="p")]
    solution, (q, p) = happened(oscillator(), WHOLE, *events)
    assert solution.t_stop == pytest.approx(5 * np.pi, abs=1e-11)
    assert (len(q), len(p)) == (3, 5)


@pytest.mark.parametrize("then", [None, lambda q, p: [q[0], -p[0]]], ids=["ends", "ends with an action"])
@pytest.mark.parametrize("h", [0.5, 0.3, None])
def test_a_sample_at_a_terminal_event_is_its_state_also_where_the_steps_end_there(h, then):
    method = Gauss(s=8, tol=1e-12) if h is None else Gauss(s=8, h=h)
    event = Event(lambda t: t - 2.5, terminal=True, name="stop", then=then)
    problem, times = oscillator(), [0.0, 1.25, 2.5, 3.0]
    solution = integrate(problem, method, times, events=event)
    assert solution.status is Status.EVENT
    assert solution.t.tolist() == times[:3]
    assert np.array_equal(solution.y[-1], solution.events["stop"].y[-1])
    many = integrate_many(problem, method, starts=[problem.y0] * 2, times=times, events=event)
    # measured 2e-16: lanes add in another order
    np.testing.assert_allclose(many.y[:, :3], [solution.y] * 2, atol=2e-15)
    assert np.isnan(many.y[:, 3]).all()


def test_events_change_nothing_of_the_samples():
    problem, times = oscillator(), np.linspace(0.0, 20.0, 37)
    for sample in (None, "steps", "dense", "partial"):
        alone = integrate(problem, WHOLE, times, sample)
        watched = integrate(problem, WHOLE, times, sample, events=lambda q: q[0])
        assert np.array_equal(alone.t, watched.t)
        assert np.array_equal(alone.y, watched.y)
        assert alone.stats.steps == watched.stats.steps


def test_what_cannot_be_traced_is_called_and_gives_the_same():
    def g(t, y):
        return max(float(y[0]), -2.0) * (1 if t < 100 else 0)

    _, (traced, called) = happened(oscillator(), WHOLE, Event(lambda q: q[0], name="traced"), g)
    assert np.allclose(traced.t, called.t, rtol=0, atol=1e-14)
    assert np.array_equal(traced.direction, called.direction)


def test_arguments_are_had_by_name_traced_or_called():
    problem = oscillator(parameters={"level": 0.25}, t_end=3.0)

    def called(q, p, par, m, t):
        return m.sqrt(abs(q[0] - par.level)) * np.sign(q[0] - par.level)

    _, found = happened(problem, WHOLE, Event(lambda q, par: q[0] - par.level, name="traced"), called)
    for zeros in found:
        assert np.allclose(zeros.t, [math.asin(0.25), np.pi - math.asin(0.25)], rtol=0, atol=1e-11)


def test_a_function_of_time_alone_may_vary_faster_than_the_steps():
    solution, (zeros,) = happened(oscillator(), WHOLE, Event(lambda t, m: m.sin(20 * t)))
    assert np.allclose(zeros.t, np.pi / 20 * np.arange(1, 128), rtol=0, atol=1e-12)
    assert solution.status is Status.FINISHED


@pytest.mark.parametrize("method", [HBVM(), HBVM(k=8, s=4, h=10.0)], ids=str)
def test_steps_that_are_long_for_the_event_are_divided_until_they_show_it(method):
    slow = Problem(VectorField(lambda y: [y[1], -0.01 * y[0]], dim=2, name="slow"), y0=[1.0, 0.0], t_end=10.0)
    _, (zeros,) = happened(slow, method, Event(lambda t, m: m.sin(200 * t)))
    assert len(zeros) == 636
    assert np.allclose(zeros.t, np.pi / 200 * np.arange(1, 637), rtol=0, atol=1e-13)  # measured 2e-15


def test_a_start_at_zero_is_no_event_but_a_return_to_it_is():
    problem = oscillator(phase=0.3, t_end=10.0)
    start = math.sin(0.3)
    _, (exact, rounded) = happened(
        problem,
        WHOLE,
        Event(lambda q: q[0] - start, name="a"),
        Event(lambda q: (q[0] - start) * 3 + 1e-17, name="b"),
    )
    expected = [np.pi - 0.6, 2 * np.pi, 3 * np.pi - 0.6]
    assert np.allclose(exact.t, expected, rtol=0, atol=1e-11)
    assert np.allclose(rounded.t, expected, rtol=0, atol=1e-11)


def test_a_zero_at_the_end_of_a_step_is_one_event():
    uniform = Problem(VectorField(lambda y: [1.0 + 0 * y[0]], dim=1, name="clock"), y0=[0.0], t_end=8.0)
    for method in (Gauss(s=2, h=0.5), HBVM(k=4, s=2, h=0.25)):
        _, (zeros,) = happened(uniform, method, Event(lambda y: y[0] - 2.5))
        assert zeros.t.tolist() == [2.5]
        assert zeros.direction.tolist() == [1]


def test_a_function_that_is_never_finite_is_a_status_and_the_trajectory_is_kept():
    solution, (zeros, good) = happened(
        oscillator(), WHOLE, Event(lambda q, m: m.log(q[0] - 2), name="hole"), Event(lambda q: q[0], name="q")
    )
    assert solution.status is Status.NOT_FINITE
    assert solution.reason.startswith(
        "the event function hole was finite at none of the states between t = 0.0"
    )
    assert len(zeros) == 0
    assert len(good) == 6
    assert solution.t[-1] == 20.0
    called = integrate(oscillator(), WHOLE, events=lambda y: math.sqrt(-1 - y[0] ** 2))
    assert called.status is Status.NOT_FINITE


def test_a_function_that_is_finite_in_places_is_followed_there():
    _, (zeros,) = happened(oscillator(), Gauss(s=6, h=0.5), Event(lambda q, m: m.log(q[0]) + 1))
    level = math.exp(-1)
    expected = np.sort(
        [2 * np.pi * i + x for i in range(4) for x in (math.asin(level), np.pi - math.asin(level))]
    )
    assert np.allclose(zeros.t, expected[expected < 20.0], rtol=0, atol=1e-13)  # measured 1.8e-15


def test_a_failure_keeps_the_events_before_it():
    fall = Problem(VectorField(lambda y: [1 + y[0] ** 2], dim=1, name="tangent"), y0=[0.0], t_end=3.0)
    solution, (zeros,) = happened(fall, Gauss(s=4, h=0.05), lambda y: y[0] - 1)
    assert solution.status.failed
    assert solution.t_stop < np.pi / 2 + 0.1
    assert np.allclose(zeros.t, [np.pi / 4], rtol=0, atol=1e-13)  # measured 5.6e-16


@pytest.mark.parametrize("method", [HBVM(), HBVM(k=8, s=4, tol=1e-10), HBVM(k=8, s=4, h=0.01)], ids=str)
@pytest.mark.parametrize("terminal", [True, False])
def test_an_event_before_a_singularity_is_returned(method, terminal):
    kepler = Hamiltonian(
        lambda q, p, m: (p[0] ** 2 + p[1] ** 2) / 2 - 1 / m.sqrt(q[0] ** 2 + q[1] ** 2), dof=2
    )
    fall = Problem(kepler, q0=[1.0, 0.0], p0=[0.0, 0.0], t_end=5.0)
    solution, (half,) = happened(fall, method, Event(lambda q: q[0] - 0.5, terminal=terminal))
    at = (np.pi / 4 + 0.5) / math.sqrt(2)  # r = cos(x)^2 at t = (x + sin(x) cos(x)) / sqrt(2)
    assert np.allclose(half.t, [at], rtol=0, atol=1e-10)  # measured 2e-11
    assert solution.status is Status.EVENT if terminal else solution.status.failed
    # The fall ends at 1.1107.
    assert solution.t_stop == half.t[0] if terminal else 1.0 < solution.t_stop < 1.12


def test_methods_without_states_inside_their_steps_refuse():
    with pytest.raises(InputError, match=r"cannot find events: .* use HBVM, Gauss, LineIntegral or Taylor"):
        integrate(oscillator(), integrators.DOP853(rtol=1e-9, atol=1e-9), events=lambda q: q[0])


@pytest.mark.parametrize(
    ("events", "options", "message"),
    [
        ([3], {}, "an event needs a function g, not 3"),
        ([lambda q: q[7]], {}, "q.7. does not exist"),
        ([lambda state: state[0]], {}, "asks for an argument 'state'"),
        ([lambda q: q], {}, "returns 1 values, not one number"),
        ([Event(len, name="a"), Event(abs, name="a")], {}, "two events have the name 'a'"),
        ([lambda q: q[0]], {"sample": "stop"}, "sample='stop' changes; use 'partial'"),
        ([lambda q: q[0]], {"times": [1.0, 0.5]}, "strictly monotone"),
    ],
)
def test_what_cannot_be_used_is_refused(events, options, message):
    with pytest.raises(InputError, match=message):
        integrate(oscillator(), WHOLE, events=events, **options)
    for bad in ({"direction": 2}, {"terminal": -1}, {"terminal": 1.0}, {"terminal": "yes"}):
        with pytest.raises(InputError, match="of Event must be"):
            Event(lambda q: q[0], **bad)


@settings(max_examples=25, deadline=None)
@given(
    phase=st.floats(0.01, 6.2),
    level=st.floats(-1.2, 1.2).filter(lambda x: abs(abs(x) - 1) > 1e-6),
    h=st.sampled_from([0.3, 1.0, 2.0]),
)
def test_the_number_of_events_is_that_of_the_solution(phase, level, h):
    problem = oscillator(phase=phase, t_end=12.0, parameters={"level": level})
    _, (zeros,) = happened(problem, Gauss(s=10, h=h), Event(lambda q, par: q[0] - par.level))
    angles = [] if abs(level) > 1 else [math.asin(level), np.pi - math.asin(level)]
    expected = np.sort([2 * np.pi * i + a - phase for a in angles for i in range(-1, 5)])
    expected = expected[(expected > 1e-9) & (expected < 12.0)]
    assert len(zeros) == len(expected)
    # Measured 1.8e-15 / sqrt(1 - level^2).
    assert np.all(np.abs(zeros.t - expected) < 5e-14 / math.sqrt(max(1 - level * level, 1e-6)))
