"""Fields of systems with constraints, written in loops and one by one, against what defines them."""

import pickle

import numpy as np
import pytest

from problems import Constrained, Hamiltonian, Lagrangian, targets

N = 4
RANDOM = np.random.default_rng(0)
MASSES = RANDOM.uniform(0.5, 3.0, 2 * N).tolist()
PAIRS = [(0, 1), (1, 2), (2, 3), (0, 3)]


def length(q, i, j):
    return (q[2 * i] - q[2 * j]) ** 2 + (q[2 * i + 1] - q[2 * j + 1]) ** 2 - 1


LOOPS = {
    "rods": lambda q, m: m.each(lambda i, j: length(q, i, j), PAIRS),
    "place and sum": lambda q, m: [q[0], m.sum(lambda i: q[i] ** 2, range(2 * N)) - 3],
}
ONE_BY_ONE = {
    "rods": lambda q: [length(q, i, j) for i, j in PAIRS],
    "place and sum": lambda q: [q[0], sum(q[i] ** 2 for i in range(2 * N)) - 3],
}


def masses(loops):
    def H(q, p, par, m):
        total = (
            (lambda term, n: m.sum(term, range(n))) if loops else (lambda term, n: sum(map(term, range(n))))
        )
        return total(lambda i: p[i] ** 2 / (2 * par.m[i]), 2 * N) + total(lambda i: par.g * q[2 * i + 1], N)

    return Hamiltonian(H, dof=2 * N, parameters={"m": MASSES, "g": 1.3})


def magnetic(loops):
    def H(q, p, m):
        momenta = [p[i] + 0.3 * q[(i + 1) % (2 * N)] for i in range(2 * N)]
        kinetic = sum(
            p**2 / (2 * mass) * (1 + 0.1 * q[0] ** 2) for p, mass in zip(momenta, MASSES, strict=True)
        )
        return kinetic + (
            m.sum(lambda i: q[2 * i + 1], range(N)) if loops else sum(q[2 * i + 1] for i in range(N))
        )

    return Hamiltonian(H, dof=2 * N)


def mass_matrix(_):
    def L(q, v):
        kinetic = sum(MASSES[i] * v[i] ** 2 / 2 * (1 + 0.2 * q[i] ** 2) for i in range(2 * N))
        return (
            kinetic + 0.1 * sum(v[i] * v[i + 1] for i in range(2 * N - 1)) - sum(q[i] ** 2 for i in range(N))
        )

    return Lagrangian(L, dof=2 * N)


@pytest.mark.parametrize("names", [["rods"], ["rods", "place and sum"], ["place and sum"]])
@pytest.mark.parametrize("free", [masses, magnetic, mass_matrix])
def test_loops_and_single_formulas_give_one_field_that_keeps_the_constraints(free, names):
    drag = {True: lambda p, m: m.each(lambda i: -0.1 * p[i], range(2 * N)),
            False: lambda p: [-0.1 * p[i] for i in range(2 * N)]}  # fmt: skip
    system, single = (
        Constrained(free(loops), constraints=[kind[name] for name in names], force=drag[loops])
        for loops, kind in ((True, LOOPS), (False, ONE_BY_ONE))
    )
    system = pickle.loads(pickle.dumps(system))
    y, par = np.random.default_rng(1).uniform(-1.0, 1.0, 4 * N), system.pack()
    field = targets.numpy(system, "field")(0.0, y, par)
    assert np.abs(field - targets.numpy(single, "field")(0.0, y, par)).max() < 1e-13 * np.abs(field).max()

    def slope(name, direction):
        values = targets.numpy(system, system.invariants[name])
        return (values(0.0, y + 1e-6 * direction, par) - values(0.0, y - 1e-6 * direction, par)) / 2e-6

    rates = targets.numpy(system, system.invariants["constraint_rates"])(0.0, y, par)
    assert np.abs(slope("constraints", field) - rates).max() < 1e-8  # measured 1e-9
    assert np.abs(slope("constraint_rates", field)).max() < 1e-8  # measured 1e-9
    for name in ("constraints", "constraint_rates"):
        found = system.slopes(name)
        matrix = np.zeros(found.shape)
        matrix[found.rows, found.columns] = targets.numpy(system, found.function)(0.0, y, par)
        by_differences = np.stack([slope(name, direction) for direction in np.eye(4 * N)], axis=1)
        assert np.abs(matrix - by_differences).max() < 1e-8  # measured 1e-9
