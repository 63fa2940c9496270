"""Smooth profiles on fine grids, coordinates far from 0: rounding of differences is no error of a step."""

import math

import numpy as np
import pytest

from integrators import HBVM, Gauss, integrate, integrate_many
from integrators.protocol import Status
from problems import Hamiltonian, Problem, VectorField
from problems.catalogue.fput import fput

MOST_STEPS = 1000  # so that a failure ends
METHODS = [
    HBVM(max_steps=MOST_STEPS),
    HBVM(tol=1e-9, max_steps=MOST_STEPS),
    Gauss(s=8, tol=1e-9, max_steps=MOST_STEPS),
]
MORE = 3.0  # times the steps of the coarse grid, or those about 0


def solved(problem, method):
    """Return the solution at the end."""
    made = integrate(problem, method, [problem.t_end])
    assert made.status == Status.FINISHED, made.reason
    return made


def displaced_pendulum(turns):
    """Return a pendulum that has turned so many times."""
    system = Hamiltonian(lambda q, p, m: p[0] ** 2 / 2 - m.cos(q[0]), dof=1, name="displaced_pendulum")
    return Problem(system, q0=[2.0 * math.pi * turns + 1.0], p0=[0.5], t_end=50.0)


def displaced_kepler(x):
    """Return Kepler's problem about (x, 0)."""

    def energy(q, p, m):
        return (p[0] ** 2 + p[1] ** 2) / 2 - 1 / m.sqrt((q[0] - x) ** 2 + q[1] ** 2)

    system = Hamiltonian(energy, dof=2, name="displaced_kepler")
    return Problem(system, q0=[x + 0.7, 0.0], p0=[0.0, math.sqrt(1.3 / 0.7)], t_end=20.0)


def ring(n, rate, reaction):
    """Return u' = rate u_xx + reaction (u - u^3) on n cells of distance 1."""

    def field(y, m):
        cells = [(i, (i - 1) % n, (i + 1) % n) for i in range(n)]
        return m.each(
            lambda i, left, right: rate * (y[left] - 2 * y[i] + y[right]) + reaction * (y[i] - y[i] ** 3),
            cells,
        )

    start = np.sin(2.0 * np.pi * np.arange(n) / n)
    return Problem(VectorField(field, dim=n, name=f"ring_{n}"), y0=start, t_end=5.0)


@pytest.mark.parametrize("method", METHODS, ids=repr)
def test_a_chain_in_its_lowest_mode_takes_one_step_however_many_masses_it_has(method):
    # Before: 39,491 steps of HBVM() with 10,000 masses.
    made = solved(fput(n=10_000, t_end=1.0), method)
    assert made.stats.steps == 1
    assert made.warnings == ()
    exact = math.cos(2.0 * math.sin(math.pi / 20_002)) * np.asarray(fput(n=10_000).y0[:10_000])
    assert np.abs(made.y[-1, :10_000] - exact).max() < 1e-10  # measured 4e-12: the nonlinear force


def test_chains_in_lanes_take_one_step():
    problem = fput(n=10_000, t_end=1.0)
    starts = np.outer(1.0 + 0.01 * np.arange(8), problem.y0)
    made = integrate_many(problem, METHODS[0], starts=starts, times=[1.0])
    assert set(made.status) == {Status.FINISHED}
    assert max(made.steps) == 1


@pytest.mark.parametrize("method", METHODS, ids=repr)
@pytest.mark.parametrize(
    ("displaced", "far"), [(displaced_pendulum, 1e7), (displaced_kepler, 1e6)], ids=["pendulum", "kepler"]
)
def test_coordinates_far_from_0_take_no_more_steps(method, displaced, far):
    # Steps relative to those about 0: 0.7 to 1.0
    near = solved(displaced(0), method)
    assert solved(displaced(far), method).stats.steps <= MORE * near.stats.steps


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_random_chains_and_rings_take_no_more_steps_on_fine_grids(seed):
    # Steps relative to those of 100 cells: 0.1 to 2.0 in 40.
    random = np.random.default_rng(seed)
    n, method = int(10.0 ** random.uniform(2.5, 4.5)), METHODS[seed % len(METHODS)]
    if seed % 2:
        rate, reaction = random.uniform(0.1, 2.0), float(random.integers(0, 2))
        coarse, fine = ring(100, rate, reaction), ring(n, rate, reaction)
    else:
        alpha, beta = random.uniform(-0.5, 0.5), random.uniform(0.0, 1.0)
        t_end, amplitude = random.uniform(0.5, 5.0), 10.0 ** random.uniform(-3.0, 0.5)
        coarse, fine = (
            fput(n=count, alpha=alpha, beta=beta, amplitude=amplitude, t_end=t_end) for count in (100, n)
        )
    few, many = solved(coarse, method), solved(fine, method)
    assert many.stats.steps <= MORE * max(few.stats.steps, 2)
