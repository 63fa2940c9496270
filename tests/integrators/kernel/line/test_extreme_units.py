"""Invariants whose squares are beyond the largest double, or below the smallest."""

import numpy as np
import pytest

from integrators import LineIntegral, integrate
from problems import Hamiltonian, Problem


def oscillator(q, p, m):
    return (p[0] * p[0] + q[0] * q[0]) / 2


@pytest.mark.parametrize("size", [1e-250, 1e-100, 1e50, 1e100, 1e200, 1e300])
def test_a_line_integral_is_right_or_says_why_not(size):
    problem = Problem(Hamiltonian(oscillator, dof=1), q0=[size], p0=[0.0], t_end=1.0)
    # From 1e160 on, an IndexError.
    solution = integrate(problem, LineIntegral(k=6, s=3, h=0.1, invariants=["energy"]), [1.0])
    if solution.status.failed:
        assert size >= 1e50
        assert solution.reason
    else:
        error = np.abs(solution.y[-1] / size - [np.cos(1.0), -np.sin(1.0)]).max()
        assert error < 1e-9  # 1e-11
