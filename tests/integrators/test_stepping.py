"""What the base of a third party's integrator promises, on the smallest method one can write."""

from dataclasses import dataclass

import numba
import numpy as np
import pytest

from integrators import Status, integrate, testing
from integrators.stepping import FixedStep, FixedStepper
from problems import Opaque, Problem, VectorField, targets


@dataclass(frozen=True, kw_only=True, repr=False)
class RK4(FixedStep):
    """The classical Runge-Kutta method."""

    order, evaluations = 4, 4
    library, family, citation = "tests", "runge-kutta", "W. Kutta (1901)"

    def march(self, system):
        f, dim = targets.numba(system, "field"), system.dim

        @numba.njit(error_model="numpy")
        def march(t, h, first, n, y, par):
            k1, k2, k3, k4 = np.empty(dim), np.empty(dim), np.empty(dim), np.empty(dim)
            for i in range(first, first + n):
                now = t + i * h
                f(now, y, par, k1)
                f(now + h / 2, y + h / 2 * k1, par, k2)
                f(now + h / 2, y + h / 2 * k2, par, k3)
                f(now + h, y + h * k3, par, k4)
                y += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

        return march


def test_a_method_of_twenty_lines_conforms_and_has_its_order():
    testing.check_method(RK4(h=0.01), testing.pendulum())
    order = testing.measured_order(lambda h: RK4(h=h), testing.pendulum(), [0.2, 0.1, 0.05, 0.025, 0.0125])
    assert abs(order - 4.0) < 0.2  # measured 3.83


def test_samples_leave_the_steps_of_a_driven_system_as_they_are():
    field = VectorField(lambda t, y, m: [y[1], m.sin(t) - m.sin(y[0])], dim=2)
    problem = Problem(field, y0=[0.0, 0.5], t_end=1000.0)
    often = integrate(problem, RK4(h=0.07), np.linspace(0.0, 1000.0, 7000))
    once = integrate(problem, RK4(h=0.07), [1000.0])
    assert np.array_equal(often.y[-1], once.y[0])  # chaotic: other times, rounded otherwise, would show


def test_the_kit_notices_samples_that_change_the_steps(monkeypatch):
    def aside(stepper, part):
        stepper._here += 1e-13
        return stepper._here.copy()

    testing.samples_leave_the_steps_alone(RK4(h=0.25), testing.pendulum())
    monkeypatch.setattr(FixedStepper, "_aside", aside)
    with pytest.raises(AssertionError, match="samples leave the steps of RK4"):
        testing.samples_leave_the_steps_alone(RK4(h=0.25), testing.pendulum())


@pytest.mark.parametrize("compiled", [False, True])
def test_what_a_foreign_field_raises_ends_the_run_with_the_time_of_its_step(compiled):
    def field(t, y):
        if t > 1.0:
            raise RuntimeError("boom")
        return np.array([y[1], -y[0]])

    foreign = Opaque(numba.njit(field) if compiled else field, dim=2)
    problem = Problem(foreign, y0=[1.0, 0.0], t_end=5.0)
    solution = integrate(problem, RK4(h=0.125), [0.5, 0.9, 1.0, 4.0])
    assert solution.status is Status.USER_ERROR
    assert solution.reason == "a function of yours raised RuntimeError (boom) in the step from t = 1.0."
    assert (solution.t_stop, solution.t.tolist()) == (1.0, [0.5, 0.9, 1.0])
    assert isinstance(solution.error, RuntimeError)
    stepper = RK4(h=0.125).compile(foreign).start(problem.y0)
    assert [stepper.step() for _ in range(9)] == [Status.RUNNING] * 8 + [Status.USER_ERROR]
    with pytest.raises(RuntimeError, match="boom"):
        integrate(Problem(foreign, y0=[1.0, 0.0], t0=2.0, t_end=5.0), RK4(h=0.125))
