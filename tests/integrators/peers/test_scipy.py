import warnings

import numba
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import integrators.testing as testing
import problems
from integrators import Status, integrate
from integrators.peers.heyoka.taylor import Taylor
from integrators.peers.scipy import DOP853, RTOL_FLOOR, Radau
from problems import targets
from problems.problem import Problem

METHODS = [DOP853(rtol=1e-10, atol=1e-12), Radau(rtol=1e-8, atol=1e-10)]


def dense(problem):
    """Return the Jacobian of a problem as `solve_ivp` takes it."""
    found = problem.system.jacobian()
    entries = targets.numpy(problem.system, found)

    def matrix(t, y):
        made = np.zeros((y.size, y.size))
        made[found.rows, found.columns] = entries(t, y, problem.par)
        return made

    return matrix


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_the_steps_are_those_of_solve_ivp(method):
    problem = testing.two_bodies()
    field = targets.numpy(problem.system, "field")
    jac = {"jac": dense(problem)} if isinstance(method, Radau) else {}
    theirs = solve_ivp(
        lambda t, y: field(t, y, problem.par),
        (0.0, 15.0),
        problem.y0,
        method=type(method).__name__,
        rtol=method.rtol,
        atol=method.atol,
        **jac,
    )
    ours = integrate(problem, method, [0.0, 15.0], sample="steps")
    # The last step too, which both shorten to end at 15.
    assert np.array_equal(ours.t, theirs.t)
    assert np.array_equal(ours.y, theirs.y.T)


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_samples_leave_the_steps_alone_and_are_as_good(method):
    problem = testing.two_bodies()
    grid = np.linspace(0.0, 15.0, 57)
    few, many = (integrate(problem, method, times) for times in ([15.0], grid))
    assert np.array_equal(few.y[-1], many.y[-1])
    assert few.stats.steps == many.stats.steps
    assert few.stats.evaluations == many.stats.evaluations
    # The end of the last step is at 15, so a sample there costs nothing.
    assert many.stats.extra["side_evaluations"] > few.stats.extra["side_evaluations"] == 0
    reference = integrate(problem, Taylor(), grid).y
    errors = np.max(np.abs(many.y - reference), axis=1)
    # The error grows along the orbit and is not larger between the steps: 1.0, 1.0.
    assert errors.max() <= 1.5 * errors[-3:].max()


def test_the_least_relative_tolerance_is_the_library_s():
    problem = testing.pendulum()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        integrate(problem, DOP853(rtol=RTOL_FLOOR, atol=1e-15), [1.0])
    with pytest.warns(UserWarning, match="too small"):
        solve_ivp(lambda t, y: -y, (0.0, 1.0), [1.0], rtol=np.nextafter(RTOL_FLOOR, 0.0))


@pytest.mark.parametrize(("name", "more"), [("kepler", {}), ("fput", {"n": 60})])
def test_radau_has_the_jacobian_of_the_traced_system(name, more):
    problem = problems.load(name, **more)
    stepper = Radau(rtol=1e-6, atol=1e-8).compile(problem.system).start(problem.y0, problem.par)
    J = stepper._solver.J  # sparse where it is large
    assert np.allclose(J.toarray() if more else J, dense(problem)(0.0, problem.y0), rtol=0, atol=1e-14)
    # Its step takes no evaluation of the field for differences: 120 of them each time.
    before = stepper.stats.evaluations
    stepper._solver.jac(0.0, problem.y0, None)
    assert stepper.stats.evaluations == before


def test_work_is_counted_with_the_finite_differences_of_the_jacobian():
    """A system that is not traced has no Jacobian but SciPy's."""
    stats = integrate(testing.pendulum(), Radau(rtol=1e-6, atol=1e-8), [20.0]).stats
    assert stats.extra["jacobians"] >= 1
    foreign = problems.Opaque(numba.njit(lambda t, y: np.array([y[1], -np.sin(y[0])])), dim=2)
    problem = Problem(foreign, y0=[0.0, 1.9], t_end=20.0)
    more = integrate(problem, Radau(rtol=1e-6, atol=1e-8), [20.0]).stats
    assert more.evaluations > stats.evaluations
    stats = more
    assert stats.extra["jacobians"] >= 1
    assert stats.extra["factorizations"] >= 2
    assert stats.evaluations > 3 * stats.steps
    stats = integrate(testing.pendulum(), DOP853(rtol=1e-6, atol=1e-8), [20.0]).stats
    assert stats.evaluations >= 12 * stats.steps
    assert "jacobians" not in stats.extra


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_a_pole_ends_in_underflow_of_the_step(method):
    solution = integrate(testing.blow_up(), method, np.linspace(0.0, 2.0, 41))
    assert solution.status is Status.STEP_UNDERFLOW
    assert solution.t_stop == pytest.approx(1.0, abs=1e-6)
    assert "Required step size is less than spacing between numbers" in solution.reason


def test_time_runs_backwards_too():
    problem = testing.two_bodies()
    stepper = METHODS[0].compile(problem.system).start(problem.y0, problem.par)
    stepper.advance([7.3])
    back = stepper.advance([5.0, 0.0])
    assert np.max(np.abs(back.y[-1] - problem.y0)) < 1e-7  # 2e-9
