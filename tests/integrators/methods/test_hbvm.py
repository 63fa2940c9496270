"""The stepper of HBVM: identities between ways to the same state, failures, and the stage equations."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import integrators
from integrators import HBVM, Gauss, Status, testing
from integrators.coefficients.legendre import legendre
from problems import Hamiltonian, Problem, VectorField


def start(problem, method):
    return method.compile(problem.system).start(problem.y0, problem.par, problem.t0)


@pytest.mark.parametrize("s", [1, 2, 3, 8, 13])
def test_gauss_is_hbvm_with_k_equal_s_bit_for_bit(s, henon_heiles):
    times = np.linspace(0, 40, 77)
    gauss = integrators.integrate(henon_heiles, Gauss(s=s, h=0.25), times)
    hbvm = integrators.integrate(henon_heiles, HBVM(k=s, s=s, h=0.25), times)
    assert np.array_equal(gauss.y, hbvm.y)


def test_the_step_satisfies_the_extended_collocation_conditions(henon_heiles):
    # sigma'(c_i) = sum_j P_j(c_i) int_0^1 P_j f(sigma), with the integral by a much finer rule: exact for a
    # polynomial H of degree 3 with k >= 3 s / 2.
    k, s, h = 6, 4, 0.5
    c = (np.polynomial.legendre.leggauss(k)[0] + 1) / 2
    x, w = np.polynomial.legendre.leggauss(40)
    fine, weights = (x + 1) / 2, w / 2
    times = h * np.sort(np.concatenate([fine, np.linspace(0.0, 1.0, 30)]))
    path = integrators.integrate(henon_heiles, HBVM(k=k, s=s, h=h), times, "dense").y
    fit = [np.polynomial.Polynomial.fit(times / h, component, s, domain=[0, 1]) for component in path.T]
    assert (
        max(np.abs(f(times / h) - component).max() for f, component in zip(fit, path.T, strict=True)) < 5e-15
    )
    field = field_of(henon_heiles, np.stack([f(fine) for f in fit]))
    gamma = (legendre(fine, s).T * weights) @ field.T
    slope = np.stack([f.deriv()(c) for f in fit], axis=-1) / h
    assert np.abs(slope - legendre(c, s) @ gamma).max() < 2e-13  # measured 7.2e-15
    # Collocation itself, sigma'(c_i) = f(sigma(c_i)), is what k > s gives up: measured 3.0e-5.
    assert np.abs(slope - field_of(henon_heiles, np.stack([f(c) for f in fit])).T).max() > 1e-6


def field_of(problem, y):
    from problems import targets

    return targets.numpy(problem.system, "field")(0.0, y, problem.par)


@pytest.mark.parametrize(
    "method", [HBVM(k=8, s=4, h=0.3), Gauss(s=3, h=0.2), HBVM(k=5, s=1, h=0.05)], ids=repr
)
def test_integrating_back_returns_to_the_start(method, henon_heiles):
    stepper = start(henon_heiles, method)
    forth = stepper.advance([30.0]).y[-1]
    back = stepper.advance([0.0])
    assert back.status is Status.FINISHED
    assert stepper.t == pytest.approx(0.0, abs=1e-12)
    assert np.abs(forth - henon_heiles.y0).max() > 0.1
    assert np.abs(back.y[-1] - henon_heiles.y0).max() < 5e-15  # measured 4.4e-16


def test_integration_backwards_is_integration_of_the_reversed_problem(henon_heiles):
    times = np.linspace(0, 20, 41)
    method = HBVM(k=8, s=4, h=0.3)
    past = integrators.integrate(henon_heiles, method, -times).y
    mirrored = Problem(
        henon_heiles.system, q0=henon_heiles.y0[:2], p0=-henon_heiles.y0[2:], t_end=henon_heiles.t_end
    )
    future = integrators.integrate(mirrored, method, times).y
    assert np.array_equal(past[:, :2], future[:, :2])
    assert np.array_equal(past[:, 2:], -future[:, 2:])


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.floats(0.01, 30.0), min_size=2, max_size=12, unique=True),
    st.integers(1, 11),
    st.sampled_from(["partial", "dense", "stop"]),
)
def test_any_pieces_equal_the_whole_bit_for_bit(times, cut, sample):
    problem, method = testing.pendulum(), HBVM(k=6, s=3, h=0.37)
    grid = np.sort(times)
    whole = start(problem, method).advance(grid, sample=sample).y
    stepper = start(problem, method)
    pieces = [stepper.advance(piece, sample=sample).y for piece in (grid[:cut], grid[cut:]) if piece.size]
    assert np.array_equal(np.concatenate(pieces), whole)


def test_adaptive_steps_are_the_same_whatever_is_sampled_between_them():
    problem, method = testing.pendulum(), HBVM(k=6, s=3, h=0.25)
    own = start(problem, method).advance([0.0, 20.0], sample="steps")
    assert np.array_equal(own.t, np.arange(81) * 0.25)
    single = start(problem, method)
    for state in own.y[1:]:
        assert single.step() is Status.RUNNING
        assert np.array_equal(single.y, state)
    times = np.linspace(0, 20, 161)
    for sample in ("partial", "dense"):
        mixed = start(problem, method).advance(times, sample=sample).y
        assert np.array_equal(mixed[::2], own.y)


def test_steps_start_with_the_present_only_if_asked_for():
    problem, method = testing.pendulum(), HBVM(k=6, s=3, h=0.25)
    stepper = start(problem, method)
    assert np.array_equal(stepper.advance([1.1], sample="steps").t, [0.25, 0.5, 0.75, 1.0])
    assert np.array_equal(stepper.advance([1.0, 1.3], sample="steps").t, [1.0, 1.25])
    assert stepper.advance([1.4], sample="steps").t.size == 0
    assert np.array_equal(stepper.advance([1.25, 0.9], sample="steps").t, [1.25, 1.0])


def test_stopping_at_output_times_changes_the_steps_and_says_where_it_is():
    problem, method = testing.pendulum(), HBVM(k=6, s=3, h=0.25)
    stepper = start(problem, method)
    stepper.advance([0.6, 0.7], sample="stop")
    assert stepper.t == 0.7
    stepper.step()
    assert stepper.t == 0.7 + 0.25


def test_time_is_counted_not_summed():
    def f(t, y):
        return [t]

    problem = Problem(VectorField(f, dim=1, name="clock"), y0=[0.0], t_end=1000.0)
    stepper = start(problem, HBVM(k=2, s=1, h=0.1))
    end = stepper.advance([1000.0])
    assert stepper.t == 10000 * 0.1
    # The increments of y are rounded, its sum is not (compensated): measured 2.2e-16.
    assert abs(end.y[0, 0] / 500_000 - 1) < 2e-15


def test_time_dependent_fields_see_the_stage_times():
    def f(t, y, m):
        return [y[1], -y[0] + m.sin(2 * t)]

    problem = Problem(VectorField(f, dim=2, name="forced"), y0=[1.0, 0.0], t_end=20.0)
    times = np.linspace(0, 20, 81)
    found = integrators.integrate(problem, HBVM(k=10, s=8, h=0.5), times).y[:, 0]
    # y = cos t + (2/3) sin t - (1/3) sin 2t
    exact = np.cos(times) + 2 / 3 * np.sin(times) - np.sin(2 * times) / 3
    assert np.abs(found - exact).max() < 1e-14  # measured 6.7e-16


def test_parameters_are_run_time_values():
    def H(q, p, par):
        return p[0] * p[0] / 2 + par.w * q[0] * q[0] / 2

    program = Gauss(s=6, h=0.1).compile(Hamiltonian(H, dof=1, parameters={"w": 1.0}, name="spring"))
    slow = program.start([1.0, 0.0]).advance([3.0]).y[0, 0]
    fast = program.start([1.0, 0.0], np.array([4.0])).advance([3.0]).y[0, 0]
    assert abs(slow - np.cos(3.0)) < 5e-15  # measured 1.1e-16
    assert abs(fast - np.cos(6.0)) < 5e-15  # measured 2.2e-16


def test_a_step_that_the_iteration_cannot_solve_ends_the_run_and_keeps_what_was_done(kepler):
    solution = integrators.integrate(kepler(0.8), HBVM(k=6, s=3, h=0.9), np.arange(0.0, 50.0, 0.9))
    assert solution.status is Status.NONLINEAR_DIVERGENCE
    assert "take a smaller h" in solution.reason
    assert f"t = {solution.t_stop!r}" in solution.reason
    assert 0 < solution.t.size < 50
    assert np.isfinite(solution.y).all()


def test_a_failed_stepper_stays_failed_until_it_is_restored(kepler):
    stepper = start(kepler(0.8), HBVM(k=6, s=3, h=0.9))
    fresh = stepper.checkpoint()
    assert stepper.advance([40.0]).status is Status.NONLINEAR_DIVERGENCE
    there = stepper.t
    assert stepper.step() is Status.NONLINEAR_DIVERGENCE
    again = stepper.advance([45.0])
    assert again.status is Status.NONLINEAR_DIVERGENCE
    assert again.t.size == 0
    assert stepper.t == there
    stepper.restore(fresh)
    assert stepper.status is Status.RUNNING
    assert stepper.reason == ""


def test_a_solution_that_ceases_to_exist_is_not_jumped_over():
    solution = integrators.integrate(testing.blow_up(), HBVM(k=8, s=4, h=0.05), np.linspace(0, 2, 41))
    assert solution.status.failed
    assert 0.8 < solution.t_stop <= 1.0
    error = np.abs(solution.y[:, 0] - 1 / (1 - solution.t))[solution.t < 0.9]
    assert error.max() < 1e-9  # measured 4.4e-11


def test_a_bad_extrapolation_does_not_lose_the_step():
    def H(q, p, m):
        # Two pendulums in one, masses and lengths 1.
        c = m.cos(q[0] - q[1])
        kinetic = (p[0] * p[0] + 2 * p[1] * p[1] - 2 * p[0] * p[1] * c) / (2 * (2 - c * c))
        return kinetic - 2 * m.cos(q[0]) - m.cos(q[1])

    problem = Problem(Hamiltonian(H, dof=2, name="double_pendulum"), q0=[1.5, 1.0], p0=[0.0, 0.0], t_end=40.0)
    solution = integrators.integrate(problem, HBVM(k=16, s=16, h=0.6), np.arange(0.0, 40.1, 0.6))
    assert solution.status is Status.FINISHED, solution.reason
    assert solution.stats.extra["restarts"] > 0  # measured 1
    assert solution.errors()["energy"].max() < 1e-11  # measured 1.7e-13


@pytest.mark.parametrize("tiny", [1e-5, 1e-150])
def test_tiny_components_are_resolved_relative_to_themselves(tiny):
    def H(q, p):
        # A light oscillator beside a heavy one, without any word about bodies.
        return (p[0] * p[0] + q[0] * q[0]) / 2 + (p[1] * p[1] + q[1] * q[1]) / 2 + q[0] * q[0] * q[0] / 10

    problem = Problem(
        Hamiltonian(H, dof=2, name="light_and_heavy"), q0=[0.5, tiny], p0=[0.0, 0.0], t_end=10.0
    )
    y = integrators.integrate(problem, HBVM(k=12, s=10, h=0.5), [10.0]).y[0]
    assert abs(y[1] / tiny - np.cos(10.0)) < 5e-15  # measured 1.1e-16


def test_components_that_rest_in_balance_do_not_stop_the_iteration():
    def H(q, p, m):
        # The middle one of three equal masses on a line: forces cancel but for their rounding.
        left, right = q[1] - q[0], q[2] - q[1]
        return (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) / 2 - m.cos(left / 3) - m.cos(right / 3)

    problem = Problem(
        Hamiltonian(H, dof=3, name="balance"), q0=[-1.1, 0.1, 1.3], p0=[0.1, 0.0, -0.1], t_end=200.0
    )
    solution = integrators.integrate(problem, HBVM(k=8, s=4, h=0.5), [200.0])
    assert solution.status is Status.FINISHED, solution.reason
    assert solution.stats.iterations < 15 * solution.stats.steps  # measured 9.5


def test_many_stages_and_coefficients_work(henon_heiles):
    reference = integrators.integrate(henon_heiles, Gauss(s=10, h=0.2), [20.0]).y
    # Measured 1.6e-15, and 6.2e-5 for s = 1.
    for k, s, h in [(64, 32, 2.5), (64, 1, 0.01), (33, 17, 1.0), (40, 40, 2.5)]:
        found = integrators.integrate(henon_heiles, HBVM(k=k, s=s, h=h), [20.0]).y
        assert np.abs(found - reference).max() < (3e-4 if s == 1 else 5e-14)


def test_the_second_program_of_a_system_costs_no_compilation(henon_heiles):
    HBVM(k=4, s=2, h=0.1).compile(henon_heiles.system)
    program = HBVM(k=8, s=3, h=0.2).compile(henon_heiles.system)
    assert program.from_cache
    assert program.compile_seconds < 1.0  # measured 0.06; compiling takes 5 s
