"""Fields that jump on a surface in the state: steps end there, and say where the trajectory would slide."""

from typing import Any

import numpy as np
import pytest

from integrators import HBVM, Gauss, Status, integrate, integrate_many
from problems import Hamiltonian, Problem, VectorField

from .search.references import dry_friction

MU = 0.1
STARTS = np.array([[1.0, 0.0], [1.05, 0.0], [0.0, 2.3], [-3.0, 0.4]])
END = 40.0
METHODS = [HBVM(), HBVM(tol=1e-12), HBVM(tol=1e-8), HBVM(k=8, s=7, tol=1e-6), Gauss(s=6, tol=1e-12)]
FRICTION = {
    "where": VectorField(lambda y, m: [y[1], -y[0] - MU * m.where(y[1] > 0, 1, -1)], dim=2),
    "reversed": VectorField(lambda y, m: [y[1], -y[0] + MU * m.where(y[1] < 0, 1, -1)], dim=2),
}


def expected(start, times):
    x, v, rest = dry_friction(times, 0.0, start, MU)
    return np.stack([x, v], axis=1), rest


@pytest.mark.parametrize("name", FRICTION)
@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_dry_friction_follows_the_exact_solution_and_ends_at_rest(method, name):
    # Before: step_underflow or nonlinear_divergence at the first or second turn, or after 1700 steps.
    times = np.linspace(0.0, END, 101)
    for start in STARTS:
        found = integrate(Problem(FRICTION[name], y0=start, t_end=END), method, times)
        states, rest = expected(start, times)
        # Measured 4e-15, 4e-15, 3e-12, 2e-10, 4e-15.
        most = 1e-13 if method.tol is None or method.tol < 1e-11 else 0.01 * method.tol
        assert np.abs(found.y - states[: len(found.t)]).max() < most, (start, name)
        if rest > END:
            assert found.status is Status.FINISHED
        else:
            assert found.status is Status.SLIDING
            assert abs(found.t_stop - rest) < 100 * most
            assert found.t[-1] <= rest < found.t[-1] + 0.4
            assert "slides along it or sticks there" in found.reason
        assert found.stats.steps < 150  # measured 12 to 117


@pytest.mark.parametrize("method", METHODS[::2], ids=repr)
def test_an_ensemble_has_the_same_trajectories(method):
    times = np.linspace(0.0, END, 11)
    problem = Problem(FRICTION["where"], y0=STARTS[0], t_end=END)
    many = integrate_many(problem, method, starts=STARTS, times=times)
    for i, start in enumerate(STARTS):
        alone = integrate(Problem(problem.system, y0=start, t_end=END), method, times)
        assert many.status[i] is alone.status
        assert np.array_equal(many.y[i][: len(alone.t)], alone.y)


def test_a_start_on_the_surface_leaves_it_or_stays():
    for name, system in FRICTION.items():
        for x, stays in ((0.05, True), (-0.0999, True), (0.1001, False), (-1.0, False)):
            found = integrate(Problem(system, y0=[x, 0.0], t_end=1.0), HBVM(), [1.0])
            assert found.status is (Status.SLIDING if stays else Status.FINISHED), (name, x)
            assert not stays or found.t_stop == 0.0


@pytest.mark.parametrize("method", [HBVM(), Gauss(s=4, tol=1e-9)], ids=repr)
def test_a_relay_slides_and_says_when(method):
    # x' = -1 above a moving line, +1 below: it is caught at t = 2/3 and would follow the line.
    relay = VectorField(lambda t, y, m: [m.where(y[0] > t / 2, -1, 1)], dim=1)
    found = integrate(Problem(relay, y0=[1.0], t_end=3.0), method, [0.5, 3.0])
    assert found.status is Status.SLIDING
    assert abs(found.t_stop - 2.0 / 3.0) < 1e-14  # measured 1e-16
    assert found.y.tolist() == [[0.5]]


def test_backwards_and_back_again():
    problem = Problem(FRICTION["where"], y0=STARTS[2], t_end=12.0)
    ahead = integrate(problem, HBVM(), [12.0])
    back = Problem(problem.system, y0=ahead.y[-1], t0=12.0, t_end=0.0)
    assert np.abs(integrate(back, HBVM(), [0.0]).y[-1] - STARTS[2]).max() < 1e-12  # measured 4e-15


