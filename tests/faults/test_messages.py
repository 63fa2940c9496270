"""Messages name what was given, what is wrong and the fix."""

import re

import numba
import numpy as np
import pytest

import problems
from integrators import (
    DOP853,
    HBVM,
    Event,
    Gauss,
    Radau,
    Status,
    Taylor,
    advise,
    integrate,
    integrate_many,
    periodic,
    start,
)
from problems import Hamiltonian, InputError, Opaque, Poisson, Problem, VectorField

SPRING = Problem(Hamiltonian(lambda q, p: (p[0] ** 2 + q[0] ** 2) / 2, dof=1), q0=[1.0], p0=[0.0], t_end=1.0)


@pytest.mark.parametrize(
    ("times", "says"),
    [
        ([0, 5, 5, 10], r"times\[1\] = 5.0 is followed by times\[2\] = 5.0"),
        ([1, 3, 2], r"times\[1\] = 3.0 is followed by times\[2\] = 2.0"),
        ([-1, -3, -2], r"times\[1\] = -3.0 is followed by times\[2\] = -2.0"),
        ([-1, 1], "-1.0 and 1.0 lie on both sides of it: integrate twice"),
    ],
)
def test_the_times_that_are_out_of_order_are_named(times, says):
    with pytest.raises(InputError, match=says):
        integrate(SPRING, HBVM(), times)


@numba.njit
def potential(q):
    return q[0] ** 2 / 2


def test_a_compiled_formula_is_refused_without_numbas_dump():
    with pytest.raises(InputError, match=r"compiled by numba.*potential\.py_func") as caught:
        Hamiltonian(potential, dof=1)
    assert len(str(caught.value)) < 250


def test_a_formula_that_calls_a_compiled_function_is_refused_without_numbas_dump():
    with pytest.raises(InputError, match=r"numba has compiled.*py_func") as caught:
        Hamiltonian(lambda q, p: p[0] ** 2 / 2 + potential(q), dof=1)
    assert len(str(caught.value)) < 250
    assert Hamiltonian(lambda q, p: p[0] ** 2 / 2 + potential.py_func(q), dof=1).separable


def test_multipliers_of_sympys_equations_are_named():
    sympy = pytest.importorskip("sympy")
    mechanics = pytest.importorskip("sympy.physics.mechanics")
    x, y = mechanics.dynamicsymbols("x y")
    m, g, length = sympy.symbols("m g length")
    L = m * (x.diff() ** 2 + y.diff() ** 2) / 2 - m * g * y
    equations = mechanics.LagrangesMethod(L, [x, y], hol_coneqs=[x**2 + y**2 - length**2])
    equations.form_lagranges_equations()
    with pytest.raises(
        InputError, match=r"5 unknowns for 4 coordinates.*those behind them are Lagrange multipliers"
    ):
        problems.from_sympy(equations, parameters={m: 1.0, g: 9.81, length: 1.0})


def opaque(f, dim=2, **options):
    return Problem(Opaque(f, dim=dim), y0=[1.0, 0.5][:dim], t_end=20.0, **options)


def forgets(t, y, dy):
    y[1] * 2


def takes_a_constant(t, y, k):
    return [y[1], -y[0]]


def returns_one(t, y):
    return [y[1]]


@numba.njit
def forgets_compiled(t, y, dy):
    y[0]


@pytest.mark.parametrize(
    ("f", "says"),
    [
        (forgets, r"forgets has not written dy\[0\]; a function f\(t, y, dy\) writes all 2"),
        (takes_a_constant, "takes a third argument, which is the array for the derivative"),
        (returns_one, r"returns_one returns an array of shape \(1,\), not \(2,\)"),
    ],
)
def test_a_field_that_gives_no_derivative_is_named(f, says):
    with pytest.raises(InputError, match=says):
        integrate(opaque(f), HBVM(), [20.0])


def test_a_compiled_field_that_writes_nothing_is_named():
    solution = integrate(opaque(forgets_compiled), HBVM(), [20.0])
    assert solution.status is Status.NOT_FINITE
    assert re.search(r"in the step from t = 0.0: forgets_compiled has not written dy\[0\]", solution.reason)


