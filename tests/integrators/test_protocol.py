"""What a user can get wrong, the registry, and what importing costs."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import integrators
from integrators import HBVM, Gauss, registry, testing
from integrators.protocol import Status
from integrators.refusals import check_state, check_times
from integrators.running.times import plan
from problems import Hamiltonian, Problem
from problems.errors import InputError, UnknownNameError


@pytest.mark.parametrize("h", [0, 0.0, -0.5, float("nan"), float("inf"), "0.1", True])
@pytest.mark.parametrize(
    "make", [lambda h: HBVM(k=4, s=2, h=h), lambda h: Gauss(s=2, h=h)], ids=["HBVM", "Gauss"]
)
def test_a_step_that_is_not_positive_and_finite_is_refused_by_name_and_value(make, h):
    with pytest.raises(InputError, match=r"h=.* must be a finite step above 0"):
        make(h)


@pytest.mark.parametrize("bad", [0, -1, 2.0, 1.5, "2", True])
def test_s_and_k_must_be_whole_numbers_from_one_on(bad):
    with pytest.raises(InputError, match=r"s=.* of HBVM must be a whole number of at least 1"):
        HBVM(k=4, s=bad, h=0.1)
    with pytest.raises(InputError, match=r"k=.* of HBVM must be a whole number of at least 1"):
        HBVM(k=bad, s=1, h=0.1)
    with pytest.raises(InputError, match=r"s=.* of Gauss must be a whole number of at least 1"):
        Gauss(s=bad, h=0.1)


def test_fewer_nodes_than_coefficients_are_refused_with_the_fix():
    with pytest.raises(InputError, match=r"k=2 is less than s=3: raise k or lower s"):
        HBVM(k=2, s=3, h=0.1)


def test_options_of_equal_value_make_equal_methods_that_print_alike():
    method = HBVM(k=np.int64(4), s=2, h=1)
    assert method == HBVM(k=4, s=2, h=1.0)
    assert repr(method) == "HBVM(k=4, s=2, h=1.0)"
    assert repr(Gauss(s=2, h=np.float64(0.5))) == "Gauss(s=2, h=0.5)"


def test_positional_options_are_refused():
    with pytest.raises(InputError, match="by name"):
        HBVM(4, 2, 0.1)


def test_the_registry_knows_our_methods_and_the_package_shows_them():
    assert {"HBVM", "Gauss"} <= set(registry.names())
    assert registry.get("HBVM") is HBVM
    assert integrators.Gauss is Gauss
    assert registry.create("Gauss", s=3, h=0.2) == Gauss(s=3, h=0.2)
    assert "HBVM" in dir(integrators)
    with pytest.raises(AttributeError, match="no attribute 'HBMV'"):
        integrators.HBMV  # noqa: B018


def test_unknown_names_come_with_the_nearest():
    with pytest.raises(UnknownNameError, match=r"unknown method 'hbmv'; did you mean 'HBVM'"):
        registry.get("hbmv")
    with pytest.raises(UnknownNameError, match=r"unknown option of HBVM 'kk'; did you mean 'k'"):
        registry.create("HBVM", kk=4, s=2, h=0.1)
    with pytest.raises(
        InputError, match=r"LineIntegral needs k, s; give a value as in LineIntegral\(k=...\)"
    ):
        registry.create("LineIntegral", invariants=["energy"])


def test_integrate_says_what_is_wrong_with_its_arguments():
    problem, method = testing.pendulum(), HBVM(k=4, s=2, h=0.1)
    with pytest.raises(InputError, match="problem must be a Problem"):
        integrators.integrate("pendulum", method)
    with pytest.raises(InputError, match="method must be a method such as"):
        integrators.integrate(problem, "HBVM")
    with pytest.raises(
        UnknownNameError, match=r"unknown sample of integrate 'partail'; did you mean 'partial'"
    ):
        integrators.integrate(problem, method, sample="partail")
    with pytest.raises(InputError, match="strictly monotone"):
        integrators.integrate(problem, method, [0.0, 2.0, 1.0])
    with pytest.raises(InputError, match="finite"):
        integrators.integrate(problem, method, [0.0, np.nan])
    with pytest.raises(InputError, match=r"would need 2.0e\+301 steps; take a larger h"):
        integrators.integrate(problem, HBVM(k=4, s=2, h=1e-300))


def test_a_state_that_is_not_finite_is_refused_before_the_first_step():
    problem = testing.pendulum()
    program = HBVM(k=4, s=2, h=0.1).compile(problem.system)
    with pytest.raises(InputError, match=r"y0\[1\] is nan"):
        program.start([0.0, np.nan])
    with pytest.raises(InputError, match=r"shape \(2,\), not \(3,\)"):
        program.start([0.0, 1.0, 2.0])
    with pytest.raises(InputError, match=r"par must have shape \(0,\), not \(1,\)"):
        program.start([0.0, 1.0], np.ones(1))


def test_a_checkpoint_of_another_method_is_refused():
    system = testing.pendulum().system
    checkpoint = HBVM(k=4, s=2, h=0.1).compile(system).start([0.0, 1.0]).checkpoint()
    other = HBVM(k=4, s=3, h=0.1).compile(system).start([0.0, 1.0])
    with pytest.raises(InputError, match="belongs to another method or system"):
        other.restore(checkpoint)


def test_a_solution_knows_all_about_itself():
    problem, method = testing.two_bodies(), Gauss(s=4, h=0.1)
    solution = integrators.integrate(problem, method)
    assert (solution.problem, solution.method) == (problem, method)
    assert solution.status is Status.FINISHED
    assert solution.reason == ""
    assert solution.t.size == 1001
    assert solution.t_stop == problem.t_end
    assert solution.y.shape == (1001, 12)
    assert solution.v.shape == (1001, 6)
    assert np.allclose(solution.v[:, :3], solution.y[:, 6:9], rtol=0, atol=0)  # a mass of 1
    assert np.allclose(solution.v[:, 3:], solution.y[:, 9:] / 0.5, rtol=1e-15)
    assert solution.invariants()["energy"].shape == (1001,)
    assert solution.errors()["energy"].max() < 1e-5
    assert solution.guards() == {}
    assert solution.compile_seconds > 0
    assert solution.stats.steps == 150
    assert solution.stats.evaluations >= 4 * solution.stats.iterations


def test_times_are_checked_against_the_present():
    assert np.array_equal(check_times([1.0, 2.0], 1.0), [1.0, 2.0])
    assert np.array_equal(check_times([0.0, -1.0], 1.0), [0.0, -1.0])
    assert np.array_equal(check_times(1.0, 1.0), [1.0])
    for bad in ([0.5, 1.5], [2.0, 2.0], [], [[1.0]], [np.inf]):
        with pytest.raises(InputError):
            check_times(bad, 1.0)


def test_states_are_copied_when_checked():
    y = np.zeros(2)
    assert check_state(y, 2) is not y


@given(
    st.floats(-1e3, 1e3),
    st.floats(1e-3, 10.0),
    st.sampled_from([-1, 1]),
    st.integers(0, 10**7),
    st.floats(0.0, 1.0),
)
def test_times_split_into_whole_steps_and_a_part_without_rounding(t0, h, sign, n, fraction):
    from fractions import Fraction

    time, step = t0 + (n + fraction) * h * sign, sign * h
    steps, parts = plan(np.array([time]), np.array([t0]), step)
    exact = Fraction(time) - Fraction(t0) - int(steps[0]) * Fraction(step)
    close = 4 * np.spacing(max(abs(time), abs(t0)))
    if parts[0] == 0.0:
        assert abs(exact) <= close
    else:
        assert abs(Fraction(float(parts[0])) - exact) <= Fraction(float(abs(parts[0]))) * Fraction(1, 2**51)
        assert 0 < parts[0] * sign < h + close


@given(
    st.floats(-1e3, 1e3),
    st.sampled_from([0.1, -0.1, 1 / 3, -2.5, 1e-5]),
    st.integers(0, 10**6),
    st.integers(-6, 6),
    st.floats(0.0, 1.0),
)
def test_one_time_is_split_as_one_of_many(t0, h, n, ulps, fraction):
    time = t0 + n * h + fraction * h * (ulps > 4)
    time += ulps * float(np.spacing(time))
    alone = plan(np.array([time]), np.array([t0]), h)
    among = plan(np.array([time, time]), np.array([t0, t0]), h)
    for one, many in zip(alone, among, strict=True):
        assert one.dtype == many.dtype
        assert one.tobytes() == many[:1].tobytes()


def test_multiples_of_the_step_are_its_steps_however_they_were_rounded():
    for h in (0.1, 0.3, 1 / 3, 0.7):
        times = np.arange(1, 100001) * h
        summed = np.linspace(0.0, 100000 * h, 100001)[1:]
        for grid in (times, summed):
            steps, parts = plan(grid, np.zeros(grid.size), h)
            assert np.array_equal(steps, np.arange(1, 100001))
            assert not parts.any()


def test_importing_loads_neither_other_libraries_nor_what_takes_long():
    unwanted = ["heyoka", "rebound", "diffrax", "jax", "scipy", "numba", "llvmlite", "matplotlib", "mpmath"]
    unwanted += [
        "psutil",
        "sqlite3",
        "importlib.metadata",
        "email.message",
        "zipfile",
        "socket",
        "subprocess",
    ]
    code = f"import sys, integrators; print(sorted(set(sys.modules) & set({unwanted})))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_the_function_integrate_stays_when_its_module_is_imported():
    import integrators.running.integrate

    assert callable(integrators.integrate)


def test_problems_with_a_field_that_is_nowhere_finite_end_as_not_finite():
    def H(q, p, m):
        return p[0] * p[0] / 2 + m.sqrt(q[0])

    problem = Problem(Hamiltonian(H, dof=1, name="root"), q0=[-1.0], p0=[0.0], t_end=1.0)
    solution = integrators.integrate(problem, HBVM(k=4, s=2, h=0.1), [0.5, 1.0])
    assert solution.status is Status.NOT_FINITE
    assert solution.t.size == 0
    assert solution.t_stop == 0.0
    assert "not finite in the step from t = 0.0" in solution.reason
