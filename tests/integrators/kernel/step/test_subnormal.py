"""A component too small to divide by does not stop an implicit solver."""

import numpy as np
import pytest

from integrators import HBVM, Status, integrate
from problems import Problem, VectorField


@pytest.mark.parametrize("solver", ["newton", "blended"])
def test_a_component_of_subnormal_size_is_no_obstacle(solver):
    def f(t, y, m):
        return [-y[0] * y[0], y[2], -y[1]]

    problem = Problem(VectorField(f, dim=3), y0=[1.0, 0.0, 5e-310], t_end=1.0)
    solution = integrate(problem, HBVM(k=4, s=2, h=0.1, solver=solver), [0.0, 1.0])
    assert solution.status is Status.FINISHED, solution.reason
    assert abs(solution.y[-1, 0] - 0.5) < 1e-5  # measured 2.6e-7
    assert np.isfinite(solution.y).all()