def ends_at_three(t, y):
    return [y[1], -y[0] if t < 3.0 else np.nan]


@numba.njit
def ends_at_three_compiled(t, y, dy):
    dy[0], dy[1] = y[1], -y[0] if t < 3.0 else np.nan


FORMULA = VectorField(lambda t, y, m: [y[1], -y[0] * m.sqrt(3.0 - t)], dim=2)
SWING = Hamiltonian(lambda t, q, p, m: p[0] ** 2 / 2 + q[0] ** 2 / 2 * m.sqrt(3.0 - t), dof=1)


@pytest.mark.parametrize(
    "method",
    [
        HBVM(),
        HBVM(tol=1e-6, solver="newton"),
        Gauss(s=2, h=0.1),
        Gauss(s=2, h=0.1, solver="newton"),
        DOP853(rtol=1e-8, atol=1e-8),
        Radau(rtol=1e-6, atol=1e-6),
    ],
    ids=repr,
)
@pytest.mark.parametrize(
    ("problem", "derivative"),
    [
        (opaque(ends_at_three), "dy[1]/dt"),
        (opaque(ends_at_three_compiled), "dy[1]/dt"),
        (Problem(FORMULA, y0=[1.0, 0.0], t_end=20.0), "dy[1]/dt"),
        (Problem(SWING, q0=[1.0], p0=[0.0], t_end=20.0), "dp[0]/dt"),
    ],
    ids=["Python", "numba", "formula", "Hamiltonian"],
)
def test_the_derivative_that_is_not_finite_is_named_with_its_time(problem, derivative, method):
    # Before: "Newton ... take a smaller h", or only the start of the step.
    solution = integrate(problem, method, [20.0])
    assert solution.status in (Status.NOT_FINITE, Status.STEP_UNDERFLOW)
    named = re.search(re.escape(derivative) + r" is nan at t = ([0-9.]+)\.$", solution.reason)
    assert named, solution.reason
    assert abs(float(named[1]) - 3.0) < 2e-3  # looked at by 64ths of the step of 0.1
    assert "smaller h" not in solution.reason


@pytest.mark.parametrize("method", [HBVM(), Gauss(s=2, h=0.1), DOP853(rtol=1e-8, atol=1e-8)], ids=repr)
def test_a_users_exception_is_told_with_its_type_text_and_time(method):
    def f(t, y):
        if t > 10.3:
            raise ValueError("my own text")
        return [y[1], -y[0]]

    solution = integrate(opaque(f), method, [20.0])
    assert type(solution.error) is ValueError
    assert re.search(r"t = 10\.(3|29999).*ValueError \(my own text\)", solution.reason)


def complex_in_place(t, y, dy):
    dy[0], dy[1] = y[1], -1j * y[0]


def complex_arrays(t, y, dy):
    dy[:] = np.array([y[1], -1j * y[0]])


@numba.njit
def complex_compiled(t, y, dy):
    dy[0], dy[1] = y[1], -1j * y[0]


@numba.njit
def complex_returned(t, y):
    return np.array([y[1] + 0j, -1j * y[0]])


@pytest.mark.parametrize("method", [HBVM(), DOP853(rtol=1e-8, atol=1e-8)], ids=repr)
@pytest.mark.parametrize(
    "f",
    [complex_in_place, complex_arrays, complex_compiled, complex_returned, lambda t, y: [y[1], -1j * y[0]]],
)
def test_complex_derivatives_are_refused_with_the_way_to_split_them(f, method):
    # Before: a TypeError of NumPy, numba's dump, or the imaginary part dropped.
    with pytest.raises(InputError, match=r"complex.*split.*into real and imaginary parts"):
        integrate(opaque(f), method, [20.0])


@numba.njit
def unknown_name(t, y):
    return np.array([y[1], missing(y[0])])  # noqa: F821


def test_numbas_dump_is_a_sentence_with_the_error_behind_it():
    with pytest.raises(InputError, match=r"numba does not compile unknown_name .*missing") as caught:
        integrate(opaque(unknown_name), HBVM(), [20.0])
    assert len(str(caught.value)) < 300
    assert type(caught.value.__cause__).__module__.startswith("numba")


