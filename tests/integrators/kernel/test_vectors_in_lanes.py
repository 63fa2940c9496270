"""Tangent vectors of fixed steps in lanes: the derivatives of the steps, as one trajectory has them."""

import numpy as np
import pytest

import problems
from integrators import HBVM, Gauss, Status, integrate, integrate_many
from integrators.kernel.batch import Work
from integrators.kernel.tangent.lanes import MOST_ROWS
from integrators.running.integrate import prepared
from problems import Hamiltonian, InputError, Lagrangian, Problem, VectorField


def pendulum(q, p, par, m):
    return p[0] ** 2 / 2 - par.g * m.cos(q[0])


def masses(q, p, par, m):
    """Separable, with velocities that depend on parameters."""
    kinetic = p[0] ** 2 / (2 * par.m[0]) + p[1] ** 2 / (2 * par.m[1])
    return kinetic + m.exp(q[0] - q[1]) + par.k * (q[0] ** 2 + q[1] ** 2) / 2


def coupled(q, p, par, m):
    """Not separable."""
    return p[0] ** 2 * (1.0 + q[1] ** 2) / 2 + p[1] ** 2 / 2 + par.a * (q[0] ** 2 + q[1] ** 2 + q[0] ** 4)


def swing(t, q, v, par, m):
    """A pendulum of varying length, as a Lagrangian."""
    length = 1.0 + par.a * m.cos(t)
    return length**2 * v[0] ** 2 / 2 + length * m.cos(q[0])


def driven(t, y, par, m):
    return [y[1], -m.sin(y[0]) - 0.1 * y[1] + par.a * m.cos(par.w * t), y[0] * y[2] - y[2] ** 3]


def hamiltonian(energy, q0, p0, **parameters):
    system = Hamiltonian(energy, dof=len(q0), parameters=parameters)
    return Problem(system, q0=q0, p0=p0, t_end=10.0)


SYSTEMS = {
    "separable": hamiltonian(pendulum, [0.3], [0.8], g=1.1),
    "velocities": hamiltonian(masses, [0.3, -0.2], [0.8, 0.1], m=[1.0, 2.5], k=1.5),
    "not separable": hamiltonian(coupled, [0.3, 0.5], [0.8, 0.1], a=0.7),
    "bodies": problems.load("kepler", e=0.3),
    "Lagrangian": Problem(
        Lagrangian(swing, dof=1, parameters={"a": 0.1}), q0=[0.3], v0=[0.8], t_end=10.0, t0=0.5
    ),
    "first order": Problem(
        VectorField(driven, dim=3, parameters={"a": 0.4, "w": 1.3}), y0=[0.3, 0.4, 0.7], t_end=10.0, t0=0.5
    ),
}
METHODS = [Gauss(s=4, h=0.1), Gauss(s=8, h=0.25), HBVM(k=8, s=3, h=0.1), HBVM(k=16, s=6, h=0.2)]
COUNT = 11  # more than there are lanes


@pytest.fixture
def alone(monkeypatch):
    """The numbers of the trajectories that do not go in lanes."""
    numbers, inner = [], Work.alone

    def watched(self, i):
        numbers.append(i)
        return inner(self, i)

    monkeypatch.setattr(Work, "alone", watched)
    return numbers


def ensemble(problem):
    return problem.y0 * np.linspace(0.9, 1.1, COUNT)[:, np.newaxis]


def in_lanes(problem, method, count, *, moves=False):
    return prepared(method, problem.system)[0].in_lanes_along(count, moves) is not None


def wanted(problem, kind):
    if kind == "names":
        return ["y0", "t0", *problem.system.parameters]
    return np.random.default_rng(3).standard_normal((COUNT, problem.system.dim, 2))


@pytest.mark.parametrize("kind", ["names", "vectors"])
@pytest.mark.parametrize("method", METHODS, ids=repr)
@pytest.mark.parametrize("name", SYSTEMS)
def test_they_are_those_of_single_trajectories_to_rounding(name, method, kind, alone):
    problem = SYSTEMS[name]
    starts, asked = ensemble(problem), wanted(problem, kind)
    times = problem.t0 + np.array([0.0, 1.0, 1.13, 1.5])
    made = integrate_many(problem, method, starts=starts, times=times, variations=asked)
    assert in_lanes(problem, method, made.variations.shape[-1], moves=kind == "names")
    assert not alone
    for i in range(COUNT):
        vectors = asked if kind == "names" else asked[i]
        one = integrate(problem.replace(y0=starts[i]), method, times, variations=vectors)
        assert made.status[i] is Status.FINISHED
        for found, expected in ((made.variations[i], one.variations), (made.y[i], one.y)):
            error = np.abs(found - expected).max() / np.abs(expected).max()
            assert error < 3e-15  # measured: at most 5.9e-16
        assert np.array_equal(made[i].directions[0], one.directions[0])


@pytest.mark.parametrize("method", METHODS[:2], ids=repr)
def test_the_map_of_gauss_is_symplectic(method, alone):
    problem = problems.load("henon_heiles")
    starts = problem.y0 * np.linspace(0.7, 1.0, COUNT)[:, np.newaxis]
    made = integrate_many(problem, method, starts=starts, times=np.arange(0.0, 50.0, 0.7), variations="y0")
    assert not alone
    J = np.kron([[0, 1], [-1, 0]], np.eye(2))
    maps = made.variations
    errors = np.abs(np.swapaxes(maps, -1, -2) @ J @ maps - J).max(axis=(-1, -2))
    assert (errors / np.linalg.norm(maps, axis=(-1, -2)) ** 2).max() < 1e-15  # measured: 1.3e-16


