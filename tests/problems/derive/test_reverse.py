"""Products of weights with derivatives: what forward differentiation says, in one pass."""

import numpy as np
import pytest

import problems
from problems import targets
from problems.derive.reverse import reverse


@pytest.mark.parametrize("limit", [0, None])  # declared sums as loops, and written out
@pytest.mark.parametrize(
    "name", ["fput", "outer_solar_system", "double_pendulum", "rigid_body", "schwarzschild", "sitnikov"]
)
def test_products_are_those_of_forward_differentiation(name, limit):
    problem, rng = problems.load(name), np.random.default_rng(0)
    system, dim, n_par = problem.system, problem.system.dim, problem.par.size
    weights, along, along_par = (rng.standard_normal(n) for n in (dim, dim, n_par))
    products = [
        targets.numpy(
            system, reverse(system.field, variables=variables, count=count, name="product"), limit=limit
        )(0.1, np.concatenate([weights, problem.y0]), problem.par)
        for variables, count in (("state", dim), ("parameters", n_par))
    ]
    forward = targets.numpy(system, system.tangent("field", 1, parameters=True))(
        0.1, np.concatenate([along, problem.y0]), np.concatenate([problem.par, along_par])
    )
    terms = [*(products[0] * along), *(products[1] * along_par)]
    # measured: at most 3e-15 of the sum, on sitnikov, whose terms cancel
    assert abs(sum(terms) - weights @ forward) < 1e-14 * np.abs(terms).sum()
