"""Errors of invariants in units that make them smaller or larger than doubles are."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from problems import Hamiltonian, Problem, VectorField
from problems.analysis.invariants import evaluate
from problems.double_double import DD
from problems.evaluate import wide


def oscillator(amplitude: float) -> Problem:
    def H(q, p):
        return (p[0] ** 2 + p[1] ** 2) / 2 + (q[0] ** 2 + q[1] ** 2) / 2

    def angular_momentum(q, p):
        return q[0] * p[1] - q[1] * p[0]

    def both(q, p):
        return [q[0] * p[1], q[1] * p[0]]

    system = Hamiltonian(H, dof=2, invariants={"angular_momentum": angular_momentum, "both": both})
    a = amplitude
    return Problem(system, q0=[a, 0.5 * a], p0=[-0.25 * a, a], t_end=1.0)


@given(st.integers(-1060, 1000))
def test_a_relative_error_does_not_depend_on_the_unit(exponent):
    unit = 2.0**exponent  # exact, so that the ratio is the same number
    problem = oscillator(unit)
    states = problem.y0 * np.array([[1.0], [1.0625], [0.75]])
    expected = np.array([0.0, 1.0625**2 - 1.0, 1.0 - 0.75**2]) / 1.0625**2  # the largest
    for name, error in problem.errors(states).items():
        # Measured: 1.2e-16 for all exponents; before, 0 below 2**-269 and nan above 2**255 for vectors.
        assert error == pytest.approx(expected, rel=1e-15), name


@pytest.mark.parametrize("unit", [1e-160, 1e-165, 1e-200, 5e-308, 1e151, 1e160, 1e300])
def test_three_percent_are_three_percent(unit):
    problem = oscillator(unit)
    assert problem.errors(1.015 * problem.y0)["energy"] == pytest.approx([0.030225 / 1.030225], rel=1e-12)


def test_an_invariant_that_cancels_is_measured_by_its_terms():
    system = VectorField(
        lambda y: [y[1], -y[0]], dim=2, invariants={"sum": lambda y: y[0] + y[1]}, name="zero"
    )
    problem = Problem(system, y0=[0.1, -0.1], t_end=1.0)
    assert problem.errors([[0.25, 0.5], [1.5, -1.5]])["sum"] == pytest.approx([0.25, 0.0])


def test_a_state_whose_energy_is_beyond_the_doubles_has_an_error_of_100_percent_and_no_nan():
    def H(q, p):
        return p[0] ** 2 / 2 + q[0] ** 4

    problem = Problem(Hamiltonian(H, dof=1), q0=[1.0], p0=[0.0], t_end=1.0)
    errors = problem.errors([[1e200, 1.0], [1.0, 0.0], [np.inf, 0.0]])["energy"]
    assert errors[0] == 1.0
    assert errors[1] == 0.0
    assert not errors[2] < np.inf


@given(st.floats(1e-140, 1.7e308), st.floats(1e-140, 1.7e308))
def test_products_are_exact_to_32_digits_until_doubles_overflow(a, b):
    product = a * b
    if not 1e-270 < product < 1e308:
        return
    found = DD(a) * DD(b)
    exact = Fraction(a) * Fraction(b)
    assert abs(Fraction(float(found.hi)) + Fraction(float(found.lo)) - exact) <= exact * Fraction(1, 10**31)


def test_wide_numbers_agree_with_pairs_of_doubles(case, states):
    par = case.system.pack()
    for function in filter(None, (case.system.field, case.system.energy)):
        pairs = evaluate(function, 0.3, states[:2].T, par)
        for k in range(2):
            for pair, value in zip(pairs, wide.evaluate(function, 0.3, states[k], par), strict=True):
                assert math.isclose(float(value), float(pair.rounded()[k]), rel_tol=1e-15, abs_tol=1e-20)


def test_a_table_of_tiny_numbers_has_a_relative_error():
    knots, values = [-1.0, 0.0, 1.0, 2.0], [0.0, 1e-200, 1e-200, 0.0]
    system = Hamiltonian(lambda q, p, m: p[0] ** 2 + m.table(q[0], knots, values) * 1e-150, dof=1)
    problem = Problem(system, q0=[0.0], p0=[0.0], t_end=1.0)
    assert problem.errors([[1.0, 0.0], [-1.0, 0.0]])["energy"] == pytest.approx([0.0, 1.0], abs=1e-14)