@pytest.mark.parametrize("name", ["velocities", "bodies", "first order"])
def test_they_depend_neither_on_neighbours_nor_on_threads(name):
    problem, method = SYSTEMS[name], Gauss(s=6, h=0.1)
    starts, asked = ensemble(problem), wanted(problem, "vectors")
    times = problem.t0 + np.array([0.95, 2.0])
    made = integrate_many(problem, method, starts=starts, times=times, variations=asked)
    assert in_lanes(problem, method, 2)
    order = np.random.default_rng(0).permutation(COUNT)
    for threads, piece in ((2, None), (1, 3)):
        again = integrate_many(
            problem, method, starts=starts[order], times=times, variations=asked[order], threads=threads,
            piece=piece,
        )  # fmt: skip
        assert np.array_equal(again.variations, made.variations[order])
        assert np.array_equal(again.y, made.y[order])


def test_parameters_may_differ_from_lane_to_lane():
    problem, method = SYSTEMS["velocities"], Gauss(s=6, h=0.1)
    k = np.linspace(1.0, 2.0, COUNT)
    made = integrate_many(problem, method, parameters={"k": k}, times=[2.0], variations=["k", "m", "t0"])
    for i in range(COUNT):
        one = integrate(
            Problem(problem.system, y0=problem.y0, parameters={"m": [1.0, 2.5], "k": k[i]}, t_end=10.0),
            method, [2.0], variations=["k", "m", "t0"],
        )  # fmt: skip
        error = np.abs(made.variations[i] - one.variations).max() / np.abs(one.variations).max()
        assert error < 2e-15  # measured: at most 4.3e-16


def test_backwards_too(alone):
    problem, method = SYSTEMS["Lagrangian"], HBVM(k=8, s=3, h=0.1)
    times = problem.t0 - np.array([0.55, 2.0])
    made = integrate_many(problem, method, starts=ensemble(problem), times=times, variations=["y0", "a"])
    assert not alone
    assert in_lanes(problem, method, 3, moves=True)
    one = integrate(problem.replace(y0=ensemble(problem)[3]), method, times, variations=["y0", "a"])
    error = np.abs(made.variations[3] - one.variations).max() / np.abs(one.variations).max()
    assert error < 2e-15  # measured: at most 4.3e-16


def test_what_is_not_solved_in_its_lane_goes_alone_with_its_vectors(alone):
    """The bits of single trajectories, and NaN behind a failure."""
    problem, method = problems.load("henon_heiles"), Gauss(s=4, h=0.5)
    starts = np.tile(problem.y0, (3, 1))
    starts[1] = [0.0, 2.0, 0.0, 1.0]  # escapes
    made = integrate_many(problem, method, starts=starts, times=[1.0, 50.0], variations="y0")
    assert alone == [1]
    assert made.status[1] is Status.NONLINEAR_DIVERGENCE
    one = integrate(problem.replace(y0=starts[1]), method, [1.0, 50.0], variations="y0")
    reached = len(one.variations)
    assert reached == int((~np.isnan(made.y[1, :, 0])).sum())
    assert np.array_equal(made.variations[1, :reached], one.variations)
    assert np.isnan(made.variations[1, reached:]).all()
    assert np.array_equal(made.variations[0], made.variations[2])
    assert np.isfinite(made.variations[0]).all()


@pytest.mark.parametrize(
    ("method", "count"),
    [
        (HBVM(), 1), (Gauss(s=6, tol=1e-9), 1), (Gauss(s=4, h=0.1, solver="newton"), 1),
        (HBVM(k=20, s=3, h=0.1), 1), (Gauss(s=4, h=0.1), MOST_ROWS),
    ],
    ids=repr,
)  # fmt: skip
def test_others_go_one_by_one_with_the_bits_of_single_ones(method, count):
    problem = SYSTEMS["separable"]
    vectors = np.random.default_rng(1).standard_normal((2, count))
    assert not in_lanes(problem, method, count)
    made = integrate_many(problem, method, starts=ensemble(problem)[:2], times=[1.0], variations=vectors)
    one = integrate(problem.replace(y0=ensemble(problem)[1]), method, [1.0], variations=vectors)
    assert np.array_equal(made.variations[1], one.variations)


def test_as_many_rows_as_there_may_be():
    problem, method = SYSTEMS["separable"], Gauss(s=4, h=0.1)
    assert in_lanes(problem, method, MOST_ROWS - 1)
    lattice = problems.load("fput")
    assert not in_lanes(lattice, method, lattice.system.dim)
    program = prepared(method, lattice.system)[0]
    n, dim = 2, lattice.system.dim
    with pytest.raises(InputError, match="one by one"):
        program.batch_along(
            np.tile(lattice.y0, (n, 1)), times=[1.0],
            directions=(np.tile(np.eye(dim), (n, 1, 1)), np.zeros((n, lattice.system.n_par, dim))),
        )  # fmt: skip
