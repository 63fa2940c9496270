"""integrate_many on JAX: the same trajectories as on the vector unit."""

import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, Leapfrog, Status, integrate_many
from problems import Hamiltonian, Opaque, Problem
from problems.errors import InputError

pytest.importorskip("diffrax")
rng = np.random.default_rng(5)


@pytest.mark.parametrize("method", [Gauss(s=6, h=0.2), HBVM(k=8, s=4, h=0.1)], ids=str)
def test_the_trajectories_are_those_of_the_vector_unit(method):
    problem = problems.load("morse")
    n = 300  # more than go side by side
    starts, widths = rng.uniform(-0.1, 0.3, (n, 2)), rng.uniform(0.8, 1.2, n)
    asked = {"starts": starts, "parameters": {"a": widths}, "times": [0.0, 0.5, 1.33, 5.0]}
    here, there = (integrate_many(problem, method, **asked, backend=backend) for backend in (None, "jax"))
    assert there.arrived.all()
    assert np.abs(there.y - here.y).max() < 1e-14  # measured 1e-15
    assert there.steps.tolist() == here.steps.tolist()
    assert there.y.dtype == np.float64


def test_time_runs_backwards_and_a_trajectory_does_not_depend_on_the_others():
    problem = problems.load("kepler", e=0.3)
    starts = problem.y0 * (1 + 0.1 * rng.uniform(-1, 1, (5, 1)))
    method, times = Gauss(s=4, h=0.1), [-0.33, -2.0]
    whole = integrate_many(problem, method, starts=starts, times=times, backend="jax")
    one = integrate_many(problem, method, starts=starts[3:4], times=times, backend="jax")
    assert np.array_equal(one.y[0], whole.y[3])
    expected = integrate_many(problem, method, starts=starts, times=times)
    assert np.abs(whole.y - expected.y).max() < 1e-13  # measured 2e-15


def test_one_that_fails_has_its_status_and_the_others_are_there():
    def H(q, p, m):
        return p[0] * p[0] / 2 - q[0] * m.sqrt(q[0])

    problem = Problem(Hamiltonian(H, dof=1, name="root"), q0=[1.0], p0=[0.0], t_end=4.0)
    starts = [[1.0, 0.0], [1.0, -2.0], [2.0, 0.5]]
    made = integrate_many(problem, Gauss(s=4, h=0.25), starts=starts, backend="jax")
    assert made.arrived.tolist() == [True, False, True]
    assert made.status[1] is Status.NONLINEAR_DIVERGENCE
    assert f"t = {made.t_stop[1]:g}" in made.reason[1]
    assert 0.25 <= made.t_stop[1] < 1.5
    assert np.isfinite(made.y[[0, 2]]).all()


@pytest.mark.parametrize(
    ("method", "words"),
    [
        (HBVM(), "has no form on JAX; use HBVM"),
        (Leapfrog(h=0.1), "has no form on JAX; use HBVM"),
        (HBVM(k=4, s=2, h=0.1, solver="newton"), "leave solver= out"),
    ],
    ids=str,
)
def test_a_method_without_a_form_on_jax_is_told(method, words):
    with pytest.raises(InputError, match=words):
        integrate_many(problems.load("kepler"), method, starts=[[1.0, 0.0, 0.0, 1.0]], backend="jax")


def test_only_what_does_not_need_the_structure_of_a_poisson_system_runs_on_it():
    problem = problems.load("lotka_volterra", t_end=2.0)
    with pytest.raises(InputError, match="energy of a Poisson system such as lotka_volterra; use Gauss"):
        integrate_many(problem, HBVM(k=6, s=2, h=0.2), starts=[problem.y0], backend="jax")
    gauss = HBVM(k=2, s=2, h=0.2)
    here, there = (integrate_many(problem, gauss, starts=[problem.y0], backend=b) for b in (None, "jax"))
    assert np.abs(there.y - here.y).max() < 1e-14  # measured 1.3e-15


def test_a_field_of_foreign_code_and_an_unknown_backend_are_told():
    problem = Problem(Opaque(lambda t, y: [y[1], -y[0]], dim=2), y0=[1.0, 0.0], t_end=1.0)
    with pytest.raises(InputError, match="not traced"):
        integrate_many(problem, Gauss(s=2, h=0.1), starts=[[1.0, 0.0]], backend="jax")
    with pytest.raises(InputError, match="unknown backend of integrate_many 'jaxx'"):
        integrate_many(problem, Gauss(s=2, h=0.1), starts=[[1.0, 0.0]], backend="jaxx")
