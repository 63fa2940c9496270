"""Components too small to divide by, and fields that begin below the smallest doubles, are no obstacle."""

import numpy as np
import pytest

from integrators import HBVM, Gauss, Status, integrate, integrate_many
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


@pytest.mark.parametrize("method", [HBVM(max_steps=2000), Gauss(s=6, tol=1e-12, max_steps=2000)], ids=repr)
@pytest.mark.parametrize(("c", "width"), [(17.093303886583172, 0.44986989890240514), (20.5, 0.33)])
def test_a_pulse_that_begins_below_the_smallest_doubles_does_not_hold_steps_back(c, width, method):
    # HBVM() came to t = 3.45 in 2,000 steps: estimates of 0 and 1e-37 took turns, each a trend.
    omega = 0.6128532347112134

    def f(t, y, m):
        return [y[1], -(omega**2) * y[0] + m.exp(-(((t - c) / width) ** 2))]

    problem = Problem(VectorField(f, dim=2), y0=[0.0, 0.0], t_end=50.0)
    solution = integrate(problem, method)
    assert solution.status is Status.FINISHED, solution.reason
    # The Fourier integral of a Gaussian pulse.
    size = width * np.sqrt(np.pi) * np.exp(-((omega * width / 2) ** 2))
    exact = [size / omega * np.sin(omega * (50.0 - c)), size * np.cos(omega * (50.0 - c))]
    assert np.abs(solution.y[-1] - exact).max() < 1e-13  # 2.9e-15
    together = integrate_many(problem, method, starts=np.tile(problem.y0, (3, 1)))
    assert together.status == [Status.FINISHED] * 3
    assert np.abs(together.y[:, -1] - exact).max() < 1e-13
