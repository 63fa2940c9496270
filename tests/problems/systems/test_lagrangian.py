"""Systems from a Lagrangian: the momenta, the Hamiltonian, and the motion."""

import pickle

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from integrators import HBVM, WHFast, integrate, load
from problems import InputError, Lagrangian, Problem


def cart(q, v, m, par):
    """Return L of a pendulum of length 2 on a cart on a spring."""
    x, y = v[0] + 2 * m.cos(q[1]) * v[1], 2 * m.sin(q[1]) * v[1]
    return par.cart * v[0] ** 2 / 2 + (x**2 + y**2) / 2 + 2 * m.cos(q[1]) - q[0] ** 2 / 2


@pytest.fixture
def problem():
    system = Lagrangian(cart, dof=2, parameters={"cart": 3.0})
    return Problem(system, q0=[0.1, 1.0], v0=[0.2, -0.3], t_end=10.0)


def by_hand(t, y):
    q, v = y[:2], y[2:]
    mass = np.array([[4.0, 2 * np.cos(q[1])], [2 * np.cos(q[1]), 4.0]])
    force = np.array([2 * np.sin(q[1]) * v[1] ** 2 - q[0], -2 * np.sin(q[1])])
    return np.concatenate([v, np.linalg.solve(mass, force)])


def test_the_motion_is_that_of_the_mass_matrix(problem):
    solution = integrate(problem, HBVM(), times=np.linspace(0.0, 10.0, 11))
    other = solve_ivp(
        by_hand, (0.0, 10.0), [0.1, 1.0, 0.2, -0.3],
        method="DOP853", rtol=1e-12, atol=1e-13, t_eval=solution.t,
    )  # fmt: skip
    # Measured 1.5e-12, of DOP853.
    assert np.abs(np.hstack([solution.q, solution.v]) - other.y.T).max() < 1e-11
    # Measured 1.7e-16.
    assert solution.errors()["energy"].max() < 1e-15


def test_momenta_and_velocities_belong_together(problem):
    q, v = np.array([0.1, 1.0]), np.array([0.2, -0.3])
    cosine = np.cos(q[1])
    assert problem.y0[2:] == pytest.approx(
        [4 * v[0] + 2 * cosine * v[1], 2 * cosine * v[0] + 4 * v[1]], rel=1e-15
    )
    assert problem.velocity(problem.y0)[0] == pytest.approx(v, rel=1e-15)


def test_a_magnetic_field_shifts_the_momenta():
    def L(q, v):
        return (v[0] ** 2 + v[1] ** 2) / 2 + (q[0] * v[1] - q[1] * v[0])

    problem = Problem(Lagrangian(L, dof=2), q0=[1.0, 0.0], v0=[0.0, -2.0], t_end=np.pi)
    assert problem.y0.tolist() == [1.0, 0.0, 0.0, -1.0]
    solution = integrate(problem, HBVM(), times=np.linspace(0.0, np.pi, 9))
    # A circle about the origin, with twice the field's angular velocity; measured 1.2e-16.
    exact = np.stack([np.cos(2 * solution.t), -np.sin(2 * solution.t)], axis=1)
    assert np.abs(solution.q - exact).max() < 1e-15


def test_time_may_stand_in_the_kinetic_energy():
    problem = Problem(
        Lagrangian(lambda t, q, v, m: m.exp(t) * (v[0] ** 2 - q[0] ** 2) / 2, dof=1),
        q0=[1.0], v0=[0.0], t_end=5.0,
    )  # fmt: skip
    solution = integrate(problem, HBVM(), times=np.linspace(0.0, 5.0, 11))
    # Damped by x'' + x' + x = 0; measured 1.1e-16.
    w = np.sqrt(0.75)
    exact = np.exp(-solution.t / 2) * (np.cos(w * solution.t) + 0.5 / w * np.sin(w * solution.t))
    assert np.abs(solution.q[:, 0] - exact).max() < 1e-15
    assert solution.v[0, 0] == 0.0


def test_constant_masses_are_seen():
    system = Lagrangian(
        lambda q, v, m, par: (par.a * v[0] ** 2 + v[1] ** 2) / 2 - m.sum(lambda i: q[i] ** 4, range(2)),
        dof=2, parameters={"a": 2.0},
    )  # fmt: skip
    assert system.separable
    assert WHFast(h=0.1).accepts(Problem(system, q0=[1.0, 0.0], v0=[0.0, 1.0], t_end=1.0)) is not None


def test_pickles_and_files(problem, tmp_path):
    again = pickle.loads(pickle.dumps(problem))
    assert again == problem
    assert np.array_equal(again.velocity(again.y0), problem.velocity(problem.y0))
    solution = integrate(problem, HBVM(k=6, s=3, h=0.1))
    solution.save(tmp_path / "a.npz")
    assert load(tmp_path / "a.npz").problem == problem
    assert repr(problem).startswith("Problem(Lagrangian(cart, dof=2), q0=[0.1, 1.0], v0=[0.2, -0.3]")


@pytest.mark.parametrize(
    ("L", "says"),
    [
        (lambda q, v: v[0] ** 4, "is not quadratic in v as it is written"),
        (lambda q, v, m: m.sqrt(1 + v[0] ** 2), "is not quadratic in v as it is written"),
        (lambda q, v: v[0] - q[0], r"does not depend on v\[0\] by itself"),
        (lambda q, v, m: m.sum(lambda i: v[i] ** 2, range(1)), "a velocity stands in m.sum"),
        (lambda q, p: p[0] ** 2, "asks for an argument 'p'; name those it needs among m, par, q, t, v"),
    ],
)
def test_what_it_cannot_be(L, says):
    with pytest.raises(InputError, match=says):
        Lagrangian(L, dof=1)
