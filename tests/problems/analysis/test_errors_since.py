"""Errors of invariants where each state has a start and parameters of its own."""

import numpy as np
import pytest

from problems import Hamiltonian
from problems.analysis import invariants

SYSTEM = Hamiltonian(
    lambda q, p, par: (p[0] ** 2 + p[1] ** 2) / (2 * par.mass) + par.k * (q[0] ** 2 + q[1] ** 2) / 2,
    dof=2,
    parameters={"mass": 1.0, "k": 1.0},
    invariants={
        "angular_momentum": lambda q, p: q[0] * p[1] - q[1] * p[0],
        "fradkin": lambda q, p, par: [p[0] * p[1] / par.mass + par.k * q[0] * q[1], q[0] ** 2, p[1] ** 2],
    },
    name="oscillator",
)
SCALES = (1.0, 1e150, 1e-80, 1e-150, 1e-170, 0.0)
"""The squares of the last but one are below the smallest double."""


@pytest.mark.parametrize("scale", SCALES)
def test_each_row_has_the_errors_that_it_has_alone(scale):
    rng = np.random.default_rng(3)
    n = 40
    y0 = scale * rng.normal(size=(n, 4))
    y = y0 * (1.0 + 1e-3 * rng.normal(size=(n, 4)))
    y0[:10, 2:] = y[:10, 2:] = 0.0  # no angular momentum
    y[20, 1] = np.nan
    par = rng.uniform(0.5, 2.0, size=(2, n))
    t0, t = rng.normal(size=n), rng.normal(size=n)
    together = invariants.errors_since(SYSTEM, par, y, t, starts=(t0, y0))
    for i in range(n):
        alone = invariants.errors(SYSTEM, par[:, i], y[i : i + 1], t[i : i + 1], start=(t0[i], y0[i]))
        for name, errors in together.items():
            assert np.isnan(errors[i]) == np.isnan(alone[name][0]) == (i == 20), (name, i)
            # measured 4e-16: norms of vectors are added up in another order
            assert i == 20 or abs(errors[i] - alone[name][0]) <= 1e-15 * abs(alone[name][0]), (name, i)
