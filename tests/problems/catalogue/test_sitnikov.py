"""Sitnikov's problem: the paper's numbers, and the symmetry that rounding must keep."""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import problems
from problems import targets


def test_the_start_is_the_papers():
    problem = problems.load("sitnikov")
    with mpmath.workdps(40):
        momentum = float(mpmath.sqrt(10) / 20)
    assert problem.y0.tolist() == [
        *(-2.5, 0.0, 0.0, 2.5, 0.0, 0.0, 0.0, 0.0, 1e-9),
        *(0.0, -momentum, 0.0, 0.0, momentum, 0.0, 0.0, 0.0, 1e-5 * 0.5),
    ]
    assert problem.par.tolist() == [1.0, 1.0, 1e-5]
    assert (problem.t0, problem.t_end) == (0.0, 1500.0)
    assert problem.velocity(problem.y0)[0, 8] == 0.5


def test_the_primaries_have_the_eccentricity_asked_for():
    for e, d in ((0.0, 5.0), (0.3, 2.0), (0.75, 5.0)):
        problem = problems.load("sitnikov", e=e, d=d)
        speed = 2 * problem.y0[13]
        semi_axis = 1 / (2 / d - speed**2 / 2)  # vis-viva with G (m1 + m2) = 2
        assert semi_axis * (1 + e) == pytest.approx(d, rel=1e-14)


def test_conserved_quantities_at_the_start():
    problem = problems.load("sitnikov")
    found = problem.invariants(problem.y0)
    q, p = problem.y0[:9].reshape(3, 3), problem.y0[9:].reshape(3, 3)
    assert np.allclose(found["linear_momentum"][0], p.sum(axis=0), rtol=0, atol=1e-20)
    assert np.allclose(found["angular_momentum"][0], np.cross(q, p).sum(axis=0), rtol=1e-15, atol=1e-20)
    assert found["energy"][0] == pytest.approx(0.025 - 0.2 - 8e-6 + 1.25e-6, rel=1e-14)
    assert problem.guards(problem.y0)["off_axis"] == [0.0]


def test_the_guard_is_the_distance_from_the_axis():
    problem = problems.load("sitnikov")
    state = problem.y0.copy()
    state[6:8] = 3e-8, 4e-8
    assert problem.guards(state)["off_axis"] == [5e-8]


coordinate = st.floats(-10, 10, allow_subnormal=False).map(lambda x: x if abs(x) > 1e-100 else 0.0)


@settings(max_examples=200, deadline=None)
@given(hnp.arrays(np.float64, 8, elements=coordinate), st.floats(1e-9, 3.0))
def test_a_half_turn_with_the_primaries_swapped_is_kept_bit_for_bit(values: np.ndarray, m3: float):
    """On-symmetric states: primary 2 is primary 1 turned, the planetoid on the axis."""
    x, y, z, px, py, pz, z3, pz3 = values
    state = np.array([x, y, z, -x, -y, z, 0.0, 0.0, z3, px, py, pz, -px, -py, pz, 0.0, 0.0, pz3])
    problem = problems.load("sitnikov", m3=m3)
    compiled = np.empty(18)
    targets.numba(problem.system, "field")(0.0, state, problem.par, compiled)
    for field in (targets.numpy(problem.system, "field")(0.0, state, problem.par), compiled):
        if not np.isfinite(field).all():
            assert math.hypot(x, y) < 1e-50  # the primaries met
            continue
        bodies = field.reshape(6, 3)
        for block in (bodies[:3], bodies[3:]):
            first, second, third = block
            assert np.array_equal(first * [-1, -1, 1], second)
            assert third[0] == 0.0
            assert third[1] == 0.0


@settings(max_examples=200, deadline=None)
@given(hnp.arrays(np.float64, 18, elements=coordinate))
def test_the_field_commutes_with_the_half_turn_bit_for_bit(state: np.ndarray):
    turn = np.array([-1.0, -1.0, 1.0])

    def turned(values: np.ndarray) -> np.ndarray:
        first, second, third, *momenta = values.reshape(6, 3)
        blocks = (second, first, third, momenta[1], momenta[0], momenta[2])
        return np.concatenate([block * turn for block in blocks])

    problem = problems.load("sitnikov")
    for engine in ("numpy", "numba"):
        values = []
        for point in (state, turned(state)):
            if engine == "numpy":
                values.append(targets.numpy(problem.system, "field")(0.0, point, problem.par))
            else:
                out = np.empty(18)
                targets.numba(problem.system, "field")(0.0, point, problem.par, out)
                values.append(out)
        assert np.array_equal(turned(values[0]), values[1], equal_nan=True), engine