def test_samples_and_checkpoints_on_and_beside_a_surface():
    program: Any = HBVM().compile(FRICTION["where"])
    plain = integrate(Problem(FRICTION["where"], y0=STARTS[2], t_end=END), HBVM(), [END / 2], sample="steps")
    on_surface = plain.t[np.abs(plain.y[:, 1]) < 1e-14]
    assert on_surface.size == 6
    times = np.unique(np.concatenate([np.linspace(0.5, 20.0, 79), on_surface]))
    unbroken = program.start(STARTS[2])
    expected_states = np.concatenate([unbroken.advance([t]).y for t in times])
    assert np.abs(expected_states - expected(STARTS[2], times)[0]).max() < 1e-13  # measured 4e-15
    first, second = program.start(STARTS[2]), program.start(STARTS[2])
    for t, state in zip(times, expected_states, strict=True):
        assert np.array_equal(first.advance([t]).y[0], state)
        second.restore(first.checkpoint())
        first, second = second, first
    for sample, most in (("stop", 1e-13), ("dense", 1e-6)):  # measured 5e-15, 1e-9
        found = integrate(Problem(FRICTION["where"], y0=STARTS[2], t_end=20.0), HBVM(), times, sample=sample)
        assert np.abs(found.y - expected(STARTS[2], times)[0]).max() < most, sample


@pytest.mark.parametrize("tol", [None, 1e-8])
def test_a_bed_of_springs_conserves_energy_at_every_contact(tol):
    def energy(q, p, m):
        return p[0] ** 2 / 2 + m.where(q[0] > 0, q[0], 25 * q[0] ** 2 + q[0])

    bed = Problem(Hamiltonian(energy, dof=1), q0=[1.0], p0=[0.0], t_end=60.0)
    found = integrate(bed, HBVM() if tol is None else HBVM(tol=tol), np.linspace(0.0, 60.0, 61))
    assert found.errors()["energy"].max() < 1e-14  # measured 1e-15
    assert (found.stats.rejections or 0) < 8 * len(found.stats.extra["kinks"])


def atoms(n, lattice):
    """Return Lennard-Jones atoms near a lattice, whose forces are cut off at a distance of 2.5."""

    def energy(q, p, m):
        def pair(i, j):
            square = sum((q[3 * i + a] - q[3 * j + a]) ** 2 for a in range(3))
            return m.where(square < 6.25, 4 * (square**-6 - square**-3), 0.0)

        pairs = [(i, j) for i in range(n) for j in range(i)]
        return m.sum(lambda a: p[a] ** 2 / 2, range(3 * n)) + m.sum(pair, pairs)

    rng = np.random.default_rng(0)
    return Problem(
        Hamiltonian(energy, dof=3 * n), q0=1.12 * lattice + rng.normal(0.0, 0.02, 3 * n),
        p0=rng.normal(0.0, 0.8, 3 * n), t_end=0.3,
    )  # fmt: skip


def test_a_cutoff_of_many_pairs_does_not_crawl():
    lattice = np.stack(np.meshgrid(*[np.arange(3.0)] * 3), axis=-1).reshape(-1)
    found = integrate(atoms(27, lattice), HBVM(max_steps=1000), [0.3])
    assert found.status is Status.FINISHED  # before: 3000 steps did not do
    assert found.stats.steps + (found.stats.rejections or 0) < 600


@pytest.mark.slow
def test_nor_does_that_of_108_atoms():
    cell = np.array([(0, 0, 0), (1, 1, 0), (1, 0, 1), (0, 1, 1)]) / 2
    corners = np.argwhere(np.ones((3, 3, 3)))
    lattice = np.sqrt(2.0) * (corners[:, None] + cell).ravel()
    found = integrate(atoms(108, lattice), HBVM(max_steps=1000), [0.3])
    assert found.status is Status.FINISHED
    assert found.stats.steps + (found.stats.rejections or 0) < 2400  # measured 594 + 1507