METHODS = [HBVM(), Gauss(s=2, h=0.1), DOP853(rtol=1e-6, atol=1e-6), Taylor()]


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_an_interval_of_no_length_gives_the_start_as_that_time_does(method):
    # Before: refused.
    at_once = SPRING.replace(t0=2.0, t_end=2.0)
    one, other = integrate(at_once, method), integrate(SPRING.replace(t0=2.0, t_end=3.0), method, [2.0])
    assert one.status is other.status is Status.FINISHED
    assert one.t.tolist() == other.t.tolist() == [2.0]
    assert one.y.tolist() == other.y.tolist() == [[1.0, 0.0]]
    assert one.t_stop == 2.0
    assert one.stats.steps == 0
    assert one.warnings == ()
    assert integrate(SPRING, method, 0.0).t.tolist() == [0.0]
    many = integrate_many(at_once, method, starts=[[1.0, 0.0], [2.0, 0.0]])
    assert many.y.tolist() == [[[1.0, 0.0]], [[2.0, 0.0]]]
    run = start(at_once, method)
    assert run.until(2.0).tolist() == [1.0, 0.0]
    assert abs(run.until(3.0)[0] - np.cos(1.0)) < 1e-4  # measured 1.2e-7 with Gauss(s=2, h=0.1)


def test_what_needs_an_interval_refuses_one_of_no_length():
    for needs in (periodic, advise):
        with pytest.raises(InputError, match=r"ends at its start, t0=0\.0"):
            needs(SPRING.replace(t_end=0.0))


def test_real_powers_of_negative_numbers_are_not_finite_with_the_component():
    problem = Problem(VectorField(lambda y: [-1.0 - y[0] ** 1.3], dim=1), y0=[1.0], t_end=3.0)
    solution = integrate(problem, HBVM(), [3.0])
    assert solution.status is Status.NOT_FINITE
    assert "dy[0]/dt is nan" in solution.reason


@pytest.mark.parametrize(
    ("name", "x", "exact"),
    [
        ("asinh", (0.3,), np.arcsinh(0.3)), ("acosh", (1.3,), np.arccosh(1.3)),
        ("atanh", (0.3,), np.arctanh(0.3)), ("expm1", (1e-9,), np.expm1(1e-9)),
        ("log1p", (1e-9,), np.log1p(1e-9)), ("hypot", (3.0, 4.0), 5.0), ("floor", (-1.5,), -2.0),
        ("sign", (-2.0,), -1.0), ("min", (2.0, 3.0), 2.0), ("max", (2.0, 3.0), 3.0),
    ],
)  # fmt: skip
def test_the_functions_that_users_write_exist(name, x, exact):
    system = VectorField(lambda y, m: [getattr(m, name)(*x), 0.0 * y[0]], dim=2)
    solution = integrate(Problem(system, y0=[0.0, 1.0], t_end=1.0), Gauss(s=2, h=1.0), [1.0])
    assert abs(solution.y[0, 0] - exact) <= 1e-15 * abs(exact)


def test_heyoka_knows_erfc():
    system = VectorField(lambda y, m: [-m.erfc(y[0])], dim=1)
    problem = Problem(system, y0=[0.3], t_end=1.0)
    ours, theirs = (integrate(problem, method, [1.0]).y for method in (HBVM(), Taylor()))
    assert abs(ours - theirs).max() < 1e-14  # measured 1.1e-16


def test_a_quotient_and_its_opposite_are_antisymmetric():
    def structure(y):
        return [[0, -1 / (1 + y[0] ** 2)], [1 / (1 + y[0] ** 2), 0]]

    assert Poisson(lambda y, m: m.cos(y[0]) + m.sin(y[1]), structure, dim=2).dim == 2


