"""The function itself behind its derivatives along directions."""

import numpy as np
import pytest

import problems
from problems import targets


@pytest.mark.parametrize("name", ["kepler", "fput", "double_pendulum"])  # with sums, and without
def test_the_function_follows_its_derivatives(name):
    problem = problems.load(name)
    system, count = problem.system, 2
    rng = np.random.default_rng(0)
    vectors = rng.standard_normal((count, system.dim))
    par = np.concatenate([problem.par, *rng.standard_normal((count, system.n_par))])
    y = np.concatenate([*vectors, problem.y0])
    along, beside = (
        targets.numpy(system, system.tangent("field", count, parameters=True, beside=flag))(0.0, y, par)
        for flag in (False, True)
    )
    assert np.array_equal(beside[: count * system.dim], along)
    field = targets.numpy(system, "field")(0.0, problem.y0, problem.par)
    assert np.abs(beside[count * system.dim :] - field).max() < 1e-15  # measured: 0
