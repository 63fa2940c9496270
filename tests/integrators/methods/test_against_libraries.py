"""Against SciPy and heyoka, with the equations written out again in their own way."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import integrators
from integrators import HBVM, Gauss

TIMES = np.linspace(0.0, 50.0, 51)


def by_hand(t, y):
    q1, q2, p1, p2 = y
    return [p1, p2, -q1 - 2 * q1 * q2, -q2 - q1 * q1 + q2 * q2]


@pytest.mark.parametrize("method", [HBVM(k=16, s=10, h=0.5), Gauss(s=8, h=0.25)], ids=repr)
def test_agrees_with_dop853(method, henon_heiles):
    ours = integrators.integrate(henon_heiles, method, TIMES).y
    theirs = solve_ivp(
        by_hand, (0.0, 50.0), henon_heiles.y0, method="DOP853", t_eval=TIMES, rtol=3e-14, atol=1e-15
    ).y.T
    assert np.abs(ours - theirs).max() < 2e-12  # measured 8.8e-14, DOP853's own error


@pytest.mark.parametrize("method", [HBVM(k=16, s=10, h=0.5), Gauss(s=8, h=0.25)], ids=repr)
def test_agrees_with_heyoka(method, henon_heiles):
    hy = pytest.importorskip("heyoka")
    q1, q2, p1, p2 = hy.make_vars("q1", "q2", "p1", "p2")
    equations = [(q1, p1), (q2, p2), (p1, -q1 - 2.0 * q1 * q2), (p2, -q2 - q1 * q1 + q2 * q2)]
    taylor = hy.taylor_adaptive(equations, henon_heiles.y0.tolist(), tol=1e-18)
    theirs = taylor.propagate_grid(TIMES)[-1]
    ours = integrators.integrate(henon_heiles, method, TIMES).y
    assert np.abs(ours - theirs).max() < 5e-14  # measured 2.0e-15
