"""Compiled fields inside ``solve_ivp``: the kernel's steps, and all that SciPy makes of steps."""

from typing import Any

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import OdeSolver, solve_ivp

import integrators
import problems
from integrators.plugins import scipy as plugin
from integrators.plugins.scipy import HBVM, Gauss, field
from problems.errors import InputError
from problems.systems.opaque import Opaque

PENDULUM = problems.load("pendulum")
Y0 = PENDULUM.y0
TRACED = field(PENDULUM)


@numba.njit
def returning(t, y):
    return np.array([y[1], -np.sin(y[0])])


@numba.njit
def in_place(t, y, dy):
    dy[0] = y[1]
    dy[1] = -np.sin(y[0])


def python(t: float, y: np.ndarray) -> list[float]:
    return [y[1], -np.sin(y[0])]


def energy(y: np.ndarray) -> float:
    """Largest relative error of the pendulum's energy."""
    return float(PENDULUM.errors(y.T)["energy"].max())


def solve(fun: Any, end: float = 50.0, method: Any = HBVM, **options: Any) -> Any:
    return solve_ivp(fun, (0.0, end), Y0, method=method, **{"rtol": 1e-10, "atol": 1e-10, **options})


@pytest.fixture
def no_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a step in Python fail."""

    def refuse(*args: Any, **options: Any) -> Any:
        raise AssertionError("steps in Python")

    monkeypatch.setattr(plugin, "PythonSteps", refuse)


@pytest.fixture(scope="module")
def at_20() -> np.ndarray:
    return solve(TRACED, 20.0, k=16, s=8, rtol=3e-14, atol=3e-14).y[:, -1]


@pytest.mark.parametrize("fun", [python, returning, TRACED], ids=["Python", "numba", "traced"])
@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
def test_gauss_keeps_the_tolerance_with_every_kind_of_function(
    fun: Any, rtol: float, at_20: np.ndarray
) -> None:
    for s in (3, 4, 6, 8):
        made = solve(fun, 20.0, method=Gauss, s=s, rtol=rtol, atol=rtol)
        # Largest measured: Python 4.8 and 9.3 times rtol, s = 6; the kernel 1.1 and 0.7.
        assert np.abs(made.y[:, -1] - at_20).max() < 20.0 * rtol, s


@pytest.mark.parametrize("s", [1, 2, 6])
def test_gauss_of_one_length_is_the_same_with_every_kind_of_function(s: int) -> None:
    ends = [solve(fun, 20.0, method=Gauss, s=s, h=0.25).y[:, -1] for fun in (python, returning, TRACED)]
    assert np.ptp(ends, axis=0).max() < 1e-13  # measured 7e-15


@pytest.mark.usefixtures("no_python")
@pytest.mark.parametrize("fun", [TRACED, returning, in_place], ids=["traced", "returning", "in place"])
def test_a_compiled_field_takes_the_kernels_steps_and_keeps_the_energy(fun: Any) -> None:
    solution = solve(fun)
    assert solution.success
    assert solution.t[-1] == 50.0
    assert energy(solution.y) < 1e-14  # measured 9e-16
    close = solve(python, method="DOP853", rtol=1e-13, atol=1e-13)
    assert np.abs(solution.y[:, -1] - close.y[:, -1]).max() < 1e-9  # measured 4e-12


@settings(max_examples=25, deadline=None)
@given(
    st.floats(-1.5, 1.5),
    st.floats(0.3, 1.9),
    st.floats(-12.0, -3.0),
    st.integers(2, 8),
    st.sampled_from([1, -1]),
)
def test_the_energy_is_round_off_for_any_start_tolerance_degree_and_direction(
    q: float, p: float, digits: float, s: int, sign: int
) -> None:
    solution = solve_ivp(TRACED, (0.0, 20.0 * sign), [q, p], method=HBVM, rtol=10.0**digits, s=s)
    assert solution.t[-1] == 20.0 * sign
    values = solution.y[1] ** 2 / 2 - np.cos(solution.y[0])
    assert np.abs(values - values[0]).max() < 2e-14  # measured 2e-15


@pytest.mark.usefixtures("no_python")
def test_the_steps_are_those_of_the_native_method() -> None:
    solution = solve(TRACED, k=12, s=6)
    method = integrators.HBVM(k=12, s=6, tol=1e-10, atol=1e-10)
    native = method.compile(PENDULUM.system).start(Y0, PENDULUM.par)
    made = native.advance([50.0], sample="steps")
    np.testing.assert_array_equal(solution.t[1:-1], made.t)
    np.testing.assert_array_equal(solution.y.T[1:-1], made.y)


def test_nfev_is_the_number_of_states_at_which_the_field_was_evaluated() -> None:
    calls = 0

    def counting(t: float, y: np.ndarray) -> list[float]:
        nonlocal calls
        calls += 1
        return python(t, y)

    solution = solve(field(Opaque(counting, dim=2)), 5.0, t_eval=np.linspace(0.0, 5.0, 7))
    assert solution.nfev == calls
    assert calls > 0


@pytest.mark.usefixtures("no_python")
def test_steps_of_one_length_are_counted_and_the_last_one_is_shortened() -> None:
    solution = solve(TRACED, 10.05, k=12, s=6, h=0.1)
    np.testing.assert_allclose(solution.t[:-1], 0.1 * np.arange(101), rtol=4e-16)
    assert solution.t[-1] == 10.05
    assert energy(solution.y) < 1e-14  # measured 7e-16
    back = solve_ivp(TRACED, (10.05, 0.0), solution.y[:, -1], method=HBVM, k=12, s=6, h=0.1)
    assert np.abs(back.y[:, -1] - Y0).max() < 1e-12  # measured 4e-15


@pytest.mark.parametrize("fun", [TRACED, python], ids=["compiled", "Python"])
def test_gauss_with_steps_of_one_length_keeps_quadratic_invariants(fun: Any) -> None:
    oscillator = field(problems.VectorField(lambda t, y: [y[1], -y[0]], dim=2))

    def turning(t: float, y: np.ndarray) -> list[float]:
        return [y[1], -y[0]]

    given_fun = oscillator if fun is TRACED else turning
    solution = solve_ivp(given_fun, (0.0, 100.0), [1.0, 0.0], method=Gauss, s=2, h=0.5)
    assert np.abs((solution.y**2).sum(axis=0) - 1.0).max() < 1e-14  # measured 4e-16
    assert np.abs(solution.y[0, -1] - np.cos(100.0)) > 1e-4  # of order 4, the steps are long


@pytest.mark.usefixtures("no_python")
@pytest.mark.parametrize("options", [{"k": 12}, {"k": 12, "h": 0.4}], ids=["varying", "constant"])
def test_every_seventh_step_is_a_step_of_the_same_trajectory(options: dict[str, Any]) -> None:
    all_steps, some = solve(TRACED, **options), solve(TRACED, every=7, **options)
    np.testing.assert_array_equal(some.t[:-2], all_steps.t[: 7 * (some.t.size - 2) : 7])
    np.testing.assert_array_equal(some.y[:, :-2], all_steps.y[:, : 7 * (some.t.size - 2) : 7])
    np.testing.assert_array_equal(some.y[:, -1], all_steps.y[:, -1])
    # A call of the kernel looks for a jump where it ends: at most one evaluation for each call: 81 more.
    assert 0 <= all_steps.nfev - some.nfev <= all_steps.t.size


@pytest.mark.usefixtures("no_python")
@pytest.mark.parametrize("every", [1, 7])
def test_states_between_the_steps_keep_order_and_energy(every: int) -> None:
    times = np.linspace(0.0, 50.0, 173)
    solution = solve(TRACED, every=every, dense_output=True, t_eval=times)
    assert energy(solution.y) < 1e-14  # measured 1e-15
    close = solve(python, method="DOP853", rtol=1e-13, atol=1e-13, t_eval=times)
    assert np.abs(solution.y - close.y).max() < 1e-9  # measured 5e-12
    np.testing.assert_array_equal(solution.sol(times[40:50]), solution.y[:, 40:50])
    np.testing.assert_array_equal(solution.sol(float(times[41])), solution.y[:, 41])


@pytest.mark.usefixtures("no_python")
@pytest.mark.parametrize("every", [1, 2])
def test_events_are_found_to_round_off_and_a_terminal_one_ends_it(every: int) -> None:
    def bottom(t: float, y: np.ndarray) -> float:
        return float(y[0])

    solution = solve(TRACED, events=bottom, every=every)
    period = 2.0 * np.diff(solution.t_events[0][1:])
    assert np.ptp(period) < 1e-9  # measured 3e-12
    assert energy(solution.y_events[0].T) < 1e-14
    bottom.terminal = 3  # type: ignore[attr-defined]
    ended = solve(TRACED, events=bottom, every=every)
    assert ended.status == 1
    np.testing.assert_array_equal(ended.t_events[0], solution.t_events[0][:3])


@pytest.mark.usefixtures("no_python")
def test_first_step_and_max_step_bound_the_kernels_steps() -> None:
    solution = solve(TRACED, first_step=0.01, max_step=0.3)
    lengths = np.diff(solution.t)
    assert lengths[0] == 0.01
    assert lengths.max() <= 0.3 * (1.0 + 1e-12)
    assert np.diff(solve(TRACED).t).max() > 0.35  # so it was the bound that bound


@pytest.mark.usefixtures("no_python")
def test_a_solution_that_ends_is_a_failure_with_time_and_reason() -> None:
    blowing = field(problems.VectorField(lambda t, y: [y[0] * y[0]], dim=1))
    solution = solve_ivp(blowing, (0.0, 2.0), [1.0], method=HBVM, rtol=1e-8)
    assert solution.status == -1
    assert solution.t[-1] == pytest.approx(1.0, abs=1e-6)
    assert "t = " in solution.message


@pytest.mark.usefixtures("no_python")
def test_a_poisson_system_keeps_its_energy() -> None:
    problem = problems.load("lotka_volterra")
    for options in ({"rtol": 1e-9}, {"h": 0.1, "k": 12}):
        solution = solve_ivp(
            field(problem), (0.0, 20.0), problem.y0, method=HBVM, t_eval=np.linspace(0.0, 20.0, 9), **options
        )
        assert float(problem.errors(solution.y.T)["energy"].max()) < 1e-13  # measured 2e-15


def test_a_field_is_a_function_for_any_method_of_scipy() -> None:
    ours, theirs = solve(TRACED, method="DOP853"), solve(python, method="DOP853")
    np.testing.assert_allclose(ours.y, theirs.y, rtol=0.0, atol=1e-12)  # measured 4e-15
    columns = solve(TRACED, method="Radau", rtol=1e-6, vectorized=True)
    assert columns.success


def test_parameters_of_a_field_are_the_problems_or_those_given() -> None:
    system = problems.VectorField(lambda t, y, par: [par.rate * y[0]], dim=1, parameters={"rate": 1.0})
    for rate in (1.0, -2.0):
        solution = solve_ivp(field(system, {"rate": rate}), (0.0, 1.0), [1.0], method=HBVM, rtol=1e-12)
        assert solution.y[0, -1] == pytest.approx(np.exp(rate), rel=1e-12)


def test_compiled_functions_that_the_kernel_cannot_take_are_called_from_python() -> None:
    @numba.njit
    def scaled(t, y, rate):
        return rate * y

    with_arguments = solve_ivp(scaled, (0.0, 1.0), [1.0], method=HBVM, args=(-1.0,))
    assert with_arguments.y[0, -1] == pytest.approx(np.exp(-1.0), rel=1e-6)

    @numba.njit
    def turning(t, y):
        return 1j * y

    complex_state = solve_ivp(turning, (0.0, 1.0), [1.0 + 0.0j], method=HBVM, rtol=1e-10)
    assert abs(complex_state.y[0, -1] - np.exp(1j)) < 1e-9


@pytest.mark.parametrize("fun", [TRACED, returning, in_place], ids=["traced", "returning", "in place"])
def test_one_stage_with_a_tolerance_is_called_from_python(fun: Any) -> None:
    solution = solve(fun, 1.0, method=Gauss, s=1, rtol=1e-4, atol=1e-4)
    close = solve(python, 1.0, method="DOP853")
    assert np.abs(solution.y[:, -1] - close.y[:, -1]).max() < 1e-2  # measured 5e-4


def test_a_numba_function_that_gives_no_array_of_numbers_is_called_from_python_with_a_warning() -> None:
    @numba.njit
    def mixed(t, y):
        return y[1], 0

    with pytest.warns(UserWarning, match="steps are taken in Python"):
        solution = solve_ivp(mixed, (0.0, 1.0), [0.0, 1.0], method=HBVM)
    assert solution.y[0, -1] == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(
    ("fun", "options", "sentence"),
    [
        (python, {"every": 10}, "compiled fields"),
        (TRACED, {"every": 0}, "every=0 of HBVM must be a whole number"),
        (TRACED, {"interpolant": "polynomial"}, "leave it out"),
        (TRACED, {"h": 0.1}, "needs k"),
        (python, {"h": -0.1, "k": 6}, "h=-0.1 of HBVM must be a finite step above 0"),
        (TRACED, {"h": 0.1, "k": 6, "max_step": 0.05}, "leave out first_step and max_step"),
        (field(problems.load("kepler")), {}, "length 4"),
    ],
)
def test_what_cannot_be_done_is_refused_with_a_sentence(fun: Any, options: Any, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        solve(fun, **options)


def test_a_field_is_made_of_problems_and_systems_only() -> None:
    with pytest.raises(InputError, match="Problem or a System"):
        field(python)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="load it with"):
        field(PENDULUM, {"g": 2.0})


SWITCH = problems.VectorField(lambda t, y, m: [-y[0] + m.tanh(4 * (t - 5)) + 1], dim=1)


@pytest.mark.parametrize(
    "fun", [field(SWITCH), lambda t, y: np.tanh(4 * (t - 5)) + 1 - y], ids=["traced", "Python"]
)
@pytest.mark.parametrize("method", [(HBVM, {}), (HBVM, {"k": 8, "s": 7}), (Gauss, {"s": 8})], ids=str)
@pytest.mark.parametrize("tolerances", [{}, {"rtol": 1e-8, "atol": 1e-8}], ids=["default", "1e-8"])
def test_the_absolute_tolerance_of_scipy_is_kept_from_rest(fun: Any, method: Any, tolerances: Any) -> None:
    # Rounding of tanh + 1 is all there is before t = 1; by relative errors no step was short enough there.
    which, options = method
    found = solve_ivp(fun, (0.0, 10.0), [0.0], method=which, **options, **tolerances)
    assert found.success
    assert abs(found.y[0, -1] - 1.986171412) < 1e-7  # 4e-8 with atol=1e-6, 8e-10 with 1e-8


def test_a_larger_absolute_tolerance_takes_fewer_steps() -> None:
    small = 1e-6 * Y0
    steps = [
        solve_ivp(TRACED, (0.0, 20.0), small, method=HBVM, k=8, s=4, rtol=1e-8, atol=atol).t.size
        for atol in (0.0, 1e-12, [1e-12, 1e-12], 1e-9)
    ]
    assert steps[0] > steps[1] == steps[2] > steps[3]


def falls(t: float, y: np.ndarray) -> np.ndarray:
    return np.array([y[1], -9.80665])


def lands(t: float, y: np.ndarray) -> float:
    return y[0]


lands.terminal, lands.direction = True, -1  # type: ignore[attr-defined]
PATHS = {"Python": falls, "numba": numba.njit(falls), "field": field(Opaque(numba.njit(falls), dim=2))}
PATH = pytest.mark.parametrize("fun", PATHS.values(), ids=PATHS)
TURN = 0.02 / 9.80665  # when a body thrown at 0.01 is back


@PATH
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("options", [{}, {"k": 4, "s": 2, "h": 1e-3}], ids=["tolerance", "fixed"])
def test_without_an_end_a_terminal_event_ends_the_integration(fun: Any, sign: float, options: Any) -> None:
    solution = solve_ivp(
        fun, (0.0, sign * np.inf), [0.0, sign * 0.01], method=HBVM, events=lands, dense_output=True, **options
    )
    assert solution.status == 1
    assert solution.t_events[0][0] == pytest.approx(sign * TURN, rel=1e-12)  # measured 2e-16
    assert solution.t[-1] == solution.t_events[0][0]


@PATH
@pytest.mark.parametrize("options", [{}, {"k": 4, "s": 2, "h": 0.1}], ids=["tolerance", "fixed"])
def test_an_interval_without_length_gives_the_initial_state(fun: Any, options: Any) -> None:
    every = {} if fun is falls else {"every": 10}
    solution = solve_ivp(fun, (1.0, 1.0), [0.0, 0.01], method=HBVM, **every, **options)
    assert solution.success
    assert solution.t.tolist() == [1.0, 1.0]  # as SciPy's own methods
    assert (solution.y.T == [0.0, 0.01]).all()


@PATH
def test_a_longest_step_below_the_spacing_of_times_is_scipys_failure(fun: Any) -> None:
    solver = HBVM(fun, 5.0, [0.0, 0.01], 9.0, max_step=1e-20)
    says = ""
    while solver.status == "running":
        says = solver.step()
    assert solver.status == "failed"
    assert OdeSolver.TOO_SMALL_STEP in says
    at_0 = HBVM(fun, 0.0, [0.0, 0.01], 1.0, max_step=1e-20)  # there such a step can be told from none
    assert at_0.step() is None
    assert at_0.t == pytest.approx(1e-20)
