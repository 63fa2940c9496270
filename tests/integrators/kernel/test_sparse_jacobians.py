"""Sparse Jacobians: of loops by their graph, of foreign code by differences of groups of columns."""

import pickle

import numpy as np
import pytest
import scipy.sparse
from scipy.integrate import solve_ivp
from scipy.sparse.linalg import splu

from integrators import HBVM, integrate
from integrators.kernel.implicit.factors import Triangular
from integrators.kernel.implicit.groups import groups
from integrators.kernel.native.memory import aligned
from problems import InputError, Opaque, Problem, VectorField

N = 100
TRIDIAGONAL = scipy.sparse.diags_array([np.ones(N - 1), np.ones(N), np.ones(N - 1)], offsets=[-1, 0, 1])
START = np.sin(np.pi * np.arange(1, N + 1) / (N + 1))


def heat(t, y):
    padded = np.concatenate([[0.0], y, [0.0]])
    return N**2 * (padded[:-2] - 2 * y + padded[2:]) - y**3


def stiff(dim, **options):
    problem = Problem(Opaque(heat, dim=dim, name="heat", **options), y0=START, t_end=0.1)
    return integrate(problem, HBVM(tol=1e-9, solver="newton"), [0.1])


def test_a_pattern_saves_evaluations_and_changes_nothing_else():
    whole, sparse = stiff(N), stiff(N, jac_sparsity=TRIDIAGONAL)
    jacobians = whole.stats.extra["implicit"]["jacobians"]
    assert sparse.stats.extra["implicit"]["jacobians"] == jacobians
    besides = [run.stats.evaluations - 16 * run.stats.iterations for run in (whole, sparse)]  # of 16 stages
    assert besides[0] - besides[1] == (N - 3) * jacobians
    reference = solve_ivp(heat, (0.0, 0.1), START, method="Radau", rtol=1e-12, atol=1e-13).y[:, -1]
    assert sparse.y[-1] == pytest.approx(reference, abs=1e-12)  # measured 3e-16
    assert whole.y[-1] == pytest.approx(reference, abs=1e-12)


def test_a_pickled_system_keeps_its_pattern():
    rows, columns = pickle.loads(pickle.dumps(Opaque(heat, dim=N, jac_sparsity=TRIDIAGONAL))).sparsity
    assert set(zip(rows.tolist(), columns.tolist(), strict=True)) == {
        (i, j) for i in range(N) for j in range(max(i - 1, 0), min(i + 2, N))
    }


@pytest.mark.parametrize("given", [np.ones((2, 3)), "tridiagonal", np.ones(3)])
def test_a_pattern_of_another_shape_is_refused(given):
    with pytest.raises(InputError, match=r"jac_sparsity=.* must be a matrix of shape \(3, 3\)"):
        Opaque(lambda t, y: -y, dim=3, jac_sparsity=given)


@pytest.mark.parametrize("seed", range(20))
def test_columns_of_a_group_have_no_row_in_common(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 30))
    pattern = rng.random((n, n)) < rng.random()
    rows, columns = np.nonzero(pattern)
    group = groups(rows, columns, n)
    assert sorted(set(group.tolist())) == list(range(group.max() + 1))
    for number in range(group.max() + 1):
        assert pattern[:, group == number].sum(axis=1).max() <= 1


def test_a_grid_of_loops_is_solved_with_sparse_factors_like_scipy_solves_it():
    n = 10
    cell = np.arange(n * n).reshape(n, n)
    near = [np.roll(cell, shift, axis) for axis in (0, 1) for shift in (1, -1)]
    stencil = np.stack([cell, *near], axis=-1).reshape(-1, 5)

    def f(y, m):
        u, v = y[: n * n], y[n * n :]

        def laplace(w, i, near):
            return 10.0 * (w[near[0]] + w[near[1]] + w[near[2]] + w[near[3]] - 4 * w[i])

        return [
            m.each(lambda i, *near: 1 + u[i] ** 2 * v[i] - 4.4 * u[i] + laplace(u, i, near), stencil),
            m.each(lambda i, *near: 3.4 * u[i] - u[i] ** 2 * v[i] + laplace(v, i, near), stencil),
        ]

    def plain(t, y):
        u, v = y.reshape(2, n, n)

        def laplace(w):
            return 10.0 * (sum(np.roll(w, s, axis) for axis in (0, 1) for s in (1, -1)) - 4 * w)

        parts = 1 + u * u * v - 4.4 * u + laplace(u), 3.4 * u - u * u * v + laplace(v)
        return np.concatenate([part.ravel() for part in parts])

    start = np.random.default_rng(1).uniform(0.5, 1.5, 2 * n * n)
    problem = Problem(VectorField(f, dim=2 * n * n), y0=start, t_end=1.0)
    reference = solve_ivp(plain, (0.0, 1.0), start, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    for solver in ("newton", "blended"):
        solution = integrate(problem, HBVM(solver=solver), [1.0])
        assert solution.stats.extra["implicit"]["jacobian"] == "traced"
        assert solution.y[-1] == pytest.approx(reference, abs=1e-12)  # measured 1e-13


def solved_by_factors(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 200))
    matrix = scipy.sparse.random_array((n, n), density=min(1.0, 4 / n), rng=rng, data_sampler=rng.normal)
    matrix = (matrix + scipy.sparse.diags_array(rng.normal(size=n)).tocsr()[rng.permutation(n)]).tocsc()
    if np.linalg.cond(matrix.toarray()) > 1e8:
        return
    vectors = aligned(8 * n).reshape(n, 8)
    vectors[:] = rng.normal(size=(n, 8))
    given = vectors.copy()
    order = "MMD_AT_PLUS_A" if seed % 2 else "COLAMD"
    Triangular(splu(matrix, permc_spec=order))(vectors)
    scale = abs(matrix).max() * abs(vectors).max() + 1.0
    assert abs(matrix @ vectors - given).max() <= 1e-12 * scale  # measured 3e-16


@pytest.mark.parametrize("seed", range(20))
def test_eight_vectors_are_solved_with_sparse_factors(seed):
    solved_by_factors(seed)


@pytest.mark.slow
def test_eight_vectors_are_solved_with_sparse_factors_of_many_matrices():
    for seed in range(20, 2000):
        solved_by_factors(seed)


@pytest.mark.slow
def test_the_default_factors_one_real_matrix_where_the_jacobian_is_sparse():
    n = 20
    cell = np.arange(n * n).reshape(n, n)
    near = [np.roll(cell, shift, axis) for axis in (0, 1) for shift in (1, -1)]
    stencil = np.stack([cell, *near], axis=-1).reshape(-1, 5)

    def f(y, m):
        def term(i, *near):
            return 1000.0 * (sum(y[j] for j in near) - 4 * y[i]) - y[i] ** 3

        return m.each(term, stencil)

    def plain(t, y):
        w = y.reshape(n, n)
        around = sum(np.roll(w, shift, axis) for axis in (0, 1) for shift in (1, -1))
        return (1000.0 * (around - 4 * w) - w**3).ravel()

    start = np.random.default_rng(1).uniform(-1.0, 1.0, n * n)
    problem = Problem(VectorField(f, dim=n * n), y0=start, t_end=0.5)
    solution = integrate(problem, HBVM(tol=1e-6), [0.5])
    assert "blended" in solution.stats.solver
    assert "Newton" not in solution.stats.solver
    reference = solve_ivp(plain, (0.0, 0.5), start, method="BDF", rtol=1e-9, atol=1e-12).y[:, -1]
    assert solution.y[-1] == pytest.approx(reference, abs=1e-11)  # measured 7e-14
