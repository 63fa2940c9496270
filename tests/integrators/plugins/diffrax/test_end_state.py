"""Ends of trajectories as JAX functions: the derivatives are those of `integrators.gradient`."""

import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, gradient
from problems import InputError

jax = pytest.importorskip("jax")
pytest.importorskip("diffrax")

from integrators.plugins.diffrax import end_state, states  # noqa: E402
from integrators.plugins.diffrax.many import DOUBLE  # noqa: E402


@pytest.fixture(autouse=True)
def double():
    with DOUBLE(True):
        yield


@pytest.mark.parametrize("method", [Gauss(s=4, h=0.1), HBVM(tol=1e-12)], ids=repr)
def test_its_derivatives_are_those_of_the_gradient(method):
    problem = problems.load("double_pendulum")
    end = end_state(problem, method, t_end=1.5)
    names = ["y0", *problem.system.parameters]
    value, grads = gradient(problem, method, lambda y: y[0] * y[3], names, t_end=1.5)

    def loss(y0, par):
        state = end(y0, par)
        return state[0] * state[3]

    found, (by_start, by_par) = jax.jit(jax.value_and_grad(loss, argnums=(0, 1)))(problem.y0, problem.par)
    assert float(found) == pytest.approx(value, rel=1e-14)
    assert np.allclose(by_start, grads["y0"], rtol=1e-13, atol=0.0)
    assert np.allclose(by_par, [float(grads[name]) for name in names[1:]], rtol=1e-13, atol=0.0)


def test_many_starts_and_no_parameters():
    problem = problems.load("pendulum")
    end = end_state(problem, Gauss(s=4, h=0.1), t_end=2.0)
    starts = np.array([[0.1, 0.5], [1.0, 0.0]])
    maps = jax.vmap(jax.jacrev(end), in_axes=(0, None))(starts, problem.par)
    assert np.allclose(np.linalg.det(maps), 1.0, rtol=0.0, atol=1e-14)  # measured: 4e-16


def test_single_precision_is_refused():
    with DOUBLE(False), pytest.raises(InputError, match="jax_enable_x64"):
        end_state(problems.load("pendulum"), HBVM())


def test_states_at_times_have_the_gradient_of_a_sum_over_samples():
    problem, times = problems.load("double_pendulum"), [0.5, 1.0, 1.5]
    at = states(problem, HBVM(tol=1e-12), times)
    value, grads = gradient(problem, HBVM(tol=1e-12), lambda y: y[0] * y[3], ["y0"], times=times)

    def loss(y0, par):
        return (at(y0, par)[:, 0] * at(y0, par)[:, 3]).sum()

    found, by_start = jax.jit(jax.value_and_grad(loss))(problem.y0, problem.par)
    assert float(found) == pytest.approx(value, rel=1e-14)
    assert np.allclose(by_start, grads["y0"], rtol=1e-13, atol=0.0)


def test_many_trajectories_run_in_threads_with_the_same_derivatives():
    problem = problems.load("pendulum")
    starts = np.array([[0.1, 0.5], [1.0, 0.0], [0.3, -0.2]])
    found = []
    for threads in (1, 3):
        at = states(problem, Gauss(s=4, h=0.1), [1.0, 2.0], threads=threads)
        loss = jax.grad(lambda y0, par, at=at: (at(y0, par) ** 2).sum())
        found.append(np.asarray(jax.vmap(loss, in_axes=(0, None))(starts, problem.par)))
    alone = [np.asarray(loss(row, problem.par)) for row in starts]
    assert np.array_equal(found[0], found[1])
    assert np.array_equal(found[0], alone)
