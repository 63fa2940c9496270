"""Stiff fields of many rows that depend smoothly on the time: the implicit solver takes over by itself."""

import numpy as np
import pytest

from integrators import HBVM, integrate
from problems import Problem, VectorField

END = 20.0


def draw(rng, rows):
    """Return a stiff system that follows a smooth function of time: decays, or a diffusion."""
    frequency, size = rng.uniform(0.2, 2.0), rng.uniform(0.5, 2.0)

    def forcing(t, m):
        return size * [m.sin(frequency * t), m.cos(frequency * t), m.exp(-frequency * t)][shape]

    shape, rates = rng.integers(3), rng.permutation(np.geomspace(1.0, 10.0 ** rng.uniform(3.5, 5.0), rows))

    def decays(t, y, m):
        followed = forcing(t, m)
        return [float(rate) * (followed - y[i]) for i, rate in enumerate(rates)]

    def diffusion(t, y, m):
        u = [forcing(t, m), *[y[i] for i in range(rows)], 0.0]
        return [(u[i] - 2 * u[i + 1] + u[i + 2]) * rows**2 - reaction * u[i + 1] ** 3 for i in range(rows)]

    reaction = rng.choice([0.0, 1.0])
    field = decays if rng.random() < 0.5 else diffusion
    return Problem(VectorField(field, dim=rows), y0=np.zeros(rows), t_end=END)


def check(seed, tolerances):
    rng = np.random.default_rng(seed)
    problem = draw(rng, int(rng.integers(65, 110)))
    for tol in tolerances:
        found = integrate(problem, HBVM(tol=tol, max_steps=5000), [END])
        exact = integrate(problem, HBVM(tol=tol, solver="newton"), [END])
        assert not found.status.failed, found.reason
        assert found.stats.extra["implicit"]["switches"] >= 1
        assert found.stats.steps < 1500, (seed, tol)  # measured at most 323; before: more than 60,000
        assert np.abs(found.y - exact.y).max() < 1e2 * tol  # measured 2e-8 at 1e-6


@pytest.mark.parametrize("seed", range(2))
def test_the_implicit_solver_takes_over_beyond_64_rows_whatever_the_field_does_in_time(seed):
    check(seed, [1e-6])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 140))
def test_so_it_does_in_forty_systems(seed):
    check(seed, [1e-6, 1e-9])