def test_a_terminal_event_before_all_samples_leaves_one_state_with_its_variations():
    # Before: no state with variations=, one without.
    top = Event(lambda p: p[0], terminal=1, name="top")
    rising = SPRING.replace(y0=[0.0, 1.0], t_end=20.0)
    for method in (HBVM(), Gauss(s=4, h=0.1)):
        plain = integrate(rising, method, [20.0], events=top)
        followed = integrate(rising, method, [20.0], events=top, variations="y0")
        assert followed.status is Status.EVENT
        assert followed.t.tolist() == plain.t.tolist()
        assert followed.y.tolist() == plain.y.tolist()
        # of a quarter of a turn: measured 9e-17 and 2e-17
        assert np.abs(followed.variations - [[[0.0, 1.0], [-1.0, 0.0]]]).max() < 1e-8


def test_too_many_massless_bodies_name_the_call_that_takes_them():
    place, velocity = np.random.default_rng(0).uniform(1.0, 2.0, (2, 2004, 3))
    with pytest.raises(InputError, match=r"massless=1.*integrate_many\(problem, starts="):
        problems.nbody([1.0, 1e-3, 1e-3, 1e-3], place, velocity, massless=2000, t_end=1.0)


KNOTS = np.linspace(0.0, 2.0, 11)
BEYOND = "is 4.8[0-9]*, beyond its data from 0.0 to 2.0: the outer piece was extrapolated"
DRIFTS = VectorField(lambda y, m: [1.0 + 0.1 * m.table(y[0], KNOTS, np.sin(KNOTS))], dim=1)
LOOPS = VectorField(
    lambda y, m: [
        1.0 + m.sum(lambda i: 0.1 * m.table(y[i], KNOTS, np.sin(KNOTS)), range(1)),
        m.sum(lambda i: 0.0 * y[i], range(2)),
    ],
    dim=2,
)


@pytest.mark.parametrize("system", [DRIFTS, LOOPS], ids=["formula", "loop"])
@pytest.mark.parametrize("method", [HBVM(), Gauss(s=2, h=0.1), DOP853(rtol=1e-9, atol=1e-9)], ids=repr)
def test_a_table_left_by_the_state_is_told_in_runs_ensembles_and_step_by_step(system, method):
    # Before: of a loop, in ensembles and by start() nothing was said.
    y0 = [0.0] * system.dim
    problem = Problem(system, y0=y0, t_end=5.0)
    told = integrate(problem, method, [5.0]).warnings
    assert re.search(BEYOND, told[-1])
    many = integrate_many(
        problem, method, starts=[y0, [-4.0, *y0[1:]], [-30.0, *y0[1:]]], times=[0.0, 1.0, 5.0]
    )
    assert re.search(BEYOND, many.warnings[0][-1])
    assert all("beyond its data" in said[-1] for said in many.warnings[1:])  # at their starts
    run = start(problem, method)
    run.until(1.0)
    assert not any("beyond its data" in said for said in run.warnings)
    run.until(5.0)
    assert re.search(BEYOND, run.warnings[-1])


def test_a_table_of_the_time_is_refused_step_by_step_as_in_a_run():
    driven = VectorField(lambda t, y, m: [m.table(t, KNOTS, np.sin(KNOTS))], dim=1)
    run = start(Problem(driven, y0=[0.0], t_end=5.0), HBVM())
    assert abs(run.until(2.0)[0] - (1.0 - np.cos(2.0))) < 1e-4  # measured 2.4e-6: a cubic through the samples
    with pytest.raises(InputError, match=r"data from 0.0 to 2.0, and from t = 2.0 to 5.0"):
        run.until(5.0)


def test_parameters_as_a_number_times_twice_and_two_hundred_massless_bodies_are_told_with_the_fix():
    with pytest.raises(InputError, match=r"par, which holds all parameters, as if.*write par\.rate"):
        VectorField(lambda t, y, par: [par * y[0]], dim=1, parameters={"rate": 1.0})
    with pytest.raises(InputError, match=r"times must be strictly monotone; times\[1\] = 5\.0 is followed"):
        integrate(problems.load("kepler", t_end=10.0), HBVM(), times=[0.0, 5.0, 5.0, 10.0])
    place, velocity = np.random.default_rng(0).normal(size=(2, 202, 3))
    with pytest.raises(
        InputError, match=r"200 massless bodies beside 2 with mass.*make the problem with massless=1"
    ):
        problems.nbody([1.0, 1e-3], place, velocity, massless=200, t_end=1.0)
